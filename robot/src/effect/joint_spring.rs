//! Joint spring: pulls the joint to where it rests.

use joint_model::joint_spring::JointSpring;

use super::{Full, Load, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 2] = [
    Parameter::new("stiffness_nm_rad"),
    Parameter::new("rest_rad"),
];

pub(super) fn act(
    load: &mut dyn Load,
    strength: f64,
    stiffness_nm_rad: f64,
    rest_rad: f64,
) -> Result<(), Full> {
    load.add_spring(JointSpring {
        stiffness_nm_rad: strength * stiffness_nm_rad,
        rest_rad,
    })
}
