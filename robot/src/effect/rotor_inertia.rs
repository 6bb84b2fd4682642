//! Rotor inertia: added, motor side.

use super::{Full, Load, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("inertia_kg_m2").adds_up()];

pub(super) fn act(load: &mut dyn Load, strength: f64, inertia_kg_m2: f64) -> Result<(), Full> {
    load.add_rotor_inertia(strength * inertia_kg_m2);
    Ok(())
}
