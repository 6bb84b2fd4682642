//! The list of all effects, and which of them may be fitted to a joint.

use robot::{EffectKind, Part};

use super::form::{Form, Turn};
use super::*;
use crate::twin::scale::Scale;

/// How each effect is fitted.
fn forms(kind: EffectKind) -> &'static [&'static dyn Form] {
    match kind {
        EffectKind::CoulombFriction => &[&coulomb_friction::CoulombFriction],
        EffectKind::ViscousFriction => &[&viscous_friction::ViscousFriction],
        EffectKind::QuadraticFriction => &[&quadratic_friction::QuadraticFriction],
        EffectKind::StribeckFriction => &[&stribeck_friction::StribeckFriction],
        EffectKind::AsymmetricFriction => &[&asymmetric_friction::AsymmetricFriction],
        EffectKind::LoadDependentFriction => &[&load_dependent_friction::LoadDependentFriction],
        EffectKind::PositionDependentFriction => {
            &[&position_dependent_friction::PositionDependentFriction]
        }
        EffectKind::KinematicError => &[&kinematic_error::KinematicError],
        EffectKind::TorsionalCompliance => &[&torsional_compliance::TorsionalCompliance],
        EffectKind::SoftWindup => &[&soft_windup::SoftWindup],
        EffectKind::TorsionalHysteresis => &[&torsional_hysteresis::TorsionalHysteresis],
        EffectKind::StructuralDamping => &[&structural_damping::StructuralDamping],
        EffectKind::Backlash => &[&backlash::Backlash],
        EffectKind::ThermalFrictionDrift => &[
            &thermal_friction_drift::ConstantDrift,
            &thermal_friction_drift::FirstOrderDrift,
        ],
        EffectKind::TorqueConstantError => &[&torque_constant_error::TorqueConstantError],
        EffectKind::TorqueOffset => &[&torque_offset::TorqueOffset],
        EffectKind::TorqueRipple => &[&torque_ripple::TorqueRipple],
        EffectKind::TorqueSaturation => &[&torque_saturation::TorqueSaturation],
        EffectKind::CurrentLoopLag => &[&current_loop_lag::CurrentLoopLag],
        EffectKind::Payload => &[&payload::Payload, &payload::PayloadAt],
        EffectKind::LinkInertia => &[&link_inertia::LinkInertia],
        EffectKind::RotorInertia => &[&rotor_inertia::RotorInertia],
        EffectKind::GravityTorque => &[&gravity_torque::GravityTorque],
        EffectKind::JointSpring => &[&joint_spring::JointSpring],
        EffectKind::BaseTilt => &[&base_tilt::BaseTilt],
        EffectKind::EncoderOffset => &[&encoder_offset::EncoderOffset],
        EffectKind::EncoderEccentricity => &[
            &encoder_eccentricity::MotorEccentricity,
            &encoder_eccentricity::LinkEccentricity,
        ],
        EffectKind::CommandDelay => &[&command_delay::CommandDelay],
        EffectKind::SensorDelay => &[&sensor_delay::SensorDelay],
        // never: the samples show these by themselves, see `checks`
        EffectKind::EncoderQuantisation
        | EffectKind::VelocityFilterLag
        | EffectKind::DroppedCommands
        | EffectKind::DroppedSamples => &[],
    }
}

/// Of two that explain the same, the one that comes first is named first: what is nearer to the motor's friction.
fn place(part: Part) -> usize {
    match part {
        Part::Friction => 0,
        Part::Gear => 1,
        Part::Warming => 2,
        Part::Actuator => 3,
        Part::Bus => 4,
        Part::Load | Part::Bodies => 5,
        Part::Sensors => 6,
    }
}

fn all() -> impl Iterator<Item = (EffectKind, &'static dyn Form)> {
    let kinds = EffectKind::ALL.iter().copied();
    kinds.flat_map(|kind| forms(kind).iter().map(move |form| (kind, *form)))
}

fn repeats_with_motor(form: &dyn Form) -> bool {
    form.repeats_with() == Some(Turn::Motor)
}

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
    let may_show = |(_, form): &(EffectKind, &dyn Form)| {
        !repeats_with_motor(*form) && form.may_show(shown, scale)
    };
    let mut fitted: Vec<_> = all().filter(may_show).collect();
    fitted.sort_by_key(|(kind, form)| (form.comes(), place(kind.part())));
    let each = fitted.into_iter();
    each.flat_map(|(kind, form)| tried(kind, form, scale))
        .collect()
}

/// A form at each shape and each reach at which it is tried.
fn tried(kind: EffectKind, form: &'static dyn Form, scale: &Scale) -> Vec<Hypothesis> {
    let shapes = form.shapes(scale);
    let shapes = shapes
        .iter()
        .map(|shape| Hypothesis::new(kind, form, &[*shape]));
    let mut shaped: Vec<Hypothesis> = shapes.collect();
    if shaped.is_empty() {
        shaped.push(Hypothesis::new(kind, form, &[]));
    }
    let reaching = |of: Hypothesis| {
        let reaches = form.reaches().iter();
        reaches.map(move |reach| of.clone().reaching(*reach))
    };
    shaped.into_iter().flat_map(reaching).collect()
}

/// A lag of the current loop, and a delay of the command, as they were read off the samples.
pub fn lag(time_constant_s: f64) -> (Hypothesis, f64) {
    let form = &current_loop_lag::CurrentLoopLag;
    let hypothesis = Hypothesis::new(EffectKind::CurrentLoopLag, form, &[]);
    (hypothesis, time_constant_s / current_loop_lag::STEP_S)
}

/// See [`lag`].
pub fn delay(delay_s: f64, scale: &Scale) -> (Hypothesis, f64) {
    let form = &command_delay::CommandDelay;
    let hypothesis = Hypothesis::new(EffectKind::CommandDelay, form, &[]);
    (hypothesis, delay_s / scale.period_s)
}

/// The effects that repeat with the motor's turn, at so many cycles a turn.
pub fn periodic(cycles_per_motor_rev: f64) -> Vec<Hypothesis> {
    let of_motor = all().filter(|(_, form)| repeats_with_motor(*form));
    let at = |(kind, form)| Hypothesis::new(kind, form, &[cycles_per_motor_rev]);
    of_motor.map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::{ARM, scale};

    #[test]
    fn the_forms_of_an_effect_write_that_effect() {
        let alone = Shown { joints: 1, ..ARM };
        for hypothesis in [ARM, alone]
            .iter()
            .flat_map(|shown| plain(&scale(), *shown))
            .chain(periodic(2.0))
        {
            let ones = vec![1.0; hypothesis.amplitudes()];
            assert_eq!(hypothesis.effect(&ones, &scale()).kind(), hypothesis.kind);
        }
    }

    #[test]
    fn the_forms_are_told_apart_by_their_type() {
        for (row, (_, one)) in all().enumerate() {
            for (column, (_, other)) in all().enumerate() {
                assert_eq!(one == other, row == column, "{one:?} and {other:?}");
            }
        }
    }
}
