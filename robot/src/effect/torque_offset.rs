//! Torque offset: a constant added to what the motor gives, joint side.

use super::{Actuator, Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("offset_nm").adds_up()];

pub(super) fn act(actuator: &mut dyn Actuator, strength: f64, offset_nm: f64) -> Result<(), Full> {
    actuator.add_torque(strength * offset_nm);
    Ok(())
}
