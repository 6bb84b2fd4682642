//! Backlash: a gap in which the gear transmits nothing; its whole width, joint side.

use super::{Full, Gear, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] =
    [Parameter::new("gap_rad").sum_is_not_negative().adds_up()];

pub(super) fn act(gear: &mut dyn Gear, strength: f64, gap_rad: f64) -> Result<(), Full> {
    gear.add_gap(strength * gap_rad);
    Ok(())
}
