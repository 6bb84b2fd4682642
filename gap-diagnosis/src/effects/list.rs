//! The list of all effects, and which of them may be fitted to a joint.

use super::form::Form;
use super::{Hypothesis, command_delay, current_loop_lag};
use crate::twin::scale::Scale;

/// What may be fitted from the start. Of two that explain the same, the one that comes first is named first.
const PLAIN: &[&dyn Form] = &[
    &super::coulomb_friction::CoulombFriction,
    &super::viscous_friction::ViscousFriction,
    &super::quadratic_friction::QuadraticFriction,
    &super::stribeck_friction::StribeckFriction,
    &super::asymmetric_friction::AsymmetricFriction,
    &super::load_dependent_friction::LoadDependentFriction,
    &super::torsional_compliance::TorsionalCompliance,
    &super::soft_windup::SoftWindup,
    &super::torsional_hysteresis::TorsionalHysteresis,
    &super::structural_damping::StructuralDamping,
    &super::thermal_friction_drift::ConstantDrift,
    &super::thermal_friction_drift::FirstOrderDrift,
    &super::torque_constant_error::TorqueConstantError,
    &super::torque_offset::TorqueOffset,
    &super::torque_saturation::TorqueSaturation,
    &super::current_loop_lag::CurrentLoopLag,
    &super::command_delay::CommandDelay,
    &super::sensor_delay::SensorDelay,
    &super::payload::Payload,
    &super::link_inertia::LinkInertia,
    &super::rotor_inertia::RotorInertia,
    &super::gravity_torque::GravityTorque,
    &super::joint_spring::JointSpring,
    &super::base_tilt::BaseTilt,
    &super::encoder_offset::EncoderOffset,
    &super::encoder_eccentricity::LinkEccentricity,
    &super::payload::PayloadAt,
    &super::backlash::Backlash,
];

/// What repeats with the motor's turn.
const PERIODIC: [&dyn Form; 4] = [
    &super::position_dependent_friction::PositionDependentFriction,
    &super::kinematic_error::KinematicError,
    &super::torque_ripple::TorqueRipple,
    &super::encoder_eccentricity::MotorEccentricity,
];

/// What of a robot is there and recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// Joints of the robot.
    pub joints: usize,
    /// The link's encoder.
    pub has_link_encoder: bool,
    /// What the controller asks of the drive.
    pub has_command: bool,
    /// Delay and lag of the drive are not read off the samples.
    pub timing_is_open: bool,
}

/// What may be fitted to a joint, periodic effects aside: those come from [`periodic`] once their cycles are known.
pub fn plain(scale: &Scale, shown: Shown) -> Vec<Hypothesis> {
    PLAIN
        .iter()
        .filter(|form| form.may_show(shown, scale))
        .flat_map(|form| tried(*form, scale))
        .collect()
}

/// A form at each shape and each reach at which it is tried.
fn tried(form: &'static dyn Form, scale: &Scale) -> Vec<Hypothesis> {
    let shapes = form.shapes(scale);
    let shapes = shapes.iter().map(|shape| Hypothesis::new(form, &[*shape]));
    let mut shaped: Vec<Hypothesis> = shapes.collect();
    if shaped.is_empty() {
        shaped.push(Hypothesis::new(form, &[]));
    }
    let reaching = |of: Hypothesis| {
        let reaches = form.reaches().iter();
        reaches.map(move |reach| of.clone().reaching(*reach))
    };
    shaped.into_iter().flat_map(reaching).collect()
}

/// A lag of the current loop, and a delay of the command, as they were read off the samples.
pub fn lag(time_constant_s: f64) -> (Hypothesis, f64) {
    let hypothesis = Hypothesis::new(&current_loop_lag::CurrentLoopLag, &[]);
    (hypothesis, time_constant_s / current_loop_lag::STEP_S)
}

/// See [`lag`].
pub fn delay(delay_s: f64, scale: &Scale) -> (Hypothesis, f64) {
    let hypothesis = Hypothesis::new(&command_delay::CommandDelay, &[]);
    (hypothesis, delay_s / scale.period_s)
}

/// The effects that repeat with the motor's turn, at so many cycles a turn.
pub fn periodic(cycles_per_motor_rev: f64) -> [Hypothesis; 4] {
    PERIODIC.map(|form| Hypothesis::new(form, &[cycles_per_motor_rev]))
}

#[cfg(test)]
mod tests {
    use robot::Effect;

    use super::*;
    use crate::effects::tests::{ARM, scale};

    #[test]
    fn every_effect_that_a_simulation_shows_has_a_hypothesis() {
        // the others are seen in the samples themselves
        let beside = [
            "encoder_quantisation",
            "velocity_filter_lag",
            "dropped_commands",
            "dropped_samples",
        ];
        let mut names: Vec<&str> = plain(&scale(), ARM)
            .iter()
            .chain(&periodic(2.0))
            .map(|hypothesis| hypothesis.effect)
            .chain(beside)
            .collect();
        names.sort_unstable();
        names.dedup();
        let mut all = Effect::names().to_vec();
        all.sort_unstable();
        assert_eq!(names, all);
    }

    #[test]
    fn effects_carry_the_name_of_their_hypothesis() {
        let alone = Shown { joints: 1, ..ARM };
        for hypothesis in [ARM, alone]
            .iter()
            .flat_map(|shown| plain(&scale(), *shown))
            .chain(periodic(2.0))
        {
            let ones = vec![1.0; hypothesis.amplitudes()];
            assert_eq!(hypothesis.effect(&ones, &scale()).name(), hypothesis.effect);
        }
    }

    #[test]
    fn the_forms_are_told_apart_by_their_type() {
        let all: Vec<&dyn Form> = PLAIN.iter().copied().chain(PERIODIC).collect();
        for (row, one) in all.iter().enumerate() {
            for (column, other) in all.iter().enumerate() {
                assert_eq!(one == other, row == column, "{one:?} and {other:?}");
            }
        }
    }
}
