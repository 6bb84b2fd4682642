//! Error of the torque constant: the drive gives more or less than it is asked for. What the gain differs from 1 is the only amplitude.

use robot::Effect;

use super::form::Form;
use crate::twin::scale::Scale;

const STEP: f64 = 0.01;

#[derive(Debug)]
pub struct TorqueConstantError;

impl Form for TorqueConstantError {
    fn effect(&self, amplitude: &[f64], _: f64, _: &Scale) -> Effect {
        Effect::TorqueConstantError {
            gain: 1.0 + amplitude[0] * STEP,
        }
    }
}
