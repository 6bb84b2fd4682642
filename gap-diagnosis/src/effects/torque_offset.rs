//! Torque offset: a constant torque, as its only amplitude.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct TorqueOffset;

impl Form for TorqueOffset {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        Effect::TorqueOffset {
            offset_nm: amplitude[0] * friction_step_nm(scale),
        }
    }
}
