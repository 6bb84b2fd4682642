//! Position-dependent friction: friction that repeats with the angle of the motor; amplitude joint side.

use joint_model::friction::{PeriodicFriction, SteadyFriction};

use super::{Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 3] = [
    Parameter::new("amplitude_nm"),
    Parameter::new("cycles_per_motor_rev"),
    Parameter::new("phase_rad"),
];

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
