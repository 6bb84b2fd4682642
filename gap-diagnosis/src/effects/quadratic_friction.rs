//! Quadratic friction: drag in proportion to the square of velocity, its coefficient the only amplitude.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct QuadraticFriction;

impl Form for QuadraticFriction {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        Effect::QuadraticFriction {
            quadratic_nm_s2_rad2: amplitude[0] * friction_step_nm(scale)
                / scale.speed_rad_s.powi(2),
        }
    }
}
