//! Torque saturation: the drive gives no more than this, motor side. The least of several counts, at once.

use super::{Actuator, Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("limit_nm").each_is_positive()];

pub(super) fn act(actuator: &mut dyn Actuator, _strength: f64, limit_nm: f64) -> Result<(), Full> {
    actuator.limit_torque(limit_nm);
    Ok(())
}
