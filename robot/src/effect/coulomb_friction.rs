//! Coulomb friction: a torque against the motion that is the same at every speed, joint side.

use joint_model::friction::SteadyFriction;

use super::Full;

pub(super) fn act(
    friction: &mut SteadyFriction,
    strength: f64,
    coulomb_nm: f64,
) -> Result<(), Full> {
    friction.coulomb.coulomb_nm += strength * coulomb_nm;
    Ok(())
}
