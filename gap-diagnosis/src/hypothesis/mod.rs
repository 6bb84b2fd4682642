//! Every effect of the table as something that can be fitted: amplitudes that enter linearly, and a shape that does not.
//!
//! One effect, one file; it says of itself what the trait `Form` asks. A new effect is a new file, and its line in the list of `list.rs`.

mod asymmetric_friction;
mod backlash;
mod base_tilt;
mod command_delay;
mod coulomb_friction;
mod current_loop_lag;
mod encoder_eccentricity;
mod encoder_offset;
mod form;
mod gravity_torque;
mod joint_spring;
mod kinematic_error;
mod link_inertia;
mod list;
mod load_dependent_friction;
mod payload;
mod position_dependent_friction;
mod quadratic_friction;
mod rotor_inertia;
mod sensor_delay;
mod soft_windup;
mod stribeck_friction;
mod structural_damping;
mod thermal_friction_drift;
mod torque_constant_error;
mod torque_offset;
mod torque_ripple;
mod torque_saturation;
mod torsional_compliance;
mod torsional_hysteresis;
mod viscous_friction;
mod wave;

use arrayvec::ArrayVec;
use robot::Effect;

use self::form::{Form, Turn, Twist};
pub use self::list::{Shown, delay, lag, periodic, plain};
pub(crate) use self::list::{giving, shared};
use crate::scale::Scale;
use crate::stage::Stage;

/// So near to the lower end of its range a shape is taken to be there.
const AT_ITS_END: f64 = 0.05;

/// An effect to be fitted, at one shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// Identifier of the effect.
    pub effect: &'static str,
    form: &'static dyn Form,
    /// Parameters that do not enter linearly, each above zero.
    pub shape: ArrayVec<f64, 2>,
    /// Amplitude at which the response is found: one step, but for what answers a large one otherwise than many small ones.
    reach: f64,
}

/// Amplitudes of a hypothesis: at most those of a payload.
pub type Amplitudes = ArrayVec<f64, 4>;

impl Hypothesis {
    fn new(form: &'static dyn Form, shape: &[f64]) -> Self {
        Self {
            effect: form.name(),
            form,
            shape: shape.iter().copied().collect(),
            reach: 1.0,
        }
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
        Self::new(self.form, shape)
    }

    /// How many amplitudes there are.
    pub fn amplitudes(&self) -> usize {
        self.form.amplitudes()
    }

    /// Whether amplitudes below zero have no meaning.
    pub fn is_positive(&self) -> bool {
        self.form.is_positive()
    }

    /// The smallest amplitude that has a meaning.
    pub fn lowest(&self, scale: &Scale) -> f64 {
        self.form.lowest(scale)
    }

    /// Standard deviation of what its amplitudes may be before anything is seen.
    pub fn plausible_steps(&self) -> f64 {
        self.form.plausible_steps()
    }

    /// Whether the effect is there or not, with its shape as its only parameter.
    pub fn is_switch(&self) -> bool {
        self.form.is_switch()
    }

    /// Whether it is a cause of the whole arm, of which every joint carries its part.
    pub fn is_of_arm(&self) -> bool {
        self.form.is_shared() && self.form.is_carried()
    }

    /// Whether the other joints feel it.
    pub fn is_felt(&self) -> bool {
        self.form.is_felt()
    }

    /// Whether it is a way in which the gear gives as it twists.
    pub fn gives(&self) -> bool {
        self.form.twist() == Some(Twist::Gives)
    }

    /// Whether it is of the gear's twist.
    pub fn is_twist(&self) -> bool {
        self.form.twist().is_some()
    }

    /// Whether it shows at reversals only. `sees_torsion`: whether a second encoder or a torque sensor shows how the gear twists.
    pub fn shows_at_reversals(&self, sees_torsion: bool) -> bool {
        self.form.shows_at_reversals() || self.gives() && !sees_torsion
    }

    /// Whether it is twist that nothing but reversals shows.
    pub fn is_hidden_twist(&self, sees_torsion: bool) -> bool {
        self.is_twist() && self.shows_at_reversals(sees_torsion)
    }

    /// Nats by which a good twin may seem to have it.
    pub fn in_any_twin_nats(&self) -> f64 {
        self.form.in_any_twin_nats()
    }

    /// Whether one moment may be all that there is of it.
    pub fn may_be_once(&self) -> bool {
        self.form.may_be_once()
    }

    /// Whether the shape is found by fitting. A whole number of cycles is what a shaft does, and stays.
    pub fn shape_is_free(&self) -> bool {
        self.shape
            .first()
            .is_some_and(|shape| !self.is_periodic() || shape.fract() != 0.0)
    }

    /// Whether the effect shows in the same motion whatever its shape. Other shapes choose where an effect shows.
    pub fn shows_at_any_shape(&self) -> bool {
        self.form.shows_at_any_shape()
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
        self.form.repeats_with().is_some()
    }

    /// Whether the angle is the motor's.
    pub fn repeats_with_motor(&self) -> bool {
        self.form.repeats_with() == Some(Turn::Motor)
    }

    /// Whether both are terms of a series in one variable. Two that nearly cancel may stand for a law of that variable that is
    /// no term of the series; not where a torque sensor shows one of them and not the other.
    pub fn is_in_series_with(&self, other: &Self, has_torque_sensor: bool) -> bool {
        let mut series = self.form.series().iter();
        let is_told_apart = has_torque_sensor && self.form.is_carried() != other.form.is_carried();
        self.is_periodic() && other.is_periodic()
            || !is_told_apart && series.any(|one| other.form.series().contains(one))
    }

    /// Whether both are one effect that repeats with an angle, at different numbers of cycles: of those only a kinematic error has
    /// more than one.
    pub fn repeats(&self, other: &Self) -> bool {
        self.is_periodic() && self.form == other.form && !self.form.has_harmonics()
    }

    /// Numbers of cycles a turn at which it may repeat beside its own.
    pub fn harmonics(&self) -> Vec<f64> {
        match self.shape.first() {
            Some(cycles) if self.form.has_harmonics() => vec![2.0 * cycles, 3.0 * cycles],
            _ => Vec::new(),
        }
    }

    /// Whether its torque follows load, direction or time, and changes with nothing quicker.
    pub fn is_slow(&self) -> bool {
        self.form.is_slow()
    }

    /// Between which the shape is sought.
    pub fn shape_range(&self, scale: &Scale) -> [f64; 2] {
        match self.shape.first() {
            // a cycle more or less over the whole range
            Some(cycles) if self.is_periodic() => {
                let slack = 1.0 / (cycles * scale.motor_turns);
                [cycles * (1.0 - slack).max(0.5), cycles * (1.0 + slack)]
            }
            _ => self.form.shape_range(scale),
        }
    }

    /// Whether its shape is where it ends and something else begins that is no law of the list.
    pub fn is_at_its_end(&self, scale: &Scale) -> bool {
        let least = self.shape_range(scale)[0];
        let is_least = |shape: &f64| *shape < least * (1.0 + AT_ITS_END);
        self.form.ends_below() && self.shape.first().is_some_and(is_least)
    }

    /// The effect at these amplitudes, as a robot file would write it.
    pub fn effect(&self, amplitude: &[f64], scale: &Scale) -> Effect {
        let shape = self.shape.first().copied().unwrap_or(0.0);
        self.form.effect(amplitude, shape, scale)
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
        if index > 0 && self.form.needs_first() {
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
        Stage::of(self.effect)
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
    };

    /// Of a joint that the effects' own tests look at too.
    pub(crate) fn scale() -> Scale {
        Scale {
            across_axis: [Vector3::x(), Vector3::z()],
            friction_nm: 5.0,
            least_friction_nm: 1.0,
            load_coefficient: Some(0.05),
            speed_rad_s: 1.0,
            gear_ratio: 100.0,
            stiffness_nm_rad: 1e4,
            stiffness_is_known: true,
            motor_torque_nm: 0.5,
            reached_motor_nm: None,
            may_saturate: true,
            inertia_kg_m2: 1.0,
            rotor_inertia_kg_m2: 0.6,
            spare_link_inertia_kg_m2: 0.1,
            period_s: 1e-3,
            motor_turns: 20.0,
        }
    }

    #[test]
    fn terms_of_one_variable_are_a_series_and_a_drift_beside_a_gain_is_none() {
        let of = |name: &str| {
            let mut all = plain(&scale(), ARM).into_iter();
            all.find(|hypothesis| hypothesis.effect == name)
                .expect("it is on the list")
        };
        let is_series = |one, other| of(one).is_in_series_with(&of(other), false);
        assert!(is_series("viscous_friction", "quadratic_friction"));
        assert!(is_series("sensor_delay", "link_inertia"));
        assert!(!is_series(
            "thermal_friction_drift",
            "torque_constant_error"
        ));
        assert!(!is_series("coulomb_friction", "joint_spring"));
        // the gear carries a spring's torque, and not an offset of the motor's
        assert!(is_series("torque_offset", "joint_spring"));
        let with_sensor = |one, other| of(one).is_in_series_with(&of(other), true);
        assert!(!with_sensor("torque_offset", "joint_spring"));
        assert!(with_sensor("gravity_torque", "joint_spring"));
    }

    #[test]
    fn a_stribeck_velocity_at_its_end_is_no_law_and_other_shapes_are_one_wherever_they_end() {
        let is_at_its_end = |name: &str, times: f64| {
            let mut all = plain(&scale(), ARM).into_iter();
            let found = all.find(|of| of.effect == name && !of.shape.is_empty());
            let of = found.expect("it is on the list");
            let least = of.shape_range(&scale())[0];
            of.shaped(&[times * least]).is_at_its_end(&scale())
        };
        for name in ["stribeck_friction", "thermal_friction_drift"] {
            assert!(is_at_its_end(name, 1.0) && is_at_its_end(name, 1.04));
            assert!(!is_at_its_end(name, 1.1));
        }
        assert!(!is_at_its_end("torsional_hysteresis", 1.0));
    }

    #[test]
    fn one_effect_at_two_numbers_of_cycles_repeats_unless_it_has_harmonics() {
        let (once, twice) = (periodic(1.0), periodic(2.0));
        for (one, other) in once.iter().zip(&twice) {
            assert_eq!(one.repeats(other), one.effect != "kinematic_error");
        }
        assert!(!once[0].repeats(&twice[2]));
        for of in &twice {
            let is_kinematic = of.effect == "kinematic_error";
            assert_eq!(of.harmonics() == [4.0, 6.0], is_kinematic, "{of:?}");
        }
        let plain = plain(&scale(), ARM);
        let mut others = plain.iter().filter(|one| !one.is_periodic());
        assert!(!others.any(|one| one.repeats(one)));
    }
}
