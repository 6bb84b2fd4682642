//! Torsional hysteresis: a loop of torque over torsion that does not depend on its rate, joint side.

use joint_model::transmission::TorsionalHysteresis;

use super::{Full, Gear, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 2] = [
    Parameter::new("width_nm").sum_is_not_negative(),
    Parameter::new("yield_rad").each_is_positive(),
];

pub(super) fn act(
    gear: &mut dyn Gear,
    strength: f64,
    width_nm: f64,
    yield_rad: f64,
) -> Result<(), Full> {
    gear.add_hysteresis(TorsionalHysteresis {
        width_nm: strength * width_nm,
        yield_rad,
    })
}
