//! Kinematic error: the gear leads and lags as the motor turns. A sine's and a cosine's amplitude enter linearly, the number of
//! cycles a turn does not; each harmonic is fitted on its own.

use robot::Effect;

use super::form::{Form, TWIST_STEP, Turn};
use super::wave::Wave;
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct KinematicError;

impl Form for KinematicError {
    fn effect(&self, amplitude: &[f64], cycles: f64, scale: &Scale) -> Effect {
        let Wave { size, phase_rad } = Wave::of(amplitude);
        let step_rad = TWIST_STEP * scale.twist_rad();
        Effect::KinematicError {
            amplitude_rad: size * step_rad,
            cycles_per_motor_rev: cycles,
            phase_rad,
            amplitude_rad_2: 0.0,
            cycles_per_motor_rev_2: 0.0,
            phase_rad_2: 0.0,
            amplitude_rad_3: 0.0,
            cycles_per_motor_rev_3: 0.0,
            phase_rad_3: 0.0,
        }
    }

    fn repeats_with(&self) -> Option<Turn> {
        Some(Turn::Motor)
    }

    fn has_harmonics(&self) -> bool {
        true
    }
}
