//! Position-dependent friction: friction that repeats with the angle of the motor; amplitude joint side.

use joint_model::friction::{PeriodicFriction, SteadyFriction};

use super::Full;

pub(super) fn act(
    friction: &mut SteadyFriction,
    strength: f64,
    amplitude_nm: f64,
    cycles_per_motor_rev: f64,
    phase_rad: f64,
) -> Result<(), Full> {
    let term = PeriodicFriction {
        amplitude_nm: strength * amplitude_nm,
        cycles_per_motor_rev,
        phase_rad,
    };
    Full::push(&mut friction.periodic, term)
}
