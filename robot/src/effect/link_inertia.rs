//! Link inertia: added about the joint's axis.

use super::{Bodies, Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("inertia_kg_m2").adds_up()];

pub(super) fn act(bodies: &mut Bodies, strength: f64, inertia_kg_m2: f64) -> Result<(), Full> {
    bodies.add_inertia(strength * inertia_kg_m2);
    Ok(())
}
