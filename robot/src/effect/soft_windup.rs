//! Soft wind-up: a lower stiffness below the knee torque, joint side.

use super::{Full, Gear, Parameter, Scope, SoftStart};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 2] = [
    Parameter::new("low_stiffness_nm_rad").sum_is_positive(),
    Parameter::new("knee_nm").sum_is_not_negative(),
];

pub(super) fn act(
    gear: &mut dyn Gear,
    strength: f64,
    low_stiffness_nm_rad: f64,
    knee_nm: f64,
) -> Result<(), Full> {
    gear.add_soft_windup(SoftStart {
        low_stiffness_nm_rad,
        knee_nm,
        strength,
    })
}
