//! Torque constant error: true over nominal torque constant. Several multiply.

use super::{Actuator, Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("gain").each_is_positive()];

pub(super) fn act(actuator: &mut dyn Actuator, strength: f64, gain: f64) -> Result<(), Full> {
    actuator.scale_torque(1.0 - strength + strength * gain);
    Ok(())
}
