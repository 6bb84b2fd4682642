//! Payload: a point mass in the last link's frame, whatever joint it names.

use super::{Bodies, Full};

pub(super) fn act(
    bodies: &mut Bodies,
    strength: f64,
    mass_kg: f64,
    centre_m: [f64; 3],
) -> Result<(), Full> {
    bodies.add_payload(strength * mass_kg, centre_m.into());
    Ok(())
}
