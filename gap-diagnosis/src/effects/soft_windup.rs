//! Soft windup: the gear twists more easily below a torque. The compliance added there is the only amplitude; the knee at which it
//! ends does not enter linearly.

use robot::Effect;

use super::form::{COMPLIANCE_STEP, Form};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct SoftWindup;

impl Form for SoftWindup {
    fn effect(&self, amplitude: &[f64], knee_nm: f64, scale: &Scale) -> Effect {
        let compliance = 1.0 + 4.0 * COMPLIANCE_STEP * amplitude[0];
        Effect::SoftWindup {
            low_stiffness_nm_rad: scale.stiffness_nm_rad / compliance,
            knee_nm,
        }
    }

    /// About the torque of friction, and up to half of what the gear carries where that is more.
    fn shapes(&self, scale: &Scale) -> Vec<f64> {
        let of_friction = [0.3, 1.0, 3.0].map(|part| part * scale.friction_nm);
        let half_nm = 0.5 * scale.torque_nm();
        let is_more = half_nm > 1.5 * of_friction[2];
        of_friction
            .into_iter()
            .chain(is_more.then_some(half_nm))
            .collect()
    }

    /// Beyond the torque that the gear carries its knee is not reached.
    fn shape_range(&self, scale: &Scale) -> [f64; 2] {
        let most_nm = scale.torque_nm().max(5.0 * scale.friction_nm);
        [0.05 * scale.friction_nm, most_nm]
    }

    fn is_positive(&self) -> bool {
        true
    }
}
