//! Every effect of the table as something that can be fitted: amplitudes that enter linearly, and a shape that does not.
//!
//! An amplitude of 1 is a step small enough for the response to be straight and large enough to be seen over rounding;
//! a zero amplitude is no effect at all.

use arrayvec::ArrayVec;
use nalgebra::Vector3;
use robot::{Effect, EncoderSide};

use crate::scale::Scale;
use crate::stage::Stage;

/// Friction steps: a part of the joint's own.
const FRICTION_STEP: f64 = 0.02;
/// Softening steps: a part of the compliance.
const COMPLIANCE_STEP: f64 = 0.05;
/// Twist of a gear under its friction, for steps of lost motion and kinematic error.
const TWIST_STEP: f64 = 0.1;
const GAIN_STEP: f64 = 0.01;
const PAYLOAD_STEP_KG: f64 = 0.1;
const PAYLOAD_STEP_M: f64 = 0.1;
/// How far off a payload is tried that one joint alone carries, and between which distances it is sought.
const PAYLOAD_DISTANCE_M: f64 = 0.3;
const PAYLOAD_DISTANCES_M: [f64; 2] = [0.02, 2.0];
const TILT_STEP_RAD: f64 = 0.005;
const OFFSET_STEP_RAD: f64 = 0.002;
const LAG_STEP_S: f64 = 5e-4;
/// Steps of inertia: a part of the joint's own.
const INERTIA_STEP: f64 = 0.02;
/// Friction that falls at lower speeds than this is part of how a joint begins to slip.
const CREEPING_RAD_S: f64 = 0.008;

/// An effect to be fitted, at one shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// Identifier of the effect.
    pub effect: &'static str,
    form: Form,
    /// Parameters that do not enter linearly, each above zero.
    pub shape: ArrayVec<f64, 2>,
    /// Amplitude at which the response is found: one step, but for what answers a large one otherwise than many small ones.
    reach: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Coulomb,
    Viscous,
    Quadratic,
    Stribeck,
    Asymmetric,
    LoadDependent,
    PeriodicFriction,
    KinematicError,
    Compliance,
    Windup,
    Hysteresis,
    StructuralDamping,
    Backlash,
    ConstantDrift,
    FirstOrderDrift,
    Gain,
    Offset,
    Ripple,
    Saturation,
    Lag,
    /// By its mass and moments.
    Payload,
    /// By its moments across the axis, at a distance from it: one joint alone does not feel the mass, only weight and inertia.
    PayloadAt,
    LinkInertia,
    RotorInertia,
    Gravity,
    Spring,
    Tilt,
    EncoderOffset,
    MotorEccentricity,
    LinkEccentricity,
    CommandDelay,
    SensorDelay,
}

/// Forms that are terms of a series in one variable: velocity, position, the motion's derivatives, the gear's twist.
const SERIES: [&[Form]; 4] = [
    &[
        Form::Coulomb,
        Form::Viscous,
        Form::Quadratic,
        Form::Stribeck,
    ],
    &[
        Form::Offset,
        Form::Asymmetric,
        Form::Payload,
        Form::PayloadAt,
        Form::Gravity,
        Form::Spring,
        Form::Tilt,
        Form::EncoderOffset,
    ],
    &[
        Form::Viscous,
        Form::LinkInertia,
        Form::RotorInertia,
        Form::Payload,
        Form::PayloadAt,
        Form::Lag,
        Form::CommandDelay,
        Form::SensorDelay,
        Form::Compliance,
    ],
    &[
        Form::Compliance,
        Form::Windup,
        Form::Hysteresis,
        Form::StructuralDamping,
        Form::Backlash,
    ],
];

/// Amplitudes of a hypothesis: at most those of a payload.
pub type Amplitudes = ArrayVec<f64, 4>;

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
    let mut all = Vec::new();
    let mut add = |effect, form, shape: &[f64]| all.push(Hypothesis::new(effect, form, shape));
    add("coulomb_friction", Form::Coulomb, &[]);
    add("viscous_friction", Form::Viscous, &[]);
    add("quadratic_friction", Form::Quadratic, &[]);
    for part in [0.02, 0.06, 0.18] {
        let slowest_rad_s = CREEPING_RAD_S.min(0.1 * scale.speed_rad_s);
        let velocity_rad_s = (part * scale.speed_rad_s).max(slowest_rad_s);
        add("stribeck_friction", Form::Stribeck, &[velocity_rad_s]);
    }
    add("asymmetric_friction", Form::Asymmetric, &[]);
    add("load_dependent_friction", Form::LoadDependent, &[]);
    add("torsional_compliance", Form::Compliance, &[]);
    for part in [0.3, 1.0, 3.0] {
        add("soft_windup", Form::Windup, &[part * scale.friction_nm]);
    }
    for part in [0.1, 0.5] {
        add(
            "torsional_hysteresis",
            Form::Hysteresis,
            &[part * scale.twist_rad()],
        );
    }
    for exponent in [0.5, 1.0] {
        add("structural_damping", Form::StructuralDamping, &[exponent]);
    }
    add("thermal_friction_drift", Form::ConstantDrift, &[]);
    add("thermal_friction_drift", Form::FirstOrderDrift, &[8.0]);
    add("torque_constant_error", Form::Gain, &[]);
    add("torque_offset", Form::Offset, &[]);
    if shown.has_command && scale.may_saturate {
        let parts = [0.95, 0.85, 0.7, 0.5].map(|part| part * scale.motor_torque_nm);
        // a drive that reports its torque shows where it ends
        for limit_nm in scale.reached_motor_nm.into_iter().chain(parts) {
            add("torque_saturation", Form::Saturation, &[limit_nm]);
        }
    }
    if shown.has_command {
        add("current_loop_lag", Form::Lag, &[]);
    }
    if shown.timing_is_open {
        if shown.has_command {
            add("command_delay", Form::CommandDelay, &[]);
        }
        add("sensor_delay", Form::SensorDelay, &[]);
    }
    if shown.joints > 1 {
        add("payload", Form::Payload, &[]);
    }
    add("link_inertia", Form::LinkInertia, &[]);
    add("rotor_inertia", Form::RotorInertia, &[]);
    add("gravity_torque", Form::Gravity, &[]);
    add("joint_spring", Form::Spring, &[]);
    add("base_tilt", Form::Tilt, &[]);
    add("encoder_offset", Form::EncoderOffset, &[]);
    if shown.has_link_encoder {
        // a ring off its centre or bent, and the teeth or poles of a few more
        for cycles in [1.0, 2.0, 4.0, 8.0] {
            add("encoder_eccentricity", Form::LinkEccentricity, &[cycles]);
        }
    }
    if shown.joints == 1 {
        // its inertia is added whichever way it hangs
        for reach in [1.0, -1.0] {
            let payload = Hypothesis::new("payload", Form::PayloadAt, &[PAYLOAD_DISTANCE_M]);
            all.push(payload.reaching(reach));
        }
    }
    // within a wide gap the link swings freely
    for reach in [1.0, 10.0, 100.0] {
        all.push(Hypothesis::new("backlash", Form::Backlash, &[]).reaching(reach));
    }
    all
}

/// A lag of the current loop, and a delay of the command, as they were read off the samples.
pub fn lag(time_constant_s: f64) -> (Hypothesis, f64) {
    let hypothesis = Hypothesis::new("current_loop_lag", Form::Lag, &[]);
    (hypothesis, time_constant_s / LAG_STEP_S)
}

/// See [`lag`].
pub fn delay(delay_s: f64, scale: &Scale) -> (Hypothesis, f64) {
    let hypothesis = Hypothesis::new("command_delay", Form::CommandDelay, &[]);
    (hypothesis, delay_s / scale.period_s)
}

/// The effects that repeat with the motor's turn, at so many cycles a turn.
pub fn periodic(cycles_per_motor_rev: f64) -> [Hypothesis; 4] {
    [
        ("position_dependent_friction", Form::PeriodicFriction),
        ("kinematic_error", Form::KinematicError),
        ("torque_ripple", Form::Ripple),
        ("encoder_eccentricity", Form::MotorEccentricity),
    ]
    .map(|(effect, form)| Hypothesis::new(effect, form, &[cycles_per_motor_rev]))
}

impl Hypothesis {
    fn new(effect: &'static str, form: Form, shape: &[f64]) -> Self {
        Self {
            effect,
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
        Self::new(self.effect, self.form, shape)
    }

    /// How many amplitudes there are.
    pub fn amplitudes(&self) -> usize {
        match self.form {
            Form::Payload => 4,
            Form::PeriodicFriction
            | Form::KinematicError
            | Form::Ripple
            | Form::MotorEccentricity
            | Form::LinkEccentricity
            | Form::PayloadAt
            | Form::Gravity
            | Form::Spring
            | Form::Tilt => 2,
            _ => 1,
        }
    }

    /// Whether amplitudes below zero have no meaning.
    pub fn is_positive(&self) -> bool {
        matches!(
            self.form,
            Form::Windup
                | Form::Hysteresis
                | Form::StructuralDamping
                | Form::Backlash
                | Form::Saturation
                | Form::Lag
                | Form::CommandDelay
                | Form::SensorDelay
        )
    }

    /// The smallest amplitude that has a meaning.
    pub fn lowest(&self, scale: &Scale) -> f64 {
        if self.is_positive() {
            return 0.0;
        }
        let inertia_step_kg_m2 = INERTIA_STEP * scale.inertia_kg_m2;
        match self.form {
            Form::Coulomb | Form::Stribeck => {
                -scale.least_friction_nm / (FRICTION_STEP * scale.friction_nm)
            }
            Form::RotorInertia => -scale.rotor_inertia_kg_m2 / inertia_step_kg_m2,
            Form::LinkInertia => -scale.spare_link_inertia_kg_m2 / inertia_step_kg_m2,
            _ => f64::NEG_INFINITY,
        }
    }

    /// Whether the effect is there or not, with its shape as its only parameter.
    pub fn is_switch(&self) -> bool {
        self.form == Form::Saturation
    }

    /// Whether the shape is found by fitting. A whole number of cycles is what a shaft does, and stays.
    pub fn shape_is_free(&self) -> bool {
        self.shape
            .first()
            .is_some_and(|shape| !self.is_periodic() || shape.fract() != 0.0)
    }

    /// Whether the effect shows in the same motion whatever its shape: friction that falls with speed in all that is slow. Other shapes
    /// choose where an effect shows.
    pub fn shows_at_any_shape(&self) -> bool {
        self.form == Form::Stribeck
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
        matches!(
            self.form,
            Form::PeriodicFriction
                | Form::KinematicError
                | Form::Ripple
                | Form::MotorEccentricity
                | Form::LinkEccentricity
        )
    }

    /// Whether the angle is the motor's.
    pub fn repeats_with_motor(&self) -> bool {
        self.is_periodic() && self.form != Form::LinkEccentricity
    }

    /// Whether both are terms of a series in one variable. Two that nearly cancel may stand for a law of that variable that is
    /// no term of the series.
    pub fn is_in_series_with(&self, other: &Self) -> bool {
        let both = [self.form, other.form];
        let mut series = SERIES.iter();
        self.is_periodic() && other.is_periodic()
            || series.any(|forms| both.iter().all(|form| forms.contains(form)))
    }

    /// Whether both are one effect that repeats with an angle, at different numbers of cycles: of those only a kinematic error has
    /// more than one.
    pub fn repeats(&self, other: &Self) -> bool {
        self.is_periodic() && self.form == other.form && self.form != Form::KinematicError
    }

    /// Whether its torque follows load, direction or time, and changes with nothing quicker.
    pub fn is_slow(&self) -> bool {
        matches!(
            self.form,
            Form::Asymmetric
                | Form::ConstantDrift
                | Form::FirstOrderDrift
                | Form::Offset
                | Form::Payload
                | Form::PayloadAt
                | Form::Gravity
                | Form::Spring
                | Form::Tilt
                | Form::EncoderOffset
        )
    }

    /// Between which the shape is sought.
    pub fn shape_range(&self, scale: &Scale) -> [f64; 2] {
        match self.form {
            // slower is creeping, which every joint does in its own way
            Form::Stribeck => [
                CREEPING_RAD_S.min(0.1 * scale.speed_rad_s),
                0.5 * scale.speed_rad_s,
            ],
            Form::Windup => [0.05 * scale.friction_nm, 5.0 * scale.friction_nm],
            Form::Hysteresis => [0.01 * scale.twist_rad(), 3.0 * scale.twist_rad()],
            Form::StructuralDamping => [0.2, 1.5],
            Form::FirstOrderDrift => [1.0, 300.0],
            Form::PayloadAt => PAYLOAD_DISTANCES_M,
            Form::Saturation => {
                let reached_nm = scale.reached_motor_nm.unwrap_or(0.0);
                let most_nm = reached_nm.max(scale.motor_torque_nm);
                [0.2 * scale.motor_torque_nm, 1.2 * most_nm]
            }
            _ => self.shape.first().map_or([0.0, f64::INFINITY], |cycles| {
                let slack = 1.0 / (cycles * scale.motor_turns);
                [cycles * (1.0 - slack).max(0.5), cycles * (1.0 + slack)]
            }),
        }
    }

    /// The effect at these amplitudes, as a robot file would write it.
    pub fn effect(&self, amplitude: &[f64], scale: &Scale) -> Effect {
        let a = amplitude[0];
        let step_nm = FRICTION_STEP * scale.friction_nm;
        let shape = self.shape.first().copied().unwrap_or(0.0);
        match self.form {
            Form::Coulomb => Effect::CoulombFriction {
                coulomb_nm: a * step_nm,
            },
            Form::Viscous => Effect::ViscousFriction {
                viscous_nm_s_rad: a * step_nm / scale.speed_rad_s,
            },
            Form::Quadratic => Effect::QuadraticFriction {
                quadratic_nm_s2_rad2: a * step_nm / scale.speed_rad_s.powi(2),
            },
            Form::Stribeck => Effect::StribeckFriction {
                stribeck_nm: a * step_nm,
                stribeck_velocity_rad_s: shape,
            },
            Form::Asymmetric => Effect::AsymmetricFriction {
                asymmetry_nm: a * step_nm,
            },
            Form::LoadDependent => Effect::LoadDependentFriction {
                load_coefficient: a * 0.01,
            },
            Form::ConstantDrift => Effect::ThermalFrictionDrift {
                drift_nm_s: Some(a * 0.1 * step_nm),
                time_constant_s: None,
                change_nm: None,
            },
            Form::FirstOrderDrift => Effect::ThermalFrictionDrift {
                drift_nm_s: None,
                time_constant_s: Some(shape),
                change_nm: Some(a * step_nm),
            },
            Form::Compliance => Effect::TorsionalCompliance {
                stiffness_nm_rad: softened_nm_rad(a, scale),
            },
            Form::Windup => Effect::SoftWindup {
                low_stiffness_nm_rad: scale.stiffness_nm_rad / (1.0 + 4.0 * COMPLIANCE_STEP * a),
                knee_nm: shape,
            },
            Form::Hysteresis => Effect::TorsionalHysteresis {
                width_nm: a * step_nm,
                yield_rad: shape,
            },
            Form::StructuralDamping => Effect::StructuralDamping {
                damping_nm_s_rad: a * step_nm / (0.01 * scale.speed_rad_s),
                exponent: shape,
            },
            Form::Backlash => Effect::Backlash {
                gap_rad: a * TWIST_STEP * scale.twist_rad(),
            },
            Form::Gain => Effect::TorqueConstantError {
                gain: 1.0 + a * GAIN_STEP,
            },
            Form::Offset => Effect::TorqueOffset {
                offset_nm: a * step_nm,
            },
            Form::Saturation => Effect::TorqueSaturation { limit_nm: shape },
            Form::Lag => Effect::CurrentLoopLag {
                time_constant_s: a * LAG_STEP_S,
            },
            Form::LinkInertia => Effect::LinkInertia {
                inertia_kg_m2: a * INERTIA_STEP * scale.inertia_kg_m2,
            },
            Form::RotorInertia => Effect::RotorInertia {
                inertia_kg_m2: a * INERTIA_STEP * scale.inertia_kg_m2 / scale.gear_ratio.powi(2),
            },
            Form::Gravity => Effect::GravityTorque {
                sin_nm: a * step_nm,
                cos_nm: amplitude[1] * step_nm,
            },
            Form::EncoderOffset => Effect::EncoderOffset {
                offset_rad: a * OFFSET_STEP_RAD,
            },
            Form::CommandDelay => Effect::CommandDelay {
                delay_s: a * scale.period_s,
            },
            Form::SensorDelay => Effect::SensorDelay {
                delay_s: a * scale.period_s,
            },
            Form::Tilt => Effect::BaseTilt {
                roll_rad: a * TILT_STEP_RAD,
                pitch_rad: amplitude[1] * TILT_STEP_RAD,
            },
            Form::Spring => {
                // stiffness and torque at zero enter linearly, the rest position does not
                let stiffness_nm_rad = a * step_nm;
                let rest_rad = if a == 0.0 { 0.0 } else { amplitude[1] / a };
                Effect::JointSpring {
                    stiffness_nm_rad,
                    rest_rad,
                }
            }
            Form::Payload => payload(amplitude),
            Form::PayloadAt => payload_at(amplitude, shape, &scale.across_axis),
            Form::PeriodicFriction
            | Form::KinematicError
            | Form::Ripple
            | Form::MotorEccentricity
            | Form::LinkEccentricity => self.harmonic(amplitude, scale),
        }
    }

    fn harmonic(&self, amplitude: &[f64], scale: &Scale) -> Effect {
        let size = amplitude[0].hypot(amplitude[1]);
        let phase_rad = amplitude[1].atan2(amplitude[0]);
        let cycles = self.shape.first().copied().unwrap_or(1.0);
        let step_nm = FRICTION_STEP * scale.friction_nm;
        let step_rad = TWIST_STEP * scale.twist_rad();
        match self.form {
            Form::KinematicError => Effect::KinematicError {
                amplitude_rad: size * step_rad,
                cycles_per_motor_rev: cycles,
                phase_rad,
                amplitude_rad_2: 0.0,
                cycles_per_motor_rev_2: 0.0,
                phase_rad_2: 0.0,
                amplitude_rad_3: 0.0,
                cycles_per_motor_rev_3: 0.0,
                phase_rad_3: 0.0,
            },
            Form::Ripple => Effect::TorqueRipple {
                amplitude_nm: size * step_nm / scale.gear_ratio,
                cycles_per_motor_rev: cycles,
                phase_rad,
            },
            Form::MotorEccentricity => Effect::EncoderEccentricity {
                amplitude_rad: size * step_rad * scale.gear_ratio,
                cycles_per_rev: cycles,
                phase_rad,
                side: EncoderSide::Motor,
            },
            Form::LinkEccentricity => Effect::EncoderEccentricity {
                amplitude_rad: size * step_rad,
                cycles_per_rev: cycles,
                phase_rad,
                side: EncoderSide::Link,
            },
            _ => Effect::PositionDependentFriction {
                amplitude_nm: size * step_nm,
                cycles_per_motor_rev: cycles,
                phase_rad,
            },
        }
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
        match self.form {
            // a centre of mass needs a mass
            Form::Payload if index > 0 => (at(&[(0, 1.0), (index, 1.0)]), Some(at(&[(0, 1.0)]))),
            // a spring's torque at zero needs a spring
            Form::Spring if index > 0 => (at(&[(0, 1.0), (index, 1.0)]), Some(at(&[(0, 1.0)]))),
            _ => (at(&[(index, self.reach)]), None),
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

/// Change of stiffness by so many steps of compliance; the stiffness itself where the file tells none.
fn softened_nm_rad(steps: f64, scale: &Scale) -> f64 {
    if scale.stiffness_is_known {
        let compliance = (1.0 + COMPLIANCE_STEP * steps).max(0.05);
        scale.stiffness_nm_rad * (1.0 / compliance - 1.0)
    } else {
        let compliance_rad_nm = 1.0 / scale.stiffness_nm_rad
            + steps.max(0.0) * 0.1 * scale.twist_rad() / scale.friction_nm;
        1.0 / compliance_rad_nm
    }
}

fn payload(amplitude: &[f64]) -> Effect {
    let mass = amplitude[0];
    // a mass of nothing has its centre nowhere
    let along = |moment: f64| {
        if mass.abs() < 1e-6 {
            0.0
        } else {
            (PAYLOAD_STEP_M * moment / mass).clamp(-2.0, 2.0)
        }
    };
    Effect::Payload {
        mass_kg: PAYLOAD_STEP_KG * mass,
        centre_m: [
            along(amplitude[1]),
            along(amplitude[2]),
            along(amplitude[3]),
        ],
    }
}

fn payload_at(moments: &[f64], distance_m: f64, across_axis: &[Vector3<f64>; 2]) -> Effect {
    let moment = across_axis[0] * moments[0] + across_axis[1] * moments[1];
    let size = moment.norm();
    let direction = if size > 0.0 {
        moment / size
    } else {
        Vector3::zeros()
    };
    Effect::Payload {
        mass_kg: PAYLOAD_STEP_KG * PAYLOAD_STEP_M * size / distance_m,
        centre_m: (direction * distance_m).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: Shown = Shown {
        joints: 7,
        has_link_encoder: true,
        has_command: true,
        timing_is_open: true,
    };

    fn scale() -> Scale {
        Scale {
            across_axis: [Vector3::x(), Vector3::z()],
            friction_nm: 5.0,
            least_friction_nm: 1.0,
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
    fn a_payload_of_one_joint_keeps_its_moment_at_any_distance() {
        for distance_m in [0.1, 0.4] {
            let payload = Hypothesis::new("payload", Form::PayloadAt, &[distance_m]);
            let Effect::Payload { mass_kg, centre_m } = payload.effect(&[3.0, -4.0], &scale())
            else {
                panic!("no payload");
            };
            assert!((mass_kg - 0.05 / distance_m).abs() < 1e-12, "{mass_kg}");
            assert!((mass_kg * centre_m[2] + 0.04).abs() < 1e-12, "{centre_m:?}");
        }
        let nothing = Hypothesis::new("payload", Form::PayloadAt, &[0.3]);
        let Effect::Payload { mass_kg, centre_m } = nothing.effect(&[0.0; 2], &scale()) else {
            panic!("no payload");
        };
        assert_eq!((mass_kg, centre_m), (0.0, [0.0; 3]));
    }

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
    fn terms_of_one_variable_are_a_series_and_a_drift_beside_a_gain_is_none() {
        let of = |name: &str| {
            let mut all = plain(&scale(), ARM).into_iter();
            all.find(|hypothesis| hypothesis.effect == name)
                .expect("it is on the list")
        };
        let is_series = |one, other| of(one).is_in_series_with(&of(other));
        assert!(is_series("viscous_friction", "quadratic_friction"));
        assert!(is_series("sensor_delay", "link_inertia"));
        assert!(!is_series(
            "thermal_friction_drift",
            "torque_constant_error"
        ));
        assert!(!is_series("coulomb_friction", "joint_spring"));
    }

    #[test]
    fn one_effect_at_two_numbers_of_cycles_repeats_unless_it_has_harmonics() {
        let (once, twice) = (periodic(1.0), periodic(2.0));
        for (one, other) in once.iter().zip(&twice) {
            assert_eq!(one.repeats(other), one.effect != "kinematic_error");
        }
        assert!(!once[0].repeats(&twice[2]));
        let plain = plain(&scale(), ARM);
        let mut others = plain.iter().filter(|one| !one.is_periodic());
        assert!(!others.any(|one| one.repeats(one)));
    }

    #[test]
    fn no_more_is_taken_off_than_there_is() {
        let scale = scale();
        let all = plain(&scale, ARM);
        let least = |name: &str, value: fn(Effect) -> Option<f64>| {
            let mut of_name = all.iter().filter(|h| h.effect == name);
            let hypothesis = of_name.next().expect("it is on the list");
            value(hypothesis.effect(&[hypothesis.lowest(&scale)], &scale))
                .expect("the effect of that name")
        };
        let coulomb_nm = least("coulomb_friction", |effect| match effect {
            Effect::CoulombFriction { coulomb_nm } => Some(coulomb_nm),
            _ => None,
        });
        assert!((coulomb_nm + 1.0).abs() < 1e-12, "{coulomb_nm}");
        let rotor_kg_m2 = least("rotor_inertia", |effect| match effect {
            Effect::RotorInertia { inertia_kg_m2 } => Some(inertia_kg_m2),
            _ => None,
        });
        assert!((rotor_kg_m2 + 0.6e-4).abs() < 1e-12, "{rotor_kg_m2}");
        let link_kg_m2 = least("link_inertia", |effect| match effect {
            Effect::LinkInertia { inertia_kg_m2 } => Some(inertia_kg_m2),
            _ => None,
        });
        assert!((link_kg_m2 + 0.1).abs() < 1e-12, "{link_kg_m2}");
    }
}
