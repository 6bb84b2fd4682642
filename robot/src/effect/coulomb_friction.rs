//! Coulomb friction: a torque against the motion that is the same at every speed, joint side.

use joint_model::friction::SteadyFriction;

use super::{Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("coulomb_nm").adds_up()];

pub(super) fn act(
    friction: &mut SteadyFriction,
    strength: f64,
    coulomb_nm: f64,
) -> Result<(), Full> {
    friction.coulomb.coulomb_nm += strength * coulomb_nm;
    Ok(())
}
