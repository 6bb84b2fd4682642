//! Thermal friction drift: friction changes as the joint warms, joint side.
//!
//! Either by so much a second, or towards a change with a time constant. Both begin with nothing, so an effect that begins during
//! a run needs no ramp.

use joint_model::friction::ThermalFrictionDrift;

use super::{Full, Parameter, Scope, Warming};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 3] = [
    Parameter::new("drift_nm_s"),
    Parameter::new("time_constant_s").each_is_positive(),
    Parameter::new("change_nm"),
];

pub(super) fn act(
    warming: &mut dyn Warming,
    _strength: f64,
    drift_nm_s: Option<f64>,
    time_constant_s: Option<f64>,
    change_nm: Option<f64>,
) -> Result<(), Full> {
    if let Some(drift_nm_s) = drift_nm_s {
        warming.add_drift(ThermalFrictionDrift::Constant { drift_nm_s });
    }
    if let (Some(time_constant_s), Some(change_nm)) = (time_constant_s, change_nm) {
        warming.add_drift(ThermalFrictionDrift::FirstOrder {
            change_nm,
            time_constant_s,
        });
    }
    Ok(())
}
