//! Gravity torque: what weight adds to the torque that holds the joint, by the sine and by the cosine of its position. Both enter
//! linearly.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct GravityTorque;

impl Form for GravityTorque {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        let step_nm = friction_step_nm(scale);
        Effect::GravityTorque {
            sin_nm: amplitude[0] * step_nm,
            cos_nm: amplitude[1] * step_nm,
        }
    }

    fn amplitudes(&self) -> usize {
        2
    }
}
