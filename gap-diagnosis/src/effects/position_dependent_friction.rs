//! Position-dependent friction: a level that repeats with the motor's turn. A sine's and a cosine's amplitude enter linearly,
//! the number of cycles a turn does not.

use robot::Effect;

use super::form::{Form, Turn, friction_step_nm};
use super::wave::Wave;
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct PositionDependentFriction;

impl Form for PositionDependentFriction {
    fn effect(&self, amplitude: &[f64], cycles: f64, scale: &Scale) -> Effect {
        let Wave { size, phase_rad } = Wave::of(amplitude);
        Effect::PositionDependentFriction {
            amplitude_nm: size * friction_step_nm(scale),
            cycles_per_motor_rev: cycles,
            phase_rad,
        }
    }

    fn repeats_with(&self) -> Option<Turn> {
        Some(Turn::Motor)
    }
}
