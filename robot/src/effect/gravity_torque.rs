//! Gravity torque: `sin_nm·sin q + cos_nm·cos q`, added to the torque that holds the joint.

use super::{Full, Load, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 2] = [
    Parameter::new("sin_nm").adds_up(),
    Parameter::new("cos_nm").adds_up(),
];

pub(super) fn act(
    load: &mut dyn Load,
    strength: f64,
    sin_nm: f64,
    cos_nm: f64,
) -> Result<(), Full> {
    load.add_gravity(strength * sin_nm, strength * cos_nm);
    Ok(())
}
