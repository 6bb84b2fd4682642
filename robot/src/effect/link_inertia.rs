//! Link inertia: added about the joint's axis.

use super::{Bodies, Full};

pub(super) fn act(bodies: &mut Bodies, strength: f64, inertia_kg_m2: f64) -> Result<(), Full> {
    bodies.add_inertia(strength * inertia_kg_m2);
    Ok(())
}
