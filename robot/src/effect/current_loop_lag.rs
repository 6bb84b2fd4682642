//! Current-loop lag: torque follows its command as a first-order low-pass does.

use super::{Actuator, Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("time_constant_s")
    .each_is_positive()
    .adds_up()];

pub(super) fn act(
    actuator: &mut dyn Actuator,
    strength: f64,
    time_constant_s: f64,
) -> Result<(), Full> {
    actuator.add_lag(strength * time_constant_s);
    Ok(())
}
