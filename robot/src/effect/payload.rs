//! Payload: a point mass in the last link's frame, whatever joint it names.

use super::{Bodies, Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::WholeArm;
pub(super) const PARAMETERS: [Parameter; 2] =
    [Parameter::new("mass_kg"), Parameter::new("centre_m")];

pub(super) fn act(
    bodies: &mut Bodies,
    strength: f64,
    mass_kg: f64,
    centre_m: [f64; 3],
) -> Result<(), Full> {
    bodies.add_payload(strength * mass_kg, centre_m.into());
    Ok(())
}
