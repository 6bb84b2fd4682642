//! Encoder eccentricity: an encoder leads and lags as its shaft turns, in angle of its side.

use joint_model::harmonic::Harmonic;

use super::{EncoderSide, Full, Sensors};

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
