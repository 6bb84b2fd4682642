//! Structural damping: the gear resists being twisted by a power of how fast. The coefficient enters linearly, the exponent does not.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct StructuralDamping;

impl Form for StructuralDamping {
    fn effect(&self, amplitude: &[f64], exponent: f64, scale: &Scale) -> Effect {
        Effect::StructuralDamping {
            damping_nm_s_rad: amplitude[0] * friction_step_nm(scale) / (0.01 * scale.speed_rad_s),
            exponent,
        }
    }

    fn shapes(&self, _: &Scale) -> Vec<f64> {
        vec![0.5, 1.0]
    }

    fn shape_range(&self, _: &Scale) -> [f64; 2] {
        [0.2, 1.5]
    }

    fn is_positive(&self) -> bool {
        true
    }
}
