//! What is checked before anything is computed: whether the data are what the robot file says, and what they support.

use recording::{CheckJoint, CheckRobot, Finding, FindingKind, Recording, Severity, check};
use robot::{Robot, RobotJoint};

use crate::report::DataFinding;

/// What the checks need to know of a robot.
pub fn check_robot(robot: &Robot) -> CheckRobot {
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
    }
}

/// What was found in all recordings.
pub(crate) struct Checked {
    findings: Vec<Finding>,
}

impl Checked {
    pub fn of(robot: &Robot, recordings: &[&Recording]) -> Self {
        let known = check_robot(robot);
        let mut findings: Vec<Finding> = Vec::new();
        for recording in recordings {
            for finding in check(recording, Some(&known)) {
                if !findings.contains(&finding) {
                    findings.push(finding);
                }
            }
        }
        findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
        Self { findings }
    }

    /// Why nothing can be said about a joint, if so.
    pub fn against(&self, joint: &str) -> Option<String> {
        let concerns = |finding: &&Finding| {
            finding.joint.as_deref().is_none_or(|name| name == joint)
                && (finding.severity == Severity::Error
                    || (finding.kind == FindingKind::NoMotion && finding.joint.is_some()))
        };
        let finding = self.findings.iter().find(concerns)?;
        Some(if finding.remedy.is_empty() {
            finding.what.clone()
        } else {
            format!("{}; {}", finding.what, finding.remedy)
        })
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
                FindingKind::OneFrequency => Some("one frequency only"),
                _ => None,
            }
        })
    }

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
