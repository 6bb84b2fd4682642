//! Velocity filter lag: a further low-pass on the velocity that the drive tells. The last of several counts, at once.

use super::{Full, Sensors};

pub(super) fn act(sensors: &mut dyn Sensors, _strength: f64, cutoff_hz: f64) -> Result<(), Full> {
    sensors.filter_velocity(cutoff_hz);
    Ok(())
}
