//! Encoders: where they are zero, and how they lead and lag as their shaft turns.

use joint_twin::scale::Scale;
use robot::{Effect, EncoderSide};

use super::form::{Form, Turn, Wave, twist_step_rad};

/// Steps of an encoder's zero.
const OFFSET_STEP_RAD: f64 = 0.002;

/// Position zero is elsewhere than the file says.
pub const ENCODER_OFFSET: Form = Form::of(|amplitude, _, _| Effect::EncoderOffset {
    offset_rad: amplitude[0] * OFFSET_STEP_RAD,
});

/// Before the gear: what the ring on the motor's shaft shows is what it showed a turn before.
pub const MOTOR_ECCENTRICITY: Form = Form {
    is_of_shaft: true,
    ..Form::wave(|amplitude, cycles, scale| {
        let turns = scale.gear_ratio;
        eccentricity(amplitude, cycles, scale, turns, EncoderSide::Motor)
    })
};

/// After the gear: a ring off its centre or bent, and the teeth or poles of a few more.
pub const LINK_ECCENTRICITY: Form = Form {
    may_show: |shown, _| shown.has_link_encoder,
    shapes: |_| vec![1.0, 2.0, 4.0, 8.0],
    repeats_with: Some(Turn::Link),
    ..Form::wave(|amplitude, cycles, scale| {
        eccentricity(amplitude, cycles, scale, 1.0, EncoderSide::Link)
    })
};

/// Of an encoder whose shaft makes so many turns per joint turn.
fn eccentricity(
    amplitude: &[f64],
    cycles: f64,
    scale: &Scale,
    turns: f64,
    side: EncoderSide,
) -> Effect {
    let Wave { size, phase_rad } = Wave::of(amplitude);
    Effect::EncoderEccentricity {
        amplitude_rad: size * twist_step_rad(scale) * turns,
        cycles_per_rev: cycles,
        phase_rad,
        side,
    }
}
