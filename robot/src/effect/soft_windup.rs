//! Soft wind-up: a lower stiffness below the knee torque, joint side.

use super::{Full, Gear, SoftStart};

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
