//! Eccentricity of an encoder: its reading leads and lags as its shaft turns. A sine's and a cosine's amplitude enter linearly, the
//! number of cycles a turn does not. Two forms, the motor's encoder and the link's.

use robot::{Effect, EncoderSide};

use super::Shown;
use super::form::{Form, TWIST_STEP, Turn};
use super::wave::Wave;
use crate::twin::scale::Scale;

/// Of an encoder whose shaft makes so many turns per joint turn.
fn eccentricity(
    amplitude: &[f64],
    cycles: f64,
    scale: &Scale,
    turns: f64,
    side: EncoderSide,
) -> Effect {
    let Wave { size, phase_rad } = Wave::of(amplitude);
    let step_rad = TWIST_STEP * scale.twist_rad();
    Effect::EncoderEccentricity {
        amplitude_rad: size * step_rad * turns,
        cycles_per_rev: cycles,
        phase_rad,
        side,
    }
}

/// Before the gear.
#[derive(Debug)]
pub struct MotorEccentricity;

impl Form for MotorEccentricity {
    fn effect(&self, amplitude: &[f64], cycles: f64, scale: &Scale) -> Effect {
        let turns = scale.gear_ratio;
        eccentricity(amplitude, cycles, scale, turns, EncoderSide::Motor)
    }

    fn repeats_with(&self) -> Option<Turn> {
        Some(Turn::Motor)
    }
}

/// After the gear.
#[derive(Debug)]
pub struct LinkEccentricity;

impl Form for LinkEccentricity {
    fn effect(&self, amplitude: &[f64], cycles: f64, scale: &Scale) -> Effect {
        eccentricity(amplitude, cycles, scale, 1.0, EncoderSide::Link)
    }

    fn may_show(&self, shown: Shown, _: &Scale) -> bool {
        shown.has_link_encoder
    }

    /// A ring off its centre or bent, and the teeth or poles of a few more.
    fn shapes(&self, _: &Scale) -> Vec<f64> {
        vec![1.0, 2.0, 4.0, 8.0]
    }

    fn repeats_with(&self) -> Option<Turn> {
        Some(Turn::Link)
    }
}
