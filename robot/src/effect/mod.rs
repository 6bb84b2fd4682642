//! The effects by which a simulation and a robot may differ: one table, one file an effect.
//!
//! An effect's line in the table gives its identifier and its parameters, as robot files, injection files and gap reports
//! write them, what these may be, the [`Part`] of a joint that it changes, and its [`Scope`]. Its file says what it does to
//! that part. Whoever has joints takes it from here: see [`parts`].

mod asymmetric_friction;
mod backlash;
mod base_tilt;
mod command_delay;
mod coulomb_friction;
mod current_loop_lag;
mod dropped_commands;
mod dropped_samples;
mod encoder_eccentricity;
mod encoder_offset;
mod encoder_quantisation;
mod gravity_torque;
mod joint_spring;
mod kinematic_error;
mod link_inertia;
mod load_dependent_friction;
pub mod parts;
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
mod velocity_filter_lag;
mod viscous_friction;

use std::fmt;

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use self::parts::{Actuator, Bus, Full, Gear, JointParts, Load, Sensors, SoftStart, Warming};
use crate::bodies::Bodies;
use crate::check::Must;

/// Which encoder an effect acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EncoderSide {
    /// Before the gear.
    Motor,
    /// After the gear.
    Link,
}

/// Encoders of a joint that are late.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LateSide {
    /// The one before the gear.
    Motor,
    /// The one after the gear.
    Link,
    /// Both.
    Both,
}

/// What of a joint an effect changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The laws of friction in steady motion.
    Friction,
    /// Friction over time.
    Warming,
    /// What lies between motor and link.
    Gear,
    /// What lies between the torque that is asked for and that at the shaft.
    Actuator,
    /// What acts at the joint beside the arm's bodies.
    Load,
    /// The arm's bodies.
    Bodies,
    /// What lies between an angle and its reading.
    Sensors,
    /// The path of commands and samples.
    Bus,
}

/// Where in a joint an effect acts, as reports tell it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Drive and motor.
    Actuator,
    /// Gear and bearings.
    Transmission,
    /// Links.
    RigidBody,
    /// Encoders and sensors.
    Sensing,
    /// Bus and clock.
    Timing,
}

impl Stage {
    /// Of an effect by its identifier; none where the list has no such effect.
    pub fn of(effect: &str) -> Option<Self> {
        EffectKind::named(effect).map(EffectKind::stage)
    }
}

impl Part {
    /// The stage that it belongs to.
    pub fn stage(self) -> Stage {
        match self {
            Self::Friction | Self::Warming | Self::Gear => Stage::Transmission,
            Self::Actuator => Stage::Actuator,
            Self::Load | Self::Bodies => Stage::RigidBody,
            Self::Sensors => Stage::Sensing,
            Self::Bus => Stage::Timing,
        }
    }
}

/// Which joints one cause of an effect may act on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// One.
    Joint,
    /// It belongs to the arm and to no joint; all feel it.
    WholeArm,
    /// One, or all on the bus.
    Bus,
}

/// A parameter of an effect. Its name ends with its unit.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// As files and reports write it.
    pub name: &'static str,
    /// Whether entries of one kind at one joint add up to one with the sum of this.
    pub adds_up: bool,
    /// What it must be in every entry.
    pub(crate) each: Must,
    /// What the sum of a joint's entries must be.
    pub(crate) sum: Must,
}

impl Parameter {
    /// Whether it is proportional to the joint's torque, as its unit tells: of an effect in newton metres half as large it is half.
    pub fn is_of_torque(&self) -> bool {
        let name = self.name;
        name.contains("_nm") || ["inertia_kg_m2", "mass_kg", "load_coefficient"].contains(&name)
    }

    const fn new(name: &'static str) -> Self {
        Self {
            name,
            adds_up: false,
            each: Must::BeFinite,
            sum: Must::BeFinite,
        }
    }

    const fn adds_up(self) -> Self {
        Self {
            adds_up: true,
            ..self
        }
    }

    const fn each_is_positive(self) -> Self {
        Self {
            each: Must::BePositive,
            ..self
        }
    }

    const fn sum_is_positive(self) -> Self {
        Self {
            sum: Must::BePositive,
            ..self
        }
    }

    const fn sum_is_not_negative(self) -> Self {
        Self {
            sum: Must::NotBeNegative,
            ..self
        }
    }

    const fn sum_is_fraction(self) -> Self {
        Self {
            sum: Must::BeFraction,
            ..self
        }
    }
}

/// `Effect { parameter: type = rules } changes Part by part.file of Scope`, the scope being one joint where nothing is said.
macro_rules! effects {
    ($(
        $(#[$about:meta])*
        $name:ident { $($(#[$how:meta])* $value:ident: $type:ty $(= $($rule:ident)+)?),* $(,)? }
            changes $part:ident by $on:ident.$file:ident $(of $scope:ident)?,
    )*) => {
        /// One effect with its parameters. SI units; friction at the joint side.
        ///
        /// Effects of one kind at one joint add up: `coulomb_nm = 2.0` with an entry `coulomb_nm = -0.3` beside it means
        /// 1.7 Nm, and a negative stiffness beside a positive one softens it. Gains multiply. Velocities, exponents, time
        /// constants, cut-offs, limits and resolutions shape their own entry and are positive in each.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "effect", rename_all = "snake_case", deny_unknown_fields)]
        #[allow(missing_docs, reason = "the names of variants and parameters are their definitions")]
        pub enum Effect {
            $($(#[$about])* $name { $($(#[$how])* $value: $type),* },)*
        }

        /// An effect without its parameters.
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, strum::IntoStaticStr, strum::VariantNames,
        )]
        #[strum(serialize_all = "snake_case")]
        #[allow(missing_docs, reason = "the names of variants are their definitions")]
        pub enum EffectKind {
            $($name,)*
        }

        impl Effect {
            /// Which effect it is.
            pub fn kind(&self) -> EffectKind {
                match self {
                    $(Self::$name { .. } => EffectKind::$name,)*
                }
            }

            /// Acts on a joint. `strength` is 1 for the whole effect, and less while it grows or for a part of it; what cannot grow,
            /// such as a delay, is there at once.
            ///
            /// # Errors
            /// [`Full`] where there is no room for it.
            pub fn act(&self, on: &mut dyn JointParts, strength: f64) -> Result<(), Full> {
                match *self {
                    $(Self::$name { $($value),* } => match on.$on() {
                        Some(part) => $file::act(part, strength, $($value),*),
                        None => Ok(()),
                    },)*
                }
            }
        }

        impl EffectKind {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$name),*];

            /// What it changes.
            pub fn part(self) -> Part {
                match self {
                    $(Self::$name => Part::$part,)*
                }
            }

            /// Which joints one cause of it may act on.
            pub fn scope(self) -> Scope {
                match self {
                    $(Self::$name => [$(Scope::$scope,)? Scope::Joint][0],)*
                }
            }

            /// Its parameters, in the order in which files write them.
            pub fn parameters(self) -> &'static [Parameter] {
                match self {
                    $(Self::$name => const {
                        &[$(Parameter::new(stringify!($value))$($(.$rule())+)?),*]
                    },)*
                }
            }
        }
    };
}

effects! {
    CoulombFriction { coulomb_nm: f64 = adds_up } changes Friction by friction.coulomb_friction,
    ViscousFriction { viscous_nm_s_rad: f64 = adds_up } changes Friction by friction.viscous_friction,
    QuadraticFriction { quadratic_nm_s2_rad2: f64 = adds_up } changes Friction by friction.quadratic_friction,
    /// Breakaway minus Coulomb; negative where friction rises with speed. `stribeck_nm·exp(-|v|/stribeck_velocity)`.
    StribeckFriction {
        stribeck_nm: f64,
        stribeck_velocity_rad_s: f64 = each_is_positive,
    } changes Friction by friction.stribeck_friction,
    /// Half the difference between the directions.
    AsymmetricFriction { asymmetry_nm: f64 = adds_up } changes Friction by friction.asymmetric_friction,
    /// Nm of friction per Nm of load.
    LoadDependentFriction { load_coefficient: f64 = adds_up } changes Friction by friction.load_dependent_friction,
    PositionDependentFriction {
        amplitude_nm: f64,
        cycles_per_motor_rev: f64,
        phase_rad: f64,
    } changes Friction by friction.position_dependent_friction,
    /// Joint side, up to three harmonics.
    KinematicError {
        amplitude_rad: f64,
        cycles_per_motor_rev: f64,
        phase_rad: f64,
        #[serde(default, skip_serializing_if = "is_zero")]
        amplitude_rad_2: f64,
        #[serde(default, skip_serializing_if = "is_zero")]
        cycles_per_motor_rev_2: f64,
        #[serde(default, skip_serializing_if = "is_zero")]
        phase_rad_2: f64,
        #[serde(default, skip_serializing_if = "is_zero")]
        amplitude_rad_3: f64,
        #[serde(default, skip_serializing_if = "is_zero")]
        cycles_per_motor_rev_3: f64,
        #[serde(default, skip_serializing_if = "is_zero")]
        phase_rad_3: f64,
    } changes Gear by gear.kinematic_error,
    TorsionalCompliance { stiffness_nm_rad: f64 = sum_is_positive adds_up } changes Gear by gear.torsional_compliance,
    /// Stiffness below the knee torque.
    SoftWindup {
        low_stiffness_nm_rad: f64 = sum_is_positive,
        knee_nm: f64 = sum_is_not_negative,
    } changes Gear by gear.soft_windup,
    TorsionalHysteresis {
        width_nm: f64 = sum_is_not_negative,
        yield_rad: f64 = each_is_positive,
    } changes Gear by gear.torsional_hysteresis,
    StructuralDamping {
        damping_nm_s_rad: f64 = sum_is_not_negative,
        exponent: f64 = each_is_positive,
    } changes Gear by gear.structural_damping,
    Backlash { gap_rad: f64 = sum_is_not_negative adds_up } changes Gear by gear.backlash,
    /// Either a constant drift, or a first-order change with a time constant.
    ThermalFrictionDrift {
        #[serde(default, skip_serializing_if = "Option::is_none")]
        drift_nm_s: Option<f64>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        time_constant_s: Option<f64> = each_is_positive,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        change_nm: Option<f64>,
    } changes Warming by warming.thermal_friction_drift,
    /// True over nominal torque constant.
    TorqueConstantError { gain: f64 = each_is_positive } changes Actuator by actuator.torque_constant_error,
    /// Joint side.
    TorqueOffset { offset_nm: f64 = adds_up } changes Actuator by actuator.torque_offset,
    /// Motor side.
    TorqueRipple {
        amplitude_nm: f64,
        cycles_per_motor_rev: f64,
        phase_rad: f64,
    } changes Actuator by actuator.torque_ripple,
    /// Motor side.
    TorqueSaturation { limit_nm: f64 = each_is_positive } changes Actuator by actuator.torque_saturation,
    CurrentLoopLag { time_constant_s: f64 = each_is_positive adds_up } changes Actuator by actuator.current_loop_lag,
    /// A point mass in the last link's frame. A single number for the centre is the distance along that frame's z axis.
    Payload {
        mass_kg: f64,
        #[serde(deserialize_with = "point_or_distance_along_z")]
        centre_m: [f64; 3],
    } changes Bodies by bodies.payload of WholeArm,
    /// Added about the joint axis.
    LinkInertia { inertia_kg_m2: f64 = adds_up } changes Bodies by bodies.link_inertia,
    /// Added, motor side.
    RotorInertia { inertia_kg_m2: f64 = adds_up } changes Load by load.rotor_inertia,
    /// `sin_nm·sin q + cos_nm·cos q`, added to the torque that holds the joint.
    GravityTorque {
        sin_nm: f64 = adds_up,
        cos_nm: f64 = adds_up,
    } changes Load by load.gravity_torque,
    JointSpring {
        stiffness_nm_rad: f64,
        rest_rad: f64,
    } changes Load by load.joint_spring,
    BaseTilt {
        roll_rad: f64,
        pitch_rad: f64,
    } changes Bodies by bodies.base_tilt of WholeArm,
    EncoderOffset { offset_rad: f64 = adds_up } changes Sensors by sensors.encoder_offset,
    EncoderEccentricity {
        amplitude_rad: f64,
        cycles_per_rev: f64,
        phase_rad: f64,
        side: EncoderSide,
    } changes Sensors by sensors.encoder_eccentricity,
    EncoderQuantisation {
        resolution_rad: f64 = each_is_positive,
        side: EncoderSide,
    } changes Sensors by sensors.encoder_quantisation,
    VelocityFilterLag { cutoff_hz: f64 = each_is_positive } changes Sensors by sensors.velocity_filter_lag,
    CommandDelay { delay_s: f64 = sum_is_not_negative adds_up } changes Bus by bus.command_delay of Bus,
    /// Of all that a drive reports, torques included; of its encoders alone where a side is said.
    SensorDelay {
        delay_s: f64 = sum_is_not_negative,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        side: Option<LateSide>,
    } changes Bus by bus.sensor_delay of Bus,
    DroppedCommands { fraction: f64 = sum_is_fraction } changes Bus by bus.dropped_commands of Bus,
    DroppedSamples { fraction: f64 = sum_is_fraction } changes Bus by bus.dropped_samples of Bus,
}

impl EffectKind {
    /// By the identifier that files and reports use.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.name() == name)
    }

    /// The identifier files and reports use, such as `coulomb_friction`.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Where in a joint it acts.
    pub fn stage(self) -> Stage {
        self.part().stage()
    }
}

impl Effect {
    /// The identifier files and reports use, such as `coulomb_friction`.
    pub fn name(&self) -> &'static str {
        self.kind().name()
    }

    /// The identifiers of all effects.
    pub fn names() -> &'static [&'static str] {
        <EffectKind as strum::VariantNames>::VARIANTS
    }

    /// A kinematic error of one harmonic: so many radians of the joint, so often in a turn of the motor, at this phase.
    pub fn kinematic_error(amplitude_rad: f64, cycles_per_motor_rev: f64, phase_rad: f64) -> Self {
        Self::KinematicError {
            amplitude_rad,
            cycles_per_motor_rev,
            phase_rad,
            amplitude_rad_2: 0.0,
            cycles_per_motor_rev_2: 0.0,
            phase_rad_2: 0.0,
            amplitude_rad_3: 0.0,
            cycles_per_motor_rev_3: 0.0,
            phase_rad_3: 0.0,
        }
    }

    /// As the keys of a TOML table.
    ///
    /// # Errors
    /// [`toml::ser::Error`] for a value that TOML does not have.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// What of a joint it changes.
    pub fn part(&self) -> Part {
        self.kind().part()
    }

    /// Whether the effect belongs to the whole arm and to no joint: payload and base tilt.
    pub fn is_whole_arm(&self) -> bool {
        self.kind().scope() == Scope::WholeArm
    }

    /// Whether the effect may act on all joints at once: the whole-arm effects, and the timing of the bus.
    pub fn may_be_shared(&self) -> bool {
        self.kind().scope() != Scope::Joint
    }
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn point_or_distance_along_z<'de, D: Deserializer<'de>>(input: D) -> Result<[f64; 3], D::Error> {
    struct Point;

    impl<'de> Visitor<'de> for Point {
        type Value = [f64; 3];

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("three coordinates, or one distance along the last link's z axis")
        }

        fn visit_f64<E>(self, z_m: f64) -> Result<[f64; 3], E> {
            Ok([0.0, 0.0, z_m])
        }

        fn visit_i64<E>(self, z_m: i64) -> Result<[f64; 3], E> {
            Ok([0.0, 0.0, z_m as f64])
        }

        fn visit_u64<E>(self, z_m: u64) -> Result<[f64; 3], E> {
            Ok([0.0, 0.0, z_m as f64])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<[f64; 3], A::Error> {
            Deserialize::deserialize(serde::de::value::SeqAccessDeserializer::new(seq))
        }
    }

    input.deserialize_any(Point)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    fn payload(centre: &str) -> Result<Effect, toml::de::Error> {
        toml::from_str(&format!(
            "effect = \"payload\"\nmass_kg = 2\ncentre_m = {centre}"
        ))
    }

    #[test]
    fn a_single_number_places_the_payload_along_z() {
        let along_z = Effect::Payload {
            mass_kg: 2.0,
            centre_m: [0.0, 0.0, 0.5],
        };
        assert_eq!(payload("0.5").unwrap(), along_z);
        assert_eq!(payload("[0, 0.0, 0.5]").unwrap(), along_z);
        assert_eq!(
            payload("1").unwrap(),
            Effect::Payload {
                mass_kg: 2.0,
                centre_m: [0.0, 0.0, 1.0]
            }
        );
        assert!(payload("[0.0, 0.5]").is_err());
        assert!(
            payload("\"far\"")
                .unwrap_err()
                .message()
                .contains("three coordinates")
        );
    }

    #[test]
    fn names_are_those_serde_writes() {
        let effect = Effect::QuadraticFriction {
            quadratic_nm_s2_rad2: 0.5,
        };
        let written = toml::Table::try_from(effect).unwrap();
        assert_eq!(written["effect"].as_str(), Some(effect.name()));
        assert!(Effect::names().contains(&effect.name()));
        assert_eq!(Effect::names().len(), 33);
        for kind in EffectKind::ALL {
            assert_eq!(EffectKind::named(kind.name()), Some(*kind));
        }
        for name in Effect::names() {
            let missing = toml::from_str::<Effect>(&format!("effect = \"{name}\"\nnonsense = 1"));
            assert!(
                missing
                    .unwrap_err()
                    .message()
                    .contains("unknown field `nonsense`"),
                "{name}"
            );
        }
    }
}
