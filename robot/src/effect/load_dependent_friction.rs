//! Load-dependent friction: Nm of friction per Nm that the gear carries.

use joint_model::friction::SteadyFriction;

use super::Full;

pub(super) fn act(
    friction: &mut SteadyFriction,
    strength: f64,
    load_coefficient: f64,
) -> Result<(), Full> {
    friction.load_dependent.load_coefficient += strength * load_coefficient;
    Ok(())
}
