//! Quadratic friction: a torque against the motion with the square of speed, joint side.

use joint_model::friction::SteadyFriction;

use super::{Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("quadratic_nm_s2_rad2").adds_up()];

pub(super) fn act(
    friction: &mut SteadyFriction,
    strength: f64,
    quadratic_nm_s2_rad2: f64,
) -> Result<(), Full> {
    friction.quadratic.quadratic_nm_s2_rad2 += strength * quadratic_nm_s2_rad2;
    Ok(())
}
