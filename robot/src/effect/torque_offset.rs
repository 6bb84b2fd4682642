//! Torque offset: a constant added to what the motor gives, joint side.

use super::{Actuator, Full};

pub(super) fn act(actuator: &mut dyn Actuator, strength: f64, offset_nm: f64) -> Result<(), Full> {
    actuator.add_torque(strength * offset_nm);
    Ok(())
}
