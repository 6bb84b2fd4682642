//! What is said of an effect so that it can be fitted, and the steps that several effects share.
//!
//! An amplitude of 1 is a step small enough for the response to be straight and large enough to be seen over rounding;
//! a zero amplitude is no effect at all.

use joint_twin::scale::Scale;
use robot::{Effect, EffectKind};

use super::Shown;

/// No effect is larger than some of these steps: keeps what the motion does not excite from taking any value.
const PLAUSIBLE_STEPS: f64 = 200.0;
/// Friction steps: a part of the joint's own.
const FRICTION_STEP: f64 = 0.02;
/// Steps of lost motion and kinematic error: a part of the gear's twist under its friction.
const TWIST_STEP: f64 = 0.1;

/// One step of friction at this joint.
pub fn friction_step_nm(scale: &Scale) -> f64 {
    FRICTION_STEP * scale.friction_nm
}

/// One step of an angle at this joint's gear.
pub fn twist_step_rad(scale: &Scale) -> f64 {
    TWIST_STEP * scale.twist_rad()
}

/// Whose turn an effect repeats with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Before the gear.
    Motor,
    /// After the gear.
    Link,
}

/// From an effect's amplitudes: another effect that it then is, and how many of that one's steps.
pub type WithoutEnd = fn(&[f64], &Scale) -> Option<(EffectKind, f64)>;

/// One form of one effect: amplitudes that enter linearly, and at most one shape that does not.
#[derive(Clone, Copy, Debug)]
pub struct Form {
    /// The effect at these amplitudes and this shape, as a robot file would write it. Where there is no shape it is zero.
    pub effect: fn(&[f64], f64, &Scale) -> Effect,
    /// How many amplitudes there are.
    pub amplitudes: usize,
    /// Whether the other amplitudes mean nothing without the first.
    pub needs_first: bool,
    /// Whether amplitudes below zero have no meaning.
    pub is_positive: bool,
    /// The smallest amplitude that has a meaning, where that is not zero.
    pub lowest: fn(&Scale) -> f64,
    /// Standard deviation of what it may be, in its steps, before anything is seen.
    pub plausible_steps: f64,
    /// Whether it may be there and would show.
    pub may_show: fn(Shown, &Scale) -> bool,
    /// Of two that explain the same, the one that comes first is named first: the usual cause before the seldom one.
    pub comes: u8,
    /// Amplitudes at which its response is found, each of them tried: one step, but for what answers a large one otherwise than
    /// many small ones.
    pub reaches: &'static [f64],
    /// Shapes at which it is tried; none where it has no shape.
    pub shapes: fn(&Scale) -> Vec<f64>,
    /// Between which the shape is sought. What repeats keeps its number of cycles but for what the recording cannot tell.
    pub shape_range: fn(&Scale) -> [f64; 2],
    /// Whether the effect is there or not, with its shape as its only parameter.
    pub is_switch: bool,
    /// Whose turn it repeats with, the shape being the number of cycles a turn.
    pub repeats_with: Option<Turn>,
    /// Whether what repeats does so at several numbers of cycles.
    pub has_harmonics: bool,
    /// What it is, and how much of it, where the motion does not reach the end that its shape is.
    pub without_end: WithoutEnd,
    /// Whether what repeats is the shaft's own: after a turn it is what it was, so its number of cycles is whole.
    pub is_of_shaft: bool,
}

impl Form {
    /// One amplitude of either sign and no shape, as most effects have it.
    pub const fn of(effect: fn(&[f64], f64, &Scale) -> Effect) -> Self {
        Self {
            effect,
            amplitudes: 1,
            needs_first: false,
            is_positive: false,
            lowest: |_| f64::NEG_INFINITY,
            plausible_steps: PLAUSIBLE_STEPS,
            may_show: |_, _| true,
            comes: 0,
            reaches: &[1.0],
            shapes: |_| Vec::new(),
            shape_range: |_| [0.0, f64::INFINITY],
            is_switch: false,
            repeats_with: None,
            has_harmonics: false,
            without_end: |_, _| None,
            is_of_shaft: false,
        }
    }

    /// What repeats with the motor's turn: amplitudes of a sine and a cosine, and a number of cycles.
    pub const fn wave(effect: fn(&[f64], f64, &Scale) -> Effect) -> Self {
        Self {
            amplitudes: 2,
            repeats_with: Some(Turn::Motor),
            ..Self::of(effect)
        }
    }
}

/// A sine and a cosine as one wave.
pub struct Wave {
    /// In the unit of the two.
    pub size: f64,
    /// As robot files have it.
    pub phase_rad: f64,
}

impl Wave {
    /// Of a sine's and a cosine's amplitude.
    pub fn of(amplitude: &[f64]) -> Self {
        Self {
            size: amplitude[0].hypot(amplitude[1]),
            phase_rad: amplitude[1].atan2(amplitude[0]),
        }
    }
}
