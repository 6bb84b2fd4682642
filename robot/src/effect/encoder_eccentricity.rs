//! Encoder eccentricity: an encoder leads and lags as its shaft turns, in angle of its side.

use joint_model::harmonic::Harmonic;

use super::{EncoderSide, Full, Parameter, Scope, Sensors};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 4] = [
    Parameter::new("amplitude_rad"),
    Parameter::new("cycles_per_rev"),
    Parameter::new("phase_rad"),
    Parameter::new("side"),
];

pub(super) fn act(
    sensors: &mut dyn Sensors,
    strength: f64,
    amplitude_rad: f64,
    cycles_per_rev: f64,
    phase_rad: f64,
    side: EncoderSide,
) -> Result<(), Full> {
    let error = Harmonic {
        amplitude: strength * amplitude_rad,
        cycles_per_rev,
        phase_rad,
    };
    sensors.add_eccentricity(side, error)
}
