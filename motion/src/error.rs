//! Why a trajectory cannot be used. Every message is one line: what, where, what to change.

use robot::RobotError;

/// Why a trajectory cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// The file cannot be read, or something in it is wrong.
    #[error(transparent)]
    File(#[from] RobotError),
    /// Neither a known name nor a file.
    #[error(
        "unknown trajectory `{name}`: no such file, and none of lemniscate, trapezoid, sine, multi_sine, hold{hint}"
    )]
    Unknown {
        /// What was asked for.
        name: String,
        /// The nearest known name.
        hint: String,
    },
    /// Samples that make no trajectory.
    #[error("the sampled reference cannot be followed: {reason}")]
    Samples {
        /// What is wrong with it.
        reason: String,
    },
    /// The arm is not built like the PA-10.
    #[error(
        "the lemniscate needs a PA-10-shaped arm, but {reason}; use multi_sine or a trajectory file"
    )]
    Shape {
        /// What is different.
        reason: String,
    },
    /// The tool path leaves the arm's workspace or comes too near to a singular pose.
    #[error(
        "at {time_s:.3} s the arm cannot reach the path without passing a singular pose; change the arm or its tool"
    )]
    Reach {
        /// When, on the path.
        time_s: f64,
    },
    /// A joint would leave its range.
    #[error(
        "{joint} would be at {position_rad:.4} rad at {time_s:.3} s, outside its limits {low_rad:.4} to {high_rad:.4} rad; \
         make the motion smaller or move its centre"
    )]
    PositionLimit {
        /// Name of the joint.
        joint: String,
        /// When.
        time_s: f64,
        /// Where the joint would be.
        position_rad: f64,
        /// Lower limit.
        low_rad: f64,
        /// Upper limit.
        high_rad: f64,
    },
    /// A joint would be too fast.
    #[error(
        "{joint} would move at {velocity_rad_s:.4} rad/s at {time_s:.3} s, above its limit of {limit_rad_s:.4} rad/s; \
         make the motion smaller or slower"
    )]
    VelocityLimit {
        /// Name of the joint.
        joint: String,
        /// When.
        time_s: f64,
        /// Velocity the joint would have.
        velocity_rad_s: f64,
        /// Largest speed allowed.
        limit_rad_s: f64,
    },
}
