//! The effects by which a simulation and a robot may differ: identifiers and parameters as robot files,
//! injection files and gap reports write them.

use serde::{Deserialize, Serialize};

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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "effect", rename_all = "snake_case", deny_unknown_fields)]
#[allow(missing_docs, reason = "the names are the definitions; the crate page has the table")]
pub enum Effect {
    CoulombFriction { coulomb_nm: f64 },
    ViscousFriction { viscous_nm_s_rad: f64 },
    QuadraticFriction { quadratic_nm_s2_rad2: f64 },
    /// Breakaway minus Coulomb; negative where friction rises with speed. `stribeck_nm·exp(-|v|/stribeck_velocity)`.
    StribeckFriction { stribeck_nm: f64, stribeck_velocity_rad_s: f64 },
    /// Half the difference between the directions.
    AsymmetricFriction { asymmetry_nm: f64 },
    /// Nm of friction per Nm of load.
    LoadDependentFriction { load_coefficient: f64 },
    PositionDependentFriction { amplitude_nm: f64, cycles_per_motor_rev: f64, phase_rad: f64 },
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
    TorsionalCompliance { stiffness_nm_rad: f64 },
    /// Stiffness below the knee torque.
    SoftWindup { low_stiffness_nm_rad: f64, knee_nm: f64 },
    TorsionalHysteresis { width_nm: f64, yield_rad: f64 },
    StructuralDamping { damping_nm_s_rad: f64, exponent: f64 },
    Backlash { gap_rad: f64 },
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
    TorqueConstantError { gain: f64 },
    /// Joint side.
    TorqueOffset { offset_nm: f64 },
    /// Motor side.
    TorqueRipple { amplitude_nm: f64, cycles_per_motor_rev: f64, phase_rad: f64 },
    /// Motor side.
    TorqueSaturation { limit_nm: f64 },
    CurrentLoopLag { time_constant_s: f64 },
    /// In the last link's frame.
    Payload { mass_kg: f64, centre_m: [f64; 3] },
    /// Added about the joint axis.
    LinkInertia { inertia_kg_m2: f64 },
    /// Added, motor side.
    RotorInertia { inertia_kg_m2: f64 },
    GravityTorque { sin_nm: f64, cos_nm: f64 },
    JointSpring { stiffness_nm_rad: f64, rest_rad: f64 },
    BaseTilt { roll_rad: f64, pitch_rad: f64 },
    EncoderOffset { offset_rad: f64 },
    EncoderEccentricity { amplitude_rad: f64, cycles_per_rev: f64, phase_rad: f64, side: EncoderSide },
    EncoderQuantisation { resolution_rad: f64, side: EncoderSide },
    VelocityFilterLag { cutoff_hz: f64 },
    CommandDelay { delay_s: f64 },
    SensorDelay { delay_s: f64 },
    DroppedCommands { fraction: f64 },
    DroppedSamples { fraction: f64 },
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}
