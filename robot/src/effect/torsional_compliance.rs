//! Torsional compliance: stiffness of the gear, joint side. A file that has one changes it by further entries.

use super::{Full, Gear, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("stiffness_nm_rad")
    .sum_is_positive()
    .adds_up()];

pub(super) fn act(gear: &mut dyn Gear, strength: f64, stiffness_nm_rad: f64) -> Result<(), Full> {
    gear.add_stiffness(stiffness_nm_rad, strength);
    Ok(())
}
