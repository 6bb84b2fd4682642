//! What is checked before anything is computed: whether the data are what the robot file says, and what they support.

use gap_report::DataFinding;
use recording::{
    CheckJoint, CheckRobot, Finding, FindingKind, Recording, Severity, as_measured, check,
};
use robot::{Effect, Robot, RobotJoint};

use super::exchanged;
use super::units;

/// What is wrong with a recording as one of this robot, or missing, worst first.
pub fn findings(robot: &Robot, recording: &Recording) -> Vec<Finding> {
    let mut findings = check(recording, Some(&check_robot(robot)));
    // positions or times that are wrong let any joint seem to be another
    let is_wrong = |finding: &Finding| {
        let is_of_motion = finding.is_of_position() || finding.kind == FindingKind::RateOff;
        finding.kind == FindingKind::SwappedJoints
            || finding.severity == Severity::Error && is_of_motion
    };
    if findings.iter().any(is_wrong) {
        return findings;
    }
    let recording = &*as_measured(recording);
    let mut more = units::check(robot, recording);
    // a joint of which something is wrong already is told that
    more.retain(|finding| {
        let mut errors = findings
            .iter()
            .filter(|known| known.severity == Severity::Error);
        finding.joint.is_none() || !errors.any(|known| known.joint == finding.joint)
    });
    if more.is_empty()
        && let Some(finding) = exchanged::check(robot, recording)
    {
        more.push(finding);
    }
    more.append(&mut findings);
    more
}

/// What is wrong with recordings as ones of this robot. How a joint moves is judged by all that have it: it may stand in one of them.
pub fn findings_of_all(robot: &Robot, recordings: &[&Recording]) -> Vec<Finding> {
    let each: Vec<Vec<Finding>> = recordings
        .iter()
        .map(|recording| findings(robot, recording))
        .collect();
    let is_everywhere = |finding: &Finding| {
        let Some(joint) = finding
            .joint
            .as_deref()
            .filter(|_| is_of_motion(finding.kind))
        else {
            return true;
        };
        let same =
            |other: &Finding| other.kind == finding.kind && other.joint.as_deref() == Some(joint);
        let mut there = recordings.iter().zip(&each);
        there.all(|(recording, found)| recording.joint(joint).is_err() || found.iter().any(same))
    };
    let mut all: Vec<Finding> = Vec::new();
    for finding in each.iter().flatten() {
        if is_everywhere(finding) && !all.contains(finding) {
            all.push(finding.clone());
        }
    }
    all
}

/// Whether it says how a joint moves.
fn is_of_motion(kind: FindingKind) -> bool {
    matches!(
        kind,
        FindingKind::NoMotion
            | FindingKind::OneSpeed
            | FindingKind::OneDirection
            | FindingKind::OneFrequency
    )
}

/// What the checks need to know of a robot.
fn check_robot(robot: &Robot) -> CheckRobot {
    CheckRobot {
        name: robot.name.clone(),
        joints: robot.joints.iter().map(check_joint).collect(),
    }
}

fn check_joint(joint: &RobotJoint) -> CheckJoint {
    CheckJoint {
        name: joint.name.clone(),
        gear_ratio: joint.gear_ratio,
        position_limit_rad: joint.position_limit_rad,
        velocity_limit_rad_s: joint.velocity_limit_rad_s,
        torque_limit_nm: joint.torque_limit_nm,
        torque_constant_nm_a: joint.torque_constant_nm_a,
        motor_encoder_resolution_rad: joint.motor_encoder_resolution_rad,
        link_encoder_resolution_rad: joint.link_encoder_resolution_rad,
        stiffness_nm_rad: joint.effects.iter().find_map(|effect| match effect {
            Effect::TorsionalCompliance { stiffness_nm_rad } => Some(*stiffness_nm_rad),
            _ => None,
        }),
    }
}

/// Of the motion of a joint, in words.
pub const ONE_FREQUENCY: &str = "one frequency only";

/// What was found in all recordings.
pub struct Checked {
    findings: Vec<Finding>,
}

impl Checked {
    /// By a robot's file, the worst first.
    pub fn of(robot: &Robot, recordings: &[&Recording]) -> Self {
        let mut all = findings_of_all(robot, recordings);
        all.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
        Self { findings: all }
    }

    /// Why nothing can be said about a joint, if so.
    pub fn against(&self, joint: &str) -> Option<String> {
        let is_on = |finding: &&Finding| {
            finding.joint.as_deref().is_none_or(|name| name == joint)
                && (finding.severity == Severity::Error
                    || (finding.kind == FindingKind::NoMotion && finding.joint.is_some()))
        };
        if let Some(finding) = self.findings.iter().find(is_on) {
            return Some(finding.told());
        }
        let is_wrong_position =
            |finding: &&Finding| finding.severity == Severity::Error && finding.is_of_position();
        let elsewhere = self.findings.iter().find(is_wrong_position)?;
        Some(format!(
            "what it carries depends on where the other joints are: {elsewhere}"
        ))
    }

    /// Whether the joint moves at one speed only, in one direction, or at one frequency.
    pub fn poverty(&self, joint: &str) -> Option<&'static str> {
        self.findings.iter().find_map(|finding| {
            if finding.joint.as_deref() != Some(joint) {
                return None;
            }
            match finding.kind {
                FindingKind::OneSpeed => Some("one speed only"),
                FindingKind::OneDirection => Some("one direction only"),
                FindingKind::OneFrequency => Some(ONE_FREQUENCY),
                _ => None,
            }
        })
    }

    /// As a report says it.
    pub fn report(&self) -> Vec<DataFinding> {
        self.findings
            .iter()
            .map(|finding| DataFinding {
                joint: finding.joint.clone(),
                severity: match finding.severity {
                    Severity::Note => "note",
                    Severity::Warning => "warning",
                    Severity::Error => "error",
                }
                .to_owned(),
                what: finding.what.clone(),
                remedy: finding.remedy.clone(),
            })
            .collect()
    }
}
