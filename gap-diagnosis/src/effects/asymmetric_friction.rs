//! Asymmetric friction: half the difference between the directions, as its only amplitude.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct AsymmetricFriction;

impl Form for AsymmetricFriction {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        Effect::AsymmetricFriction {
            asymmetry_nm: amplitude[0] * friction_step_nm(scale),
        }
    }
}
