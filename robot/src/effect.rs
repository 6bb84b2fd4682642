//! The effects by which a simulation and a robot may differ: identifiers and parameters as robot files,
//! injection files and gap reports write them.

use std::fmt;

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

/// Which encoder an effect acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EncoderSide {
    /// Before the gear.
    Motor,
    /// After the gear.
    Link,
}

/// One effect with its parameters. SI units; friction at the joint side.
///
/// Effects of one kind at one joint add up: `coulomb_nm = 2.0` with an entry `coulomb_nm = -0.3` beside it means
/// 1.7 Nm, and a negative stiffness beside a positive one softens it. Gains multiply. Velocities, exponents, time
/// constants, cut-offs, limits and resolutions shape their own entry and are positive in each.
#[derive(
    Clone, Copy, Debug, PartialEq, Serialize, Deserialize, strum::IntoStaticStr, strum::VariantNames,
)]
#[serde(tag = "effect", rename_all = "snake_case", deny_unknown_fields)]
#[strum(serialize_all = "snake_case")]
#[allow(
    missing_docs,
    reason = "the names of variants and parameters are their definitions"
)]
pub enum Effect {
    CoulombFriction {
        coulomb_nm: f64,
    },
    ViscousFriction {
        viscous_nm_s_rad: f64,
    },
    QuadraticFriction {
        quadratic_nm_s2_rad2: f64,
    },
    /// Breakaway minus Coulomb; negative where friction rises with speed. `stribeck_nm·exp(-|v|/stribeck_velocity)`.
    StribeckFriction {
        stribeck_nm: f64,
        stribeck_velocity_rad_s: f64,
    },
    /// Half the difference between the directions.
    AsymmetricFriction {
        asymmetry_nm: f64,
    },
    /// Nm of friction per Nm of load.
    LoadDependentFriction {
        load_coefficient: f64,
    },
    PositionDependentFriction {
        amplitude_nm: f64,
        cycles_per_motor_rev: f64,
        phase_rad: f64,
    },
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
    },
    TorsionalCompliance {
        stiffness_nm_rad: f64,
    },
    /// Stiffness below the knee torque.
    SoftWindup {
        low_stiffness_nm_rad: f64,
        knee_nm: f64,
    },
    TorsionalHysteresis {
        width_nm: f64,
        yield_rad: f64,
    },
    StructuralDamping {
        damping_nm_s_rad: f64,
        exponent: f64,
    },
    Backlash {
        gap_rad: f64,
    },
    /// Either a constant drift, or a first-order change with a time constant.
    ThermalFrictionDrift {
        #[serde(default, skip_serializing_if = "Option::is_none")]
        drift_nm_s: Option<f64>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        time_constant_s: Option<f64>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        change_nm: Option<f64>,
    },
    /// True over nominal torque constant.
    TorqueConstantError {
        gain: f64,
    },
    /// Joint side.
    TorqueOffset {
        offset_nm: f64,
    },
    /// Motor side.
    TorqueRipple {
        amplitude_nm: f64,
        cycles_per_motor_rev: f64,
        phase_rad: f64,
    },
    /// Motor side.
    TorqueSaturation {
        limit_nm: f64,
    },
    CurrentLoopLag {
        time_constant_s: f64,
    },
    /// A point mass in the last link's frame. A single number for the centre is the distance along that frame's z axis.
    Payload {
        mass_kg: f64,
        #[serde(deserialize_with = "point_or_distance_along_z")]
        centre_m: [f64; 3],
    },
    /// Added about the joint axis.
    LinkInertia {
        inertia_kg_m2: f64,
    },
    /// Added, motor side.
    RotorInertia {
        inertia_kg_m2: f64,
    },
    /// `sin_nm·sin q + cos_nm·cos q`, added to the torque that holds the joint.
    GravityTorque {
        sin_nm: f64,
        cos_nm: f64,
    },
    JointSpring {
        stiffness_nm_rad: f64,
        rest_rad: f64,
    },
    BaseTilt {
        roll_rad: f64,
        pitch_rad: f64,
    },
    EncoderOffset {
        offset_rad: f64,
    },
    EncoderEccentricity {
        amplitude_rad: f64,
        cycles_per_rev: f64,
        phase_rad: f64,
        side: EncoderSide,
    },
    EncoderQuantisation {
        resolution_rad: f64,
        side: EncoderSide,
    },
    VelocityFilterLag {
        cutoff_hz: f64,
    },
    CommandDelay {
        delay_s: f64,
    },
    SensorDelay {
        delay_s: f64,
    },
    DroppedCommands {
        fraction: f64,
    },
    DroppedSamples {
        fraction: f64,
    },
}

impl Effect {
    /// The identifier files and reports use, such as `coulomb_friction`.
    pub fn name(&self) -> &'static str {
        self.into()
    }

    /// The identifiers of all effects.
    pub fn names() -> &'static [&'static str] {
        <Self as strum::VariantNames>::VARIANTS
    }

    /// As the keys of a TOML table.
    ///
    /// # Errors
    /// [`toml::ser::Error`] for a value that TOML does not have.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// Whether the effect belongs to the whole arm and to no joint: payload and base tilt.
    pub fn is_whole_arm(&self) -> bool {
        matches!(self, Self::Payload { .. } | Self::BaseTilt { .. })
    }

    /// Whether the effect may act on all joints at once: the whole-arm effects, and the timing of the bus.
    pub fn may_be_shared(&self) -> bool {
        let timing = matches!(
            self,
            Self::CommandDelay { .. }
                | Self::SensorDelay { .. }
                | Self::DroppedCommands { .. }
                | Self::DroppedSamples { .. }
        );
        timing || self.is_whole_arm()
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
