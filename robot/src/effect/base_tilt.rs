//! Base tilt: the base rolls about its x axis, then pitches about the y axis of the world.

use super::{Bodies, Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::WholeArm;
pub(super) const PARAMETERS: [Parameter; 2] =
    [Parameter::new("roll_rad"), Parameter::new("pitch_rad")];

pub(super) fn act(
    bodies: &mut Bodies,
    strength: f64,
    roll_rad: f64,
    pitch_rad: f64,
) -> Result<(), Full> {
    bodies.tilt(strength * roll_rad, strength * pitch_rad);
    Ok(())
}
