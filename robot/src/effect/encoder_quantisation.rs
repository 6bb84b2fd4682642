//! Encoder quantisation: an encoder's step, in angle of its side. The last of several counts, at once.

use super::{EncoderSide, Full, Parameter, Scope, Sensors};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 2] = [
    Parameter::new("resolution_rad").each_is_positive(),
    Parameter::new("side"),
];

pub(super) fn act(
    sensors: &mut dyn Sensors,
    _strength: f64,
    resolution_rad: f64,
    side: EncoderSide,
) -> Result<(), Full> {
    sensors.set_resolution(side, resolution_rad);
    Ok(())
}
