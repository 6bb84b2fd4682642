//! Torsional compliance: the gear is softer than its file says. The compliance added is the only amplitude; a robot file writes the
//! stiffness it comes to.

use robot::Effect;

use super::form::{COMPLIANCE_STEP, Form};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct TorsionalCompliance;

impl Form for TorsionalCompliance {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        Effect::TorsionalCompliance {
            stiffness_nm_rad: softened_nm_rad(amplitude[0], scale),
        }
    }
}

/// Change of stiffness by so many steps of compliance; the stiffness itself where the file tells none.
fn softened_nm_rad(steps: f64, scale: &Scale) -> f64 {
    if scale.stiffness_is_known {
        let compliance = (1.0 + COMPLIANCE_STEP * steps).max(0.05);
        scale.stiffness_nm_rad * (1.0 / compliance - 1.0)
    } else {
        let compliance_rad_nm = 1.0 / scale.stiffness_nm_rad
            + steps.max(0.0) * 0.1 * scale.twist_rad() / scale.friction_nm;
        1.0 / compliance_rad_nm
    }
}
