//! Sensor delay: measurements are so much older, at once.

use super::{Bus, Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Bus;
pub(super) const PARAMETERS: [Parameter; 1] =
    [Parameter::new("delay_s").sum_is_not_negative().adds_up()];

pub(super) fn act(bus: &mut dyn Bus, _strength: f64, delay_s: f64) -> Result<(), Full> {
    bus.delay_samples(delay_s);
    Ok(())
}
