//! Sensor delay: measurements are so much older, at once.

use super::{Bus, Full};

pub(super) fn act(bus: &mut dyn Bus, _strength: f64, delay_s: f64) -> Result<(), Full> {
    bus.delay_samples(delay_s);
    Ok(())
}
