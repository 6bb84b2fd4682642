//! What torque control may do beyond the papers' way, and before a trajectory may be followed.

use serde::{Deserialize, Serialize};

/// Choices of the feedforward; the default is PA10-05's: friction on desired velocity, `T_c` over the model's gravity, no
/// correction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControlOptions {
    /// The velocity that friction is fed forward on.
    pub friction_velocity: FrictionVelocity,
    /// The load at which friction that depends on load is taken.
    pub stiffness_torque: StiffnessTorque,
    /// Share of the model error seen by the torque estimator that is fed forward, 0 to 1; 0 is none.
    pub correction_gain: f64,
    /// What the joints are asked for.
    #[serde(default)]
    pub task: Task,
}

/// What the joints are asked for: their trajectory, or what commissioning needs before that.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Task {
    /// To follow the trajectory.
    #[default]
    Follow,
    /// Nothing: no command is sent, so the brakes stay closed.
    Rest,
    /// No torque: the brakes are open, and the joints are moved from outside.
    Release,
    /// One joint's torque grows until the joint moves, first one way, then the other; the others get none.
    Nudge {
        /// Its index in the robot's order.
        joint: usize,
    },
}

impl Task {
    /// Its name in recordings; a joint stands behind it.
    pub fn name(self) -> String {
        match self {
            Self::Follow => "follow".to_owned(),
            Self::Rest => "rest".to_owned(),
            Self::Release => "release".to_owned(),
            Self::Nudge { joint } => format!("nudge {joint}"),
        }
    }

    /// The task that a recording names.
    pub fn from_name(name: &str) -> Option<Self> {
        match name.split_once(' ') {
            None => [Self::Follow, Self::Rest, Self::Release]
                .into_iter()
                .find(|task| task.name() == name),
            Some(("nudge", joint)) => joint.parse().ok().map(|joint| Self::Nudge { joint }),
            Some(_) => None,
        }
    }
}

/// The velocity that friction is fed forward on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrictionVelocity {
    /// The reference's.
    #[default]
    Desired,
    /// The joint's own, observed from its motor encoder.
    Measured,
}

impl FrictionVelocity {
    /// Its name on the command line and in recordings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Desired => "desired",
            Self::Measured => "measured",
        }
    }
}

/// The load at which friction that depends on load is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StiffnessTorque {
    /// Gravity of the model at the reference.
    #[default]
    Load,
    /// Torque from the measured torsion of the gear; needs a link encoder.
    Torsion,
}

impl StiffnessTorque {
    /// Its name on the command line and in recordings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::Torsion => "torsion",
        }
    }
}
