//! Command delay: commands act so much later, at once.

use super::{Bus, Full};

pub(super) fn act(bus: &mut dyn Bus, _strength: f64, delay_s: f64) -> Result<(), Full> {
    bus.delay_commands(delay_s);
    Ok(())
}
