//! Why a recording gives no answer: which joint, which signal, and the number that decided it.

use joint_model::friction::Direction;
use joint_model::rigid_body::ChainError;
use recording::{MissingSignal, Signal};

/// A recording from which a quantity cannot be identified.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IdentificationError {
    /// The robot file does not know the joint.
    #[error("the robot has no joint `{joint}`; its joints are {}", there.join(", "))]
    UnknownJoint {
        /// The name asked for.
        joint: String,
        /// The names there are.
        there: Vec<String>,
    },
    /// A recording lacks a joint or a signal.
    #[error(transparent)]
    Missing(#[from] MissingSignal),
    /// A signal has too few measured values where it is needed.
    #[error(
        "joint `{joint}`: {signal} is missing in {missing} of {rows} rows from {from_s:.3} s on; \
         at most half of them may be"
    )]
    NotMeasured {
        /// The joint.
        joint: String,
        /// The signal.
        signal: Signal,
        /// Rows without a value.
        missing: usize,
        /// Rows looked at.
        rows: usize,
        /// Time of the first of these rows.
        from_s: f64,
    },
    /// The recordings hold less than the computation needs.
    #[error("joint `{joint}`: {signal} has {found} of {what}, at least {needed} are needed")]
    TooShort {
        /// The joint.
        joint: String,
        /// The signal.
        signal: Signal,
        /// What was counted, with its unit.
        what: &'static str,
        /// How much of it there is.
        found: f64,
        /// How much of it there must be.
        needed: f64,
    },
    /// The joint stood still where it had to move.
    #[error("joint `{joint}` never moved: {signal} shows at most {most_rad_s} rad/s at the joint")]
    NeverMoved {
        /// The joint.
        joint: String,
        /// The signal that shows it.
        signal: Signal,
        /// The largest speed found, joint side.
        most_rad_s: f64,
    },
    /// A signal has the wrong sign.
    #[error(
        "joint `{joint}`: {signal} has the wrong sign, {evidence}; reverse it in the mapping file"
    )]
    ReversedSign {
        /// The joint.
        joint: String,
        /// The signal.
        signal: Signal,
        /// What shows it, with numbers.
        evidence: String,
    },
    /// A direction of motion has too few different speeds for any model.
    #[error(
        "joint `{joint}`, {} direction: friction was measured at {found} different speeds, at least {needed} are needed",
        direction_name(*direction)
    )]
    TooFewSpeeds {
        /// The joint.
        joint: String,
        /// The direction of motion.
        direction: Direction,
        /// Different speeds there are.
        found: usize,
        /// Different speeds the smallest model needs.
        needed: usize,
    },
    /// The joint moved, but nowhere as quasi-static fits need it.
    #[error(
        "joint `{joint}`: {signal} shows no slow and steady motion in the {} direction; \
         sweep it at 0.002 to 0.2 rad/s, without acceleration, for more than 0.01 rad",
        direction_name(*direction)
    )]
    NoSlowMotion {
        /// The joint.
        joint: String,
        /// The signal that shows it.
        signal: Signal,
        /// The direction of motion.
        direction: Direction,
    },
    /// A recording does not tell its payload.
    #[error(
        "the recording's metadata has {}; write the payload's mass as `payload_kg` (0 for none) and its centre in the \
         last link's frame as `payload_centre_m` (x, y, z)",
        metadata(key, found.as_deref())
    )]
    PayloadMissing {
        /// The metadata's key.
        key: &'static str,
        /// What stands there.
        found: Option<String>,
    },
    /// Gravity loads the joint too evenly to tell how its torque depends on load.
    #[error(
        "joint `{joint}`, {} direction: gravity torque varies by {found_nm:.3} Nm, at least {needed_nm:.3} Nm are needed \
         beside the scatter of motor_torque_nm; add payload, or mount the arm so that gravity acts on this joint",
        direction_name(*direction)
    )]
    SmallGravityRange {
        /// The joint.
        joint: String,
        /// The direction of motion.
        direction: Direction,
        /// Range of the gravity torque, joint side.
        found_nm: f64,
        /// Range that the scatter of the data asks for, joint side.
        needed_nm: f64,
    },
    /// The fitted masses are those of no arm.
    #[error(
        "joint `{joint}`: the gravity fit gives its link {mass_kg:.4} kg where the robot file has {file_mass_kg:.4} kg; \
         check the sign and scale of motor_torque_nm and the robot file's kinematics"
    )]
    ImpossibleMass {
        /// The joint that carries the link.
        joint: String,
        /// The mass found.
        mass_kg: f64,
        /// The robot file's.
        file_mass_kg: f64,
    },
    /// Links and payload make no possible arm.
    #[error(transparent)]
    ImpossibleArm(#[from] ChainError),
}

/// What a metadata key holds, in words.
fn metadata(key: &str, found: Option<&str>) -> String {
    found.map_or_else(
        || format!("no `{key}`"),
        |found| format!("`{key}` = `{found}`, which is not what it should be"),
    )
}

/// The direction in words.
pub(crate) fn direction_name(direction: Direction) -> &'static str {
    match direction {
        Direction::Positive => "positive",
        Direction::Negative => "negative",
    }
}
