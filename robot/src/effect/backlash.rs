//! Backlash: a gap in which the gear transmits nothing; its whole width, joint side.

use super::{Full, Gear};

pub(super) fn act(gear: &mut dyn Gear, strength: f64, gap_rad: f64) -> Result<(), Full> {
    gear.add_gap(strength * gap_rad);
    Ok(())
}
