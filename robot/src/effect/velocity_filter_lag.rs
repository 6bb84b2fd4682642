//! Velocity filter lag: a further low-pass on the velocity that the drive tells. The last of several counts, at once.

use super::{Full, Parameter, Scope, Sensors};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("cutoff_hz").each_is_positive()];

pub(super) fn act(sensors: &mut dyn Sensors, _strength: f64, cutoff_hz: f64) -> Result<(), Full> {
    sensors.filter_velocity(cutoff_hz);
    Ok(())
}
