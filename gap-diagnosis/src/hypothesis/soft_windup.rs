//! Soft windup: the gear twists more easily below a torque. The compliance added there is the only amplitude; the knee at which it
//! ends does not enter linearly.

use robot::Effect;

use super::form::{COMPLIANCE_STEP, Form, Series, Twist};
use crate::scale::Scale;

#[derive(Debug)]
pub struct SoftWindup;

impl Form for SoftWindup {
    fn name(&self) -> &'static str {
        "soft_windup"
    }

    fn effect(&self, amplitude: &[f64], knee_nm: f64, scale: &Scale) -> Effect {
        let compliance = 1.0 + 4.0 * COMPLIANCE_STEP * amplitude[0];
        Effect::SoftWindup {
            low_stiffness_nm_rad: scale.stiffness_nm_rad / compliance,
            knee_nm,
        }
    }

    fn shapes(&self, scale: &Scale) -> Vec<f64> {
        [0.3, 1.0, 3.0]
            .map(|part| part * scale.friction_nm)
            .to_vec()
    }

    fn shape_range(&self, scale: &Scale) -> [f64; 2] {
        [0.05 * scale.friction_nm, 5.0 * scale.friction_nm]
    }

    fn is_positive(&self) -> bool {
        true
    }

    fn twist(&self) -> Option<Twist> {
        Some(Twist::Gives)
    }

    fn is_felt(&self) -> bool {
        true
    }

    fn series(&self) -> &'static [Series] {
        &[Series::Twist]
    }
}
