//! What an effect says of itself so that it can be fitted, and the steps that several effects share.
//!
//! An amplitude of 1 is a step small enough for the response to be straight and large enough to be seen over rounding;
//! a zero amplitude is no effect at all.

use std::any::Any;
use std::fmt::Debug;

use robot::Effect;

use super::Shown;
use crate::twin::scale::Scale;

/// No effect is larger than some of these steps: keeps what the motion does not excite from taking any value.
const PLAUSIBLE_STEPS: f64 = 200.0;
/// Friction steps: a part of the joint's own.
const FRICTION_STEP: f64 = 0.02;
/// Softening steps: a part of the compliance.
pub const COMPLIANCE_STEP: f64 = 0.05;
/// Twist of a gear under its friction, for steps of lost motion and kinematic error.
pub const TWIST_STEP: f64 = 0.1;
/// Steps of inertia: a part of the joint's own.
pub const INERTIA_STEP: f64 = 0.02;

/// One step of friction at this joint.
pub fn friction_step_nm(scale: &Scale) -> f64 {
    FRICTION_STEP * scale.friction_nm
}

/// Whose turn an effect repeats with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Before the gear.
    Motor,
    /// After the gear.
    Link,
}

/// One form of one effect: amplitudes that enter linearly, and at most one shape that does not.
///
/// What is left to its default is so for most effects.
pub trait Form: Any + Debug + Sync {
    /// The effect at these amplitudes and this shape, as a robot file would write it. Where there is no shape it is zero.
    fn effect(&self, amplitude: &[f64], shape: f64, scale: &Scale) -> Effect;

    /// Whether it may be there and would show.
    fn may_show(&self, _shown: Shown, _scale: &Scale) -> bool {
        true
    }

    /// Of two that explain the same, the one that comes first is named first: the usual cause before the seldom one.
    fn comes(&self) -> u8 {
        0
    }

    /// Shapes at which it is tried; none where it has no shape.
    fn shapes(&self, _scale: &Scale) -> Vec<f64> {
        Vec::new()
    }

    /// Amplitudes at which its response is found, each of them tried: one step, but for what answers a large one otherwise than
    /// many small ones.
    fn reaches(&self) -> &'static [f64] {
        &[1.0]
    }

    /// Between which the shape is sought. What repeats keeps its number of cycles but for what the recording cannot tell.
    fn shape_range(&self, _scale: &Scale) -> [f64; 2] {
        [0.0, f64::INFINITY]
    }

    /// How many amplitudes there are: a sine's and a cosine's of what repeats.
    fn amplitudes(&self) -> usize {
        if self.repeats_with().is_some() { 2 } else { 1 }
    }

    /// Whether the other amplitudes mean nothing without the first.
    fn needs_first(&self) -> bool {
        false
    }

    /// Whether amplitudes below zero have no meaning.
    fn is_positive(&self) -> bool {
        false
    }

    /// The smallest amplitude that has a meaning.
    fn lowest(&self, _scale: &Scale) -> f64 {
        if self.is_positive() {
            0.0
        } else {
            f64::NEG_INFINITY
        }
    }

    /// Standard deviation of what it may be, in its steps, before anything is seen.
    fn plausible_steps(&self) -> f64 {
        PLAUSIBLE_STEPS
    }

    /// Whether the effect is there or not, with its shape as its only parameter.
    fn is_switch(&self) -> bool {
        false
    }

    /// Whose turn it repeats with, the shape being the number of cycles a turn.
    fn repeats_with(&self) -> Option<Turn> {
        None
    }

    /// Whether what repeats does so at several numbers of cycles.
    fn has_harmonics(&self) -> bool {
        false
    }
}

impl PartialEq for dyn Form {
    fn eq(&self, other: &Self) -> bool {
        self.type_id() == other.type_id()
    }
}
