//! Encoder offset: position zero is elsewhere than the file says, by an angle that is the only amplitude.

use robot::Effect;

use super::form::Form;
use crate::twin::scale::Scale;

const STEP_RAD: f64 = 0.002;

#[derive(Debug)]
pub struct EncoderOffset;

impl Form for EncoderOffset {
    fn effect(&self, amplitude: &[f64], _: f64, _: &Scale) -> Effect {
        Effect::EncoderOffset {
            offset_rad: amplitude[0] * STEP_RAD,
        }
    }
}
