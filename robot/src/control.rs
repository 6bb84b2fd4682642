//! The controller that ran on the robot while it was recorded.

use serde::{Deserialize, Serialize};

/// The control law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControlKind {
    /// Proportional and derivative feedback on position, plus [`Control::feedforward`]:
    /// `torque = kp·(reference - position) + kd·(reference velocity - velocity)`, saturated at the joint's torque limit.
    /// Files may write `pd`, which is the same law: nothing is fed forward unless they say so.
    #[serde(alias = "pd")]
    PdFeedforward,
    /// Proportional-integral feedback on velocity: `derivative_nm_s_rad` acts on the velocity error and
    /// `proportional_nm_rad` on its integral.
    VelocityPi,
    /// Torque commands from elsewhere, no feedback.
    OpenLoopTorque,
    /// Something else: a twin follows the recorded motion instead of closing the loop.
    Unknown,
}

/// Which position the controller feeds back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Feedback {
    /// Motor encoder over the gear ratio.
    #[default]
    Motor,
    /// Link encoder.
    Link,
}

/// What is fed forward, on the reference's position, velocity and acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Feedforward {
    /// Nothing.
    #[default]
    None,
    /// Rigid-body inverse dynamics.
    RigidBody,
    /// All nominal effects: rigid body, friction, load torque.
    Model,
}

/// The controller that ran on the robot while it was recorded.
///
/// In a robot file the gains follow the order of its `[[joint]]` tables; in a loaded [`Robot`](crate::Robot) the chain's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Control {
    /// Cycles per second, of the recorded controller and of a run that is not told another rate. A file may leave it out,
    /// and is then read as 0, where all it says is that the kind is unknown; the robot then has no control at all.
    #[serde(default)]
    pub rate_hz: f64,
    /// The control law.
    pub kind: ControlKind,
    /// Per joint, joint side. Kinds without feedback may leave it out; it is then zero.
    #[serde(default)]
    pub proportional_nm_rad: Vec<f64>,
    /// Per joint, joint side. Kinds without feedback may leave it out; it is then zero.
    #[serde(default)]
    pub derivative_nm_s_rad: Vec<f64>,
    /// Position fed back.
    #[serde(default)]
    pub feedback: Feedback,
    /// Model fed forward.
    #[serde(default)]
    pub feedforward: Feedforward,
    /// Cut-off of the low-pass on the backward difference of position; 0 for none.
    #[serde(default)]
    pub velocity_filter_hz: f64,
    /// Order of that Butterworth filter.
    #[serde(default = "one")]
    pub velocity_filter_order: u32,
    /// The command computed from sample k acts from sample `k + delay_cycles` on.
    #[serde(default = "one")]
    pub delay_cycles: u32,
}

impl Control {
    /// Whether it says no more than that nothing is known.
    pub(crate) fn is_silent(&self) -> bool {
        *self
            == Self {
                rate_hz: 0.0,
                kind: ControlKind::Unknown,
                proportional_nm_rad: Vec::new(),
                derivative_nm_s_rad: Vec::new(),
                feedback: Feedback::default(),
                feedforward: Feedforward::default(),
                velocity_filter_hz: 0.0,
                velocity_filter_order: one(),
                delay_cycles: one(),
            }
    }

    /// Whether the law feeds the motion back and is known.
    pub fn is_closed(&self) -> bool {
        matches!(
            self.kind,
            ControlKind::PdFeedforward | ControlKind::VelocityPi
        )
    }
}

fn one() -> u32 {
    1
}
