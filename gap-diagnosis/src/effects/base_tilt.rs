//! Tilt of the base: gravity points elsewhere than the file says. Roll and pitch enter linearly.

use robot::Effect;

use super::form::Form;
use crate::twin::scale::Scale;

const STEP_RAD: f64 = 0.005;
const PLAUSIBLE_RAD: f64 = 0.03;

#[derive(Debug)]
pub struct BaseTilt;

impl Form for BaseTilt {
    fn effect(&self, amplitude: &[f64], _: f64, _: &Scale) -> Effect {
        Effect::BaseTilt {
            roll_rad: amplitude[0] * STEP_RAD,
            pitch_rad: amplitude[1] * STEP_RAD,
        }
    }

    /// A base is set up with a level.
    fn plausible_steps(&self) -> f64 {
        PLAUSIBLE_RAD / STEP_RAD
    }

    fn amplitudes(&self) -> usize {
        2
    }
}
