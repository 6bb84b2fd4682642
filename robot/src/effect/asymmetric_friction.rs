//! Asymmetric friction: the joint rubs more in one direction than in the other; half the difference, joint side.

use joint_model::friction::SteadyFriction;

use super::{Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("asymmetry_nm").adds_up()];

pub(super) fn act(
    friction: &mut SteadyFriction,
    strength: f64,
    asymmetry_nm: f64,
) -> Result<(), Full> {
    friction.asymmetric.asymmetry_nm += strength * asymmetry_nm;
    Ok(())
}
