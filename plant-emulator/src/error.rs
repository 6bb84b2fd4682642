//! Why a plant cannot be built.

use joint_model::rigid_body::ChainError;

/// Why a plant cannot be built. In the cycle nothing fails: the drives have states, not errors.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// A plant file is not one.
    #[error(transparent)]
    Text(#[from] robot::RobotError),
    /// A plant file cannot be read.
    #[error("{file}: {reason}")]
    File {
        /// Which file.
        file: String,
        /// What the system says.
        reason: String,
    },
    /// A parameter is out of its range.
    #[error("{joint}: {name} = {value}, must be {must}")]
    Parameter {
        /// Joint, or "plant" for what all joints share.
        joint: String,
        /// The parameter.
        name: &'static str,
        /// What it is.
        value: f64,
        /// What it may be.
        must: &'static str,
    },
    /// The joints of the plant file are not those of the robot.
    #[error("plant parameters are for joints {found:?}, the robot has {expected:?}")]
    Joints {
        /// Names in the plant file.
        found: Vec<String>,
        /// Names in the robot file.
        expected: Vec<String>,
    },
    /// Not one start position for each joint, or not finite.
    #[error("start position needs {expected} finite values in rad, got {found:?}")]
    StartPosition {
        /// Joints of the robot.
        expected: usize,
        /// What was given.
        found: Vec<f64>,
    },
    /// A control period outside what the drives can follow.
    #[error("control period {period_s} s, must be between 0.0001 and 0.02")]
    Period {
        /// What was given.
        period_s: f64,
    },
    /// An injected effect names no joint where it needs one, or one that is not there.
    #[error("effect {effect}: joint {joint:?}, the robot has joints 0 to {last}; name one of them")]
    InjectedJoint {
        /// The effect.
        effect: &'static str,
        /// The joint named.
        joint: Option<usize>,
        /// Index of the last joint.
        last: usize,
    },
    /// A disturbance acts on a joint that is not there.
    #[error("a disturbance at joint {joint}, the robot has joints 0 to {}; name one of them", joints - 1)]
    DisturbedJoint {
        /// The joint named.
        joint: usize,
        /// Joints of the robot.
        joints: usize,
    },
    /// More terms of a kind at one joint than the plant has room for.
    #[error("joint {joint}: too many effects of the kind of {effect}, at most {at_most}")]
    TooManyEffects {
        /// Index of the joint.
        joint: usize,
        /// The effect that did not fit.
        effect: &'static str,
        /// Room for so many.
        at_most: usize,
    },
    /// Effects leave the joint without stiffness or rotor inertia.
    #[error("joint {joint}: with all effects {name} is {value}, must be above zero")]
    NotPositive {
        /// Index of the joint.
        joint: usize,
        /// What is left.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A delay longer than what is remembered.
    #[error("joint {joint}: delay {delay_s} s, at most {at_most_s} s at this control period")]
    Delay {
        /// Index of the joint.
        joint: usize,
        /// The delay.
        delay_s: f64,
        /// The longest.
        at_most_s: f64,
    },
    /// A torsional mode too fast to integrate.
    #[error(
        "joint {joint}: torsion swings at {frequency_hz:.0} Hz and would need {substeps} substeps a period, at most \
         {at_most}; give its link more inertia or its gear less stiffness"
    )]
    TooStiff {
        /// Index of the joint.
        joint: usize,
        /// The mode's frequency.
        frequency_hz: f64,
        /// Substeps it would need.
        substeps: usize,
        /// The most there are.
        at_most: usize,
    },
    /// The rigid bodies with all effects are none.
    #[error("rigid bodies with deviations and effects: {0}")]
    Chain(ChainError),
}
