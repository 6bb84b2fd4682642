//! Torque ripple: what the motor gives repeats with its angle; amplitude motor side.

use joint_model::harmonic::Harmonic;

use super::{Actuator, Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 3] = [
    Parameter::new("amplitude_nm"),
    Parameter::new("cycles_per_motor_rev"),
    Parameter::new("phase_rad"),
];

pub(super) fn act(
    actuator: &mut dyn Actuator,
    strength: f64,
    amplitude_nm: f64,
    cycles_per_motor_rev: f64,
    phase_rad: f64,
) -> Result<(), Full> {
    actuator.add_ripple(Harmonic {
        amplitude: strength * amplitude_nm,
        cycles_per_rev: cycles_per_motor_rev,
        phase_rad,
    })
}
