//! Structural damping: torque against the rate of torsion, to the power of the exponent, joint side.

use joint_model::transmission::StructuralDamping;

use super::{Full, Gear, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 2] = [
    Parameter::new("damping_nm_s_rad").sum_is_not_negative(),
    Parameter::new("exponent").each_is_positive(),
];

pub(super) fn act(
    gear: &mut dyn Gear,
    strength: f64,
    damping_nm_s_rad: f64,
    exponent: f64,
) -> Result<(), Full> {
    gear.add_structural_damping(StructuralDamping {
        damping_nm_s_rad: strength * damping_nm_s_rad,
        exponent,
    })
}
