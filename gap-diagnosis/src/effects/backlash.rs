//! Backlash: a gap that the gear crosses without torque, as its only amplitude.

use robot::Effect;

use super::form::{Form, TWIST_STEP};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct Backlash;

impl Form for Backlash {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        Effect::Backlash {
            gap_rad: amplitude[0] * TWIST_STEP * scale.twist_rad(),
        }
    }

    fn comes(&self) -> u8 {
        2
    }

    /// Within a wide gap the link swings freely.
    fn reaches(&self) -> &'static [f64] {
        &[1.0, 10.0, 100.0]
    }

    fn is_positive(&self) -> bool {
        true
    }
}
