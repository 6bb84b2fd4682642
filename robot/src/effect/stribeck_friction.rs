//! Stribeck friction: breaking away is harder than sliding, by `stribeck_nm·exp(-|v|/stribeck_velocity)`, joint side.

use joint_model::friction::{SteadyFriction, StribeckFriction};

use super::{Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 2] = [
    Parameter::new("stribeck_nm"),
    Parameter::new("stribeck_velocity_rad_s").each_is_positive(),
];

pub(super) fn act(
    friction: &mut SteadyFriction,
    strength: f64,
    stribeck_nm: f64,
    stribeck_velocity_rad_s: f64,
) -> Result<(), Full> {
    let term = StribeckFriction {
        stribeck_nm: strength * stribeck_nm,
        stribeck_velocity_rad_s,
    };
    Full::push(&mut friction.stribeck, term)
}
