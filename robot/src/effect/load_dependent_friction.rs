//! Load-dependent friction: Nm of friction per Nm that the gear carries.

use joint_model::friction::SteadyFriction;

use super::{Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("load_coefficient").adds_up()];

pub(super) fn act(
    friction: &mut SteadyFriction,
    strength: f64,
    load_coefficient: f64,
) -> Result<(), Full> {
    friction.load_dependent.load_coefficient += strength * load_coefficient;
    Ok(())
}
