//! Viscous friction: a torque against the motion in proportion to speed, joint side.

use joint_model::friction::SteadyFriction;

use super::{Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("viscous_nm_s_rad").adds_up()];

pub(super) fn act(
    friction: &mut SteadyFriction,
    strength: f64,
    viscous_nm_s_rad: f64,
) -> Result<(), Full> {
    friction.viscous.viscous_nm_s_rad += strength * viscous_nm_s_rad;
    Ok(())
}
