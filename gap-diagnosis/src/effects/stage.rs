//! The stages of a joint that effects act in.

/// Where in a joint an effect acts.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
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
    /// By the effect's identifier.
    pub fn of(effect: &str) -> Self {
        match effect {
            "torque_constant_error"
            | "torque_offset"
            | "torque_ripple"
            | "torque_saturation"
            | "current_loop_lag" => Self::Actuator,
            "payload" | "link_inertia" | "rotor_inertia" | "gravity_torque" | "joint_spring"
            | "base_tilt" => Self::RigidBody,
            "encoder_offset"
            | "encoder_eccentricity"
            | "encoder_quantisation"
            | "velocity_filter_lag" => Self::Sensing,
            "command_delay" | "sensor_delay" | "dropped_commands" | "dropped_samples" => {
                Self::Timing
            }
            _ => Self::Transmission,
        }
    }
}
