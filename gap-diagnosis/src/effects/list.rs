//! The list of all effects, and which of them may be fitted to a joint.

use joint_twin::scale::Scale;
use robot::{EffectKind, Part};

use super::form::Form;
use super::*;

/// How each effect is fitted.
fn forms(kind: EffectKind) -> &'static [Form] {
    match kind {
        EffectKind::CoulombFriction => &[friction::COULOMB],
        EffectKind::ViscousFriction => &[friction::VISCOUS],
        EffectKind::QuadraticFriction => &[friction::QUADRATIC],
        EffectKind::StribeckFriction => &[friction::STRIBECK],
        EffectKind::AsymmetricFriction => &[friction::ASYMMETRIC],
        EffectKind::LoadDependentFriction => &[friction::LOAD_DEPENDENT],
        EffectKind::PositionDependentFriction => &[friction::POSITION_DEPENDENT],
        EffectKind::KinematicError => &[gear::KINEMATIC_ERROR],
        EffectKind::TorsionalCompliance => &[gear::COMPLIANCE],
        EffectKind::SoftWindup => &[gear::SOFT_WINDUP],
        EffectKind::TorsionalHysteresis => &[gear::HYSTERESIS],
        EffectKind::StructuralDamping => &[gear::STRUCTURAL_DAMPING],
        EffectKind::Backlash => &[gear::BACKLASH],
        EffectKind::ThermalFrictionDrift => {
            &[friction::CONSTANT_DRIFT, friction::FIRST_ORDER_DRIFT]
        }
        EffectKind::TorqueConstantError => &[drive::TORQUE_CONSTANT_ERROR],
        EffectKind::TorqueOffset => &[drive::TORQUE_OFFSET],
        EffectKind::TorqueRipple => &[drive::TORQUE_RIPPLE],
        EffectKind::TorqueSaturation => &[drive::TORQUE_SATURATION],
        EffectKind::CurrentLoopLag => &[drive::CURRENT_LOOP_LAG],
        EffectKind::Payload => &[load::PAYLOAD, load::PAYLOAD_AT],
        EffectKind::LinkInertia => &[load::LINK_INERTIA],
        EffectKind::RotorInertia => &[load::ROTOR_INERTIA],
        EffectKind::GravityTorque => &[load::GRAVITY_TORQUE],
        EffectKind::JointSpring => &[load::JOINT_SPRING],
        EffectKind::BaseTilt => &[load::BASE_TILT],
        EffectKind::EncoderOffset => &[sensors::ENCODER_OFFSET],
        EffectKind::EncoderEccentricity => {
            &[sensors::MOTOR_ECCENTRICITY, sensors::LINK_ECCENTRICITY]
        }
        EffectKind::CommandDelay => &[drive::COMMAND_DELAY],
        EffectKind::SensorDelay => &[drive::SENSOR_DELAY, drive::LATE_ENCODERS],
        // never: the samples show these by themselves, see `recording_checks`
        EffectKind::EncoderQuantisation
        | EffectKind::VelocityFilterLag
        | EffectKind::DroppedCommands
        | EffectKind::DroppedSamples => &[],
    }
}

impl Hypothesis {
    /// How its effect is fitted.
    pub(super) fn form(&self) -> &'static Form {
        &forms(self.kind)[self.place]
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

/// Every form of every effect, without a shape.
fn all() -> impl Iterator<Item = Hypothesis> {
    let kinds = EffectKind::ALL.iter().copied();
    let places = |kind: EffectKind| (0..forms(kind).len()).map(move |place| (kind, place));
    let each = kinds.flat_map(places);
    each.map(|(kind, place)| Hypothesis::new(kind, place, &[]))
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
    /// Nor is the torque at which it ends.
    pub limit_is_open: bool,
    /// Gravity lies across the joint's axis somewhere along the motion.
    pub feels_weight: bool,
}

/// What may be fitted to a joint, periodic effects aside: those come from [`periodic`] once their cycles are known.
pub fn plain(scale: &Scale, shown: Shown) -> Vec<Hypothesis> {
    let may_show = |of: &Hypothesis| !of.repeats_with_motor() && (of.form().may_show)(shown, scale);
    let mut fitted: Vec<_> = all().filter(may_show).collect();
    fitted.sort_by_key(|of| (of.form().comes, place(of.kind.part())));
    fitted.iter().flat_map(|of| tried(of, scale)).collect()
}

/// A form at each shape and each reach at which it is tried.
fn tried(of: &Hypothesis, scale: &Scale) -> Vec<Hypothesis> {
    let form = of.form();
    let shapes = (form.shapes)(scale);
    let mut shaped: Vec<Hypothesis> = shapes.iter().map(|shape| of.shaped(&[*shape])).collect();
    if shaped.is_empty() {
        shaped.push(of.clone());
    }
    let reaching = |of: Hypothesis| {
        let reaches = form.reaches.iter();
        reaches.map(move |reach| of.clone().reaching(*reach))
    };
    shaped.into_iter().flat_map(reaching).collect()
}

/// A lag of the current loop, and a delay of the command, as they were read off the samples.
pub fn lag(time_constant_s: f64) -> (Hypothesis, f64) {
    let hypothesis = Hypothesis::new(EffectKind::CurrentLoopLag, 0, &[]);
    (hypothesis, drive::lag_steps(time_constant_s))
}

/// See [`lag`].
pub fn delay(delay_s: f64, scale: &Scale) -> (Hypothesis, f64) {
    let hypothesis = Hypothesis::new(EffectKind::CommandDelay, 0, &[]);
    (hypothesis, delay_s / scale.period_s)
}

/// See [`lag`].
pub fn limit(limit_nm: f64) -> (Hypothesis, f64) {
    let hypothesis = Hypothesis::new(EffectKind::TorqueSaturation, 0, &[limit_nm]);
    (hypothesis, 1.0)
}

/// The effects that repeat with the motor's turn, at so many cycles a turn.
pub fn periodic(cycles_per_motor_rev: f64) -> Vec<Hypothesis> {
    let is_whole = cycles_per_motor_rev.fract() == 0.0;
    let of_motor = all().filter(Hypothesis::repeats_with_motor);
    of_motor
        .filter(|of| is_whole || !of.form().is_of_shaft)
        .map(|of| of.shaped(&[cycles_per_motor_rev]))
        .collect()
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
    fn an_encoder_shows_the_same_after_a_turn_of_its_shaft() {
        let is_there = |cycles: f64| {
            let mut all = periodic(cycles).into_iter();
            all.any(|of| of.kind == EffectKind::EncoderEccentricity)
        };
        assert!(is_there(2.0) && !is_there(0.64));
    }
}
