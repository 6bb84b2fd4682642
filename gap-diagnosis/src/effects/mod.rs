//! Every effect of the robot files as something that can be fitted: amplitudes that enter linearly, and a shape that does not.
//!
//! Each form of an effect is one value, in the file of the joint's part that it changes. What an effect is, where it
//! acts and what it does says [`robot::effect`]; `list.rs` does not compile until each has its forms there, or it is said that the
//! samples show it.

mod drive;
pub mod form;
mod friction;
mod gear;
mod list;
mod load;
pub mod numbers;
mod sensors;

use arrayvec::ArrayVec;
use joint_twin::scale::Scale;
use robot::{Effect, EffectKind, Scope, Stage};

use self::form::Turn;
pub use self::list::{Shown, delay, lag, limit, periodic, plain};

/// An effect to be fitted, at one shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// Which effect.
    pub kind: EffectKind,
    /// Which of its forms.
    place: usize,
    /// Parameters that do not enter linearly, each above zero.
    pub shape: ArrayVec<f64, 2>,
    /// Amplitude at which the response is found: one step, but for what answers a large one otherwise than many small ones.
    reach: f64,
}

/// Amplitudes of a hypothesis: at most those of a payload.
pub type Amplitudes = ArrayVec<f64, 4>;

impl Hypothesis {
    fn new(kind: EffectKind, place: usize, shape: &[f64]) -> Self {
        Self {
            kind,
            place,
            shape: shape.iter().copied().collect(),
            reach: 1.0,
        }
    }

    /// Its identifier.
    pub fn name(&self) -> &'static str {
        self.kind.name()
    }

    /// The same effect, with its response found at so large an amplitude.
    pub(crate) fn reaching(self, amplitude: f64) -> Self {
        Self {
            reach: amplitude,
            ..self
        }
    }

    /// The same effect at another shape.
    #[must_use]
    pub fn shaped(&self, shape: &[f64]) -> Self {
        Self::new(self.kind, self.place, shape)
    }

    /// What it is, and how much of it, where the motion does not reach the end that its shape is.
    pub(crate) fn without_end(&self, amplitudes: &[f64], scale: &Scale) -> Option<(Self, f64)> {
        let (kind, amplitude) = (self.form().without_end)(amplitudes, scale)?;
        Some((Self::new(kind, 0, &[]), amplitude))
    }

    /// The same effect, of a mass that one joint carries, begun at a distance from its axis.
    pub(crate) fn hanging_at(&self, distance_m: f64) -> Self {
        if self.kind != EffectKind::Payload || self.shape.is_empty() {
            return self.clone();
        }
        let [least, most] = load::DISTANCES_M;
        let of = self.shaped(&[distance_m.clamp(least, most)]);
        of.reaching(self.reach)
    }

    /// How many amplitudes there are.
    pub fn amplitudes(&self) -> usize {
        self.form().amplitudes
    }

    /// Whether amplitudes below zero have no meaning.
    pub fn is_positive(&self) -> bool {
        self.form().is_positive
    }

    /// The smallest amplitude that has a meaning.
    pub fn lowest(&self, scale: &Scale) -> f64 {
        if self.is_positive() {
            0.0
        } else {
            (self.form().lowest)(scale)
        }
    }

    /// Standard deviation of what its amplitudes may be before anything is seen.
    pub fn plausible_steps(&self) -> f64 {
        self.form().plausible_steps
    }

    /// Whether the effect is there or not, with its shape as its only parameter.
    pub fn is_switch(&self) -> bool {
        self.form().is_switch
    }

    /// Whether it is a cause of the whole arm, of which every joint carries its part.
    pub fn is_of_arm(&self) -> bool {
        self.kind.scope() == Scope::WholeArm
    }

    /// Whether the shape is found by fitting. A whole number of cycles is what a shaft does, and stays.
    pub fn shape_is_free(&self) -> bool {
        self.shape
            .first()
            .is_some_and(|shape| !self.is_periodic() || shape.fract() != 0.0)
    }

    /// Relative change of the shape by which its derivative is found.
    pub fn shape_step(&self, scale: &Scale) -> f64 {
        match self.shape.first() {
            // a tenth of a cycle over the whole range
            Some(cycles) if self.is_periodic() => 0.1 / (cycles * scale.motor_turns),
            _ => 0.15,
        }
    }

    /// Whether the effect repeats with an angle.
    pub fn is_periodic(&self) -> bool {
        self.form().repeats_with.is_some()
    }

    /// Whether the angle is the motor's.
    pub fn repeats_with_motor(&self) -> bool {
        self.form().repeats_with == Some(Turn::Motor)
    }

    /// Whether both are one effect that repeats with an angle, at different numbers of cycles: of those only a kinematic error has
    /// more than one.
    pub fn repeats(&self, other: &Self) -> bool {
        let is_same = self.kind == other.kind && self.place == other.place;
        self.is_periodic() && is_same && !self.form().has_harmonics
    }

    /// Numbers of cycles a turn at which it may repeat beside its own.
    pub fn harmonics(&self) -> Vec<f64> {
        match self.shape.first() {
            Some(cycles) if self.form().has_harmonics => vec![2.0 * cycles, 3.0 * cycles],
            _ => Vec::new(),
        }
    }

    /// Between which the shape is sought.
    pub fn shape_range(&self, scale: &Scale) -> [f64; 2] {
        match self.shape.first() {
            // a cycle more or less over the whole range
            Some(cycles) if self.is_periodic() => {
                let slack = 1.0 / (cycles * scale.motor_turns);
                [cycles * (1.0 - slack).max(0.5), cycles * (1.0 + slack)]
            }
            _ => (self.form().shape_range)(scale),
        }
    }

    /// The effect at these amplitudes, as a robot file would write it.
    pub fn effect(&self, amplitude: &[f64], scale: &Scale) -> Effect {
        let shape = self.shape.first().copied().unwrap_or(0.0);
        (self.form().effect)(amplitude, shape, scale)
    }

    /// The amplitudes by which column `index` is found: the response to the second less that to the first, where there
    /// are two, over [`reach`](Self::reach).
    pub fn probes(&self, index: usize) -> (Amplitudes, Option<Amplitudes>) {
        let at = |entries: &[(usize, f64)]| {
            let mut amplitudes: Amplitudes = (0..self.amplitudes()).map(|_| 0.0).collect();
            for (index, value) in entries {
                amplitudes[*index] = *value;
            }
            amplitudes
        };
        if index > 0 && self.form().needs_first {
            (at(&[(0, 1.0), (index, 1.0)]), Some(at(&[(0, 1.0)])))
        } else {
            (at(&[(index, self.reach)]), None)
        }
    }

    /// Amplitude that a column's response belongs to.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// The stage of the joint that the effect belongs to.
    pub fn stage(&self) -> Stage {
        self.kind.stage()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// One that shows everything.
    pub(crate) const ARM: Shown = Shown {
        joints: 7,
        has_link_encoder: true,
        has_command: true,
        timing_is_open: true,
        limit_is_open: true,
        feels_weight: true,
    };

    /// Of a joint that the effects' own tests look at too.
    pub(crate) fn scale() -> Scale {
        Scale {
            across_axis: [Vector3::x(), Vector3::z()],
            friction_nm: 5.0,
            least_friction_nm: 1.0,
            drag_nm: 1.0,
            load_coefficient: Some(0.05),
            speed_rad_s: 1.0,
            gear_ratio: 100.0,
            stiffness_nm_rad: 1e4,
            stiffness_is_known: true,
            motor_torque_nm: 0.5,
            inertia_kg_m2: 1.0,
            rotor_inertia_kg_m2: 0.6,
            spare_link_inertia_kg_m2: 0.1,
            period_s: 1e-3,
            motor_turns: 20.0,
        }
    }

    #[test]
    fn one_effect_at_two_numbers_of_cycles_repeats_unless_it_has_harmonics() {
        let (once, twice) = (periodic(1.0), periodic(2.0));
        for (one, other) in once.iter().zip(&twice) {
            assert_eq!(one.repeats(other), one.kind != EffectKind::KinematicError);
        }
        assert!(!once[0].repeats(&twice[2]));
        for of in &twice {
            let is_kinematic = of.kind == EffectKind::KinematicError;
            assert_eq!(of.harmonics() == [4.0, 6.0], is_kinematic, "{of:?}");
        }
        let plain = plain(&scale(), ARM);
        let mut others = plain.iter().filter(|one| !one.is_periodic());
        assert!(!others.any(|one| one.repeats(one)));
    }

    #[test]
    fn weight_is_named_only_where_gravity_lies_across_the_axis() {
        let is_offered = |feels_weight: bool| {
            let shown = Shown {
                feels_weight,
                ..ARM
            };
            let all = plain(&scale(), shown);
            all.iter().any(|of| of.kind == EffectKind::GravityTorque)
        };
        assert!(is_offered(true));
        assert!(!is_offered(false));
    }
}
