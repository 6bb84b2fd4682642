//! Structural damping: torque against the rate of torsion, to the power of the exponent, joint side.

use joint_model::transmission::StructuralDamping;

use super::{Full, Gear};

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
