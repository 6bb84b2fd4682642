//! Whether a recording can be trusted, and what it cannot support: found from the data, before anything is computed
//! from them.

mod meaning;
mod motion;
mod ratio;
mod robot;
mod scale;
mod support;
mod swap;
mod timing;
mod torque;
mod unsigned;

pub use motion::STILL_RAD;

use crate::statistics::span;
use crate::{JointColumns, Recording, Signal};
use crate::{as_measured, held, misread, wrapped};
use serde::{Deserialize, Serialize};
use std::fmt;

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Good to know.
    Note,
    /// Results will be worse, or some will be missing.
    Warning,
    /// Results would be wrong.
    Error,
}

/// What kind of thing was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// Too few rows for anything.
    TooShort,
    /// The recorder was stopped: the last rows may be missing.
    Truncated,
    /// Slower than the lowest supported rate.
    SlowSampling,
    /// The times show another rate than the planned one.
    RateOff,
    /// Rows follow each other irregularly.
    Jitter,
    /// Rows are missing.
    Gaps,
    /// Rows of the same time.
    RepeatedTimes,
    /// A joint stands still.
    NoMotion,
    /// A joint moves at one speed only.
    OneSpeed,
    /// A joint moves in one direction only.
    OneDirection,
    /// A joint swings at one frequency only.
    OneFrequency,
    /// Many values of a signal are missing.
    MissingValues,
    /// A signal stays while the joint moves.
    StuckSignal,
    /// A position begins anew after a turn.
    Wrapped,
    /// A position leaps away and back.
    Misread,
    /// A torque or current was recorded without its sign.
    Unsigned,
    /// Values are repeated until the next ones come.
    Held,
    /// Neither encoder.
    NoPosition,
    /// Nothing tells the torque.
    NoTorque,
    /// Only the commanded torque is known.
    CommandOnly,
    /// One encoder.
    OneEncoder,
    /// Nothing tells what the joint was asked to do.
    NoReference,
    /// The robot file does not know the joint.
    UnknownJoint,
    /// The recording does not have the joint.
    MissingJoint,
    /// Signals of two joints changed places.
    SwappedJoints,
    /// Motor turns per joint turn are not the robot file's.
    WrongGearRatio,
    /// Positive in the other direction.
    ReversedSign,
    /// Degrees, turns, or revolutions per minute.
    WrongUnit,
    /// The value of the other side of the gear.
    WrongSide,
    /// Off by a factor that no unit explains.
    WrongScale,
    /// Beyond the robot file's limit.
    BeyondLimit,
    /// A current where a torque should be.
    CurrentAsTorque,
    /// The encoder's step is not the robot file's.
    OtherResolution,
}

/// Something found in a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// What kind of thing it is.
    pub kind: FindingKind,
    /// The joint, unless it concerns all.
    pub joint: Option<String>,
    /// The signal, unless it concerns all of the joint.
    pub signal: Option<Signal>,
    /// What it is, in one sentence with the number that decided it.
    pub what: String,
    /// That number.
    pub value: Option<f64>,
    /// What to change; empty where there is nothing to change.
    pub remedy: String,
}

/// What the checks need to know of a robot file.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckRobot {
    /// As errors call it.
    pub name: String,
    /// In the order of the chain.
    pub joints: Vec<CheckJoint>,
}

/// One joint of a robot file.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckJoint {
    /// The joint's name.
    pub name: String,
    /// Motor turns per joint turn.
    pub gear_ratio: f64,
    /// Where the joint may go.
    pub position_limit_rad: Option<[f64; 2]>,
    /// How fast the joint may go, either way.
    pub velocity_limit_rad_s: Option<f64>,
    /// Largest torque of the drive, motor side.
    pub torque_limit_nm: Option<f64>,
    /// Motor torque per ampere.
    pub torque_constant_nm_a: Option<f64>,
    /// Step of the motor encoder, motor side.
    pub motor_encoder_resolution_rad: Option<f64>,
    /// Step of the link encoder, joint side.
    pub link_encoder_resolution_rad: Option<f64>,
    /// Of the gear, where it is known.
    pub stiffness_nm_rad: Option<f64>,
}

impl CheckRobot {
    fn joint(&self, name: &str) -> Option<&CheckJoint> {
        self.joints.iter().find(|joint| joint.name == name)
    }
}

/// Checks a recording, against a robot file if one is given. The worst findings come first.
#[must_use]
pub fn check(recording: &Recording, robot: Option<&CheckRobot>) -> Vec<Finding> {
    let mut findings = timing::check(recording);
    findings.extend(wrapped::check(recording));
    findings.extend(misread::check(recording));
    findings.extend(held::check(recording));
    let recording = &*as_measured(recording);
    if recording.rows() >= timing::ROWS_MIN {
        findings.extend(swap::check(recording));
        findings.extend(unsigned::check(recording));
        let of_robot = |joint: &JointColumns| robot.and_then(|robot| robot.joint(&joint.name));
        let joints = recording.joints.iter();
        let seen = joints.map(|joint| scale::Scales::of(recording, joint, of_robot(joint)));
        let mut seen: Vec<scale::Scales> = seen.collect();
        findings.extend(scale::wrong_time(recording, &mut seen));
        let are_in_degrees =
            robot.is_some_and(|robot| robot::are_in_degrees(robot, recording, &seen));
        for (joint, seen) in recording.joints.iter().zip(&seen) {
            let of_robot = of_robot(joint);
            findings.extend(scale::check(recording, joint, of_robot, seen));
            findings.extend(motion::check(recording, joint, seen));
            if let (Some(robot), Some(of_robot)) = (robot, of_robot) {
                findings.extend(robot::check_joint(
                    robot,
                    of_robot,
                    joint,
                    seen,
                    are_in_degrees,
                ));
            }
        }
    }
    for joint in &recording.joints {
        findings.extend(support::check(joint));
    }
    if let Some(robot) = robot {
        robot::one_limit(robot, &mut findings);
        findings.extend(robot::check_names(robot, recording));
    }
    findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    findings
}

impl Finding {
    /// Whether it is about where a joint is, as one of its encoders shows it: what the other joints carry depends on that.
    #[must_use]
    pub fn is_of_position(&self) -> bool {
        let positions = [Signal::MotorPositionRad, Signal::LinkPositionRad];
        self.signal
            .is_some_and(|signal| positions.contains(&signal))
    }

    /// What it is and what to change, without where it is.
    #[must_use]
    pub fn told(&self) -> String {
        match self.remedy.as_str() {
            "" => self.what.clone(),
            remedy => format!("{}; {remedy}", self.what),
        }
    }

    fn new(severity: Severity, kind: FindingKind, what: String) -> Self {
        Self {
            severity,
            kind,
            joint: None,
            signal: None,
            what,
            value: None,
            remedy: String::new(),
        }
    }

    fn error(kind: FindingKind, what: String) -> Self {
        Self::new(Severity::Error, kind, what)
    }

    pub(crate) fn warning(kind: FindingKind, what: String) -> Self {
        Self::new(Severity::Warning, kind, what)
    }

    fn note(kind: FindingKind, what: String) -> Self {
        Self::new(Severity::Note, kind, what)
    }

    pub(crate) fn at(self, joint: &JointColumns) -> Self {
        Self {
            joint: Some(joint.name.clone()),
            ..self
        }
    }

    pub(crate) fn of(self, signal: Signal) -> Self {
        Self {
            signal: Some(signal),
            ..self
        }
    }

    pub(crate) fn decided_by(self, value: f64) -> Self {
        Self {
            value: Some(value),
            ..self
        }
    }

    fn remedy(self, remedy: impl Into<String>) -> Self {
        Self {
            remedy: remedy.into(),
            ..self
        }
    }
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.joint, &self.signal) {
            (Some(joint), Some(signal)) => write!(f, "{joint}.{signal}: ")?,
            (Some(joint), None) => write!(f, "{joint}: ")?,
            _ => {}
        }
        f.write_str(&self.told())
    }
}

/// The mapping's line that a finding wants changed.
fn mapping_line(joint: &JointColumns, signal: Signal, change: &str) -> String {
    format!(
        "in the mapping file, [joint.{}], {signal}: {change}",
        joint.name
    )
}

/// One signal's values, if it has any.
fn values(joint: &JointColumns, signal: Signal) -> Option<&[f64]> {
    joint.signals.get(&signal).map(Vec::as_slice)
}

/// What tells where the joint is, the measured ones first.
const POSITIONS: [Signal; 3] = [
    Signal::LinkPositionRad,
    Signal::MotorPositionRad,
    Signal::ReferencePositionRad,
];

/// The position to take for the joint's motion: that of the motor, whose encoder is the finer one, or the link's.
fn measured_position(joint: &JointColumns) -> Option<(Signal, &[f64])> {
    [Signal::MotorPositionRad, Signal::LinkPositionRad]
        .into_iter()
        .filter_map(|signal| Some((signal, values(joint, signal)?)))
        .find(|(_, values)| span(values) > 0.0)
}
