//! Torque ripple: the motor gives more and less as it turns. A sine's and a cosine's amplitude enter linearly, the number of cycles a
//! turn does not.

use robot::Effect;

use super::form::{Form, Turn, friction_step_nm};
use super::wave::Wave;
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct TorqueRipple;

impl Form for TorqueRipple {
    fn effect(&self, amplitude: &[f64], cycles: f64, scale: &Scale) -> Effect {
        let Wave { size, phase_rad } = Wave::of(amplitude);
        Effect::TorqueRipple {
            amplitude_nm: size * friction_step_nm(scale) / scale.gear_ratio,
            cycles_per_motor_rev: cycles,
            phase_rad,
        }
    }

    fn repeats_with(&self) -> Option<Turn> {
        Some(Turn::Motor)
    }
}
