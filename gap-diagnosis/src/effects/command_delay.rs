//! Delay of commands on their way to the drive, as its only amplitude, in periods of the samples.

use robot::Effect;

use super::Shown;
use super::form::Form;
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct CommandDelay;

impl Form for CommandDelay {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        Effect::CommandDelay {
            delay_s: amplitude[0] * scale.period_s,
        }
    }

    fn may_show(&self, shown: Shown, _: &Scale) -> bool {
        shown.timing_is_open && shown.has_command
    }

    fn is_positive(&self) -> bool {
        true
    }
}
