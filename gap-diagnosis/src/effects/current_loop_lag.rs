//! Lag of the current loop: the drive's torque follows its command after a while, whose length is the only amplitude.

use robot::Effect;

use super::Shown;
use super::form::Form;
use crate::twin::scale::Scale;

/// What an amplitude of 1 is.
pub const STEP_S: f64 = 5e-4;

#[derive(Debug)]
pub struct CurrentLoopLag;

impl Form for CurrentLoopLag {
    fn effect(&self, amplitude: &[f64], _: f64, _: &Scale) -> Effect {
        Effect::CurrentLoopLag {
            time_constant_s: amplitude[0] * STEP_S,
        }
    }

    fn may_show(&self, shown: Shown, _: &Scale) -> bool {
        shown.has_command
    }

    fn is_positive(&self) -> bool {
        true
    }
}
