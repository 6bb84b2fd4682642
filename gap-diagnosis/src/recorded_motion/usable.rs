//! What of the recordings can be used: a bad column is left out where others suffice, a bad joint is told, and only where nothing can
//! be told of any joint the diagnosis has nothing to say.

use gap_report::DataFinding;
use gap_report::TorqueSource;
use recording::{Finding, FindingKind, JointColumns, Recording, Severity, Signal};
use recording_checks::data;
use robot::Robot;

use super::motion::Read;
use super::signals;

/// What may tell a torque.
const TORQUES: [Signal; 3] = [
    Signal::MotorTorqueNm,
    Signal::CommandTorqueNm,
    Signal::JointTorqueNm,
];

/// What is read of each joint, or why not.
pub struct Usable {
    /// In the robot file's order.
    pub read: Vec<Read>,
    /// Why nothing is said of a joint, where that is so.
    pub against: Vec<Option<String>>,
    /// What a reader of the report should know.
    pub findings: Vec<DataFinding>,
    /// Torques whose sign is in doubt, for who looks at them along the motion.
    doubted: Vec<Finding>,
}

impl Usable {
    /// Of recordings of a robot.
    pub fn of(robot: &Robot, recordings: &[&Recording]) -> Self {
        let found = data::findings_of_all(robot, recordings);
        let mut usable = Self {
            read: Vec::new(),
            against: Vec::new(),
            findings: Vec::new(),
            doubted: Vec::new(),
        };
        for joint in &robot.joints {
            usable.add(robot, &joint.name, recordings, &found);
        }
        usable.without_places(robot, &found);
        let used = |finding: &Finding| usable.uses(robot, finding);
        let is_doubt = |finding: &&Finding| is_of_sign(finding) && used(finding);
        let doubted: Vec<Finding> = found.iter().filter(is_doubt).cloned().collect();
        let decided = found
            .iter()
            .filter(|finding| !is_doubt(finding))
            .filter(|finding| !usable.is_made_up_for(robot, finding));
        let told = decided.map(|finding| reported(finding, used(finding)));
        let told: Vec<DataFinding> = told.collect();
        usable.findings.extend(told);
        usable.doubted = doubted;
        usable
    }

    /// What is told of a joint's torque where masses and friction do not tell its sign.
    pub fn doubts(&self, joint: &str) -> impl Iterator<Item = DataFinding> {
        let of_joint = |finding: &&Finding| finding.joint.as_deref() == Some(joint);
        self.doubted
            .iter()
            .filter(of_joint)
            .map(|finding| DataFinding {
                joint: finding.joint.clone(),
                severity: "warning".to_owned(),
                what: format!(
                    "{} may be {}",
                    finding.signal.map_or("", Signal::name),
                    finding.what
                ),
                remedy: format!("if it is, {}", finding.remedy),
            })
    }

    /// Whether it misses a torque that the controller tells.
    fn is_made_up_for(&self, robot: &Robot, finding: &Finding) -> bool {
        let joint = finding.joint.as_deref().and_then(|j| robot.joint_index(j));
        let torque = joint.and_then(|joint| self.read[joint].torque);
        finding.kind == FindingKind::NoTorque && torque == Some(TorqueSource::Controller)
    }

    /// Whether a column that a finding is about is used.
    fn uses(&self, robot: &Robot, finding: &Finding) -> bool {
        let (Some(joint), Some(signal)) = (&finding.joint, finding.signal) else {
            return true;
        };
        let Some(index) = robot.joint_index(joint) else {
            return true;
        };
        if self.against[index].is_some() {
            return true;
        }
        let read = self.read[index];
        let torque = read.torque.map(signals::of_torque);
        read.position == Some(signal) || torque == Some(signal)
    }

    fn add(&mut self, robot: &Robot, joint: &str, recordings: &[&Recording], found: &[Finding]) {
        let columns: Vec<&JointColumns> = recordings
            .iter()
            .filter_map(|recording| recording.joint(joint).ok())
            .collect();
        let of_joint: Vec<&Finding> = found
            .iter()
            .filter(|finding| finding.joint.as_deref().is_none_or(|name| name == joint))
            .collect();
        let has_drive = columns
            .iter()
            .any(|columns| columns.measured(Signal::MotorTorqueNm).is_some());
        let is_bad = |signal: Signal| {
            of_joint.iter().any(|finding| {
                let is_error = finding.severity == Severity::Error;
                let is_command = has_drive && signal == Signal::CommandTorqueNm;
                is_error && finding.signal == Some(signal) && (is_command || !is_of_sign(finding))
            })
        };
        let whole = columns.len() == recordings.len();
        let columns: &[&JointColumns] = if whole { &columns } else { &[] };
        let nothing = columns.is_empty();
        let position = (!nothing)
            .then(|| signals::position(columns, is_bad, signals::controller(robot)))
            .flatten();
        let torques = if nothing {
            Vec::new()
        } else {
            signals::torques(robot, columns, is_bad)
        };
        let torque = torques.first().copied();
        let against = if nothing {
            Some("no recording has the joint".to_owned())
        } else {
            let decides = |finding: &&&Finding| match finding.severity {
                Severity::Error => match finding.signal {
                    Some(signal) if finding.is_of_position() => {
                        position.is_none() || position == Some(signal)
                    }
                    Some(signal) => {
                        torque.is_none() && TORQUES.contains(&signal) && !is_of_sign(finding)
                    }
                    None => !is_bridged(finding),
                },
                _ => finding.kind == FindingKind::NoMotion && finding.joint.is_some(),
            };
            let decided = of_joint.iter().find(decides).map(|finding| {
                let signal = finding.signal.map(|of| format!("{of}: "));
                format!("{}{}", signal.unwrap_or_default(), finding.told())
            });
            decided.or_else(|| {
                torque.is_none().then(|| {
                    let mut columns = columns.iter();
                    let has_current =
                        columns.any(|of| of.measured(Signal::MotorCurrentA).is_some());
                    let of_current = if has_current {
                        "; a current does once the mapping file has its column as motor_torque_nm too, with the torque constant as scale"
                    } else {
                        ""
                    };
                    format!(
                        "nothing tells its torque: no motor_torque_nm, joint_torque_nm or command_torque_nm, and the robot file's \
                         [control] does not tell how reference and position make one{of_current}"
                    )
                })
            })
        };
        self.read.push(Read {
            position,
            torque: torque.filter(|_| against.is_none()),
            has_sensor_beside: torque == Some(TorqueSource::Drive)
                && torques.contains(&TorqueSource::Sensor),
        });
        self.against.push(against);
    }

    /// What a joint carries depends on where the others are.
    fn without_places(&mut self, robot: &Robot, found: &[Finding]) {
        let wrong = found.iter().find(|finding| {
            let index = finding.joint.as_deref().and_then(|j| robot.joint_index(j));
            finding.severity == Severity::Error
                && finding.is_of_position()
                && index.is_some_and(|index| self.against[index].is_some())
        });
        let Some(wrong) = wrong else {
            return;
        };
        for against in &mut self.against {
            against.get_or_insert_with(|| {
                format!("what it carries depends on where the other joints are: {wrong}")
            });
        }
    }
}

/// Whether it doubts a torque's sign: the masses of the robot file tell that better.
fn is_of_sign(finding: &Finding) -> bool {
    let is_torque = |signal| TORQUES.contains(&signal);
    finding.kind == FindingKind::ReversedSign && finding.signal.is_some_and(is_torque)
}

/// Rows that are missing are bridged, or end a piece where many are.
fn is_bridged(finding: &Finding) -> bool {
    matches!(
        finding.kind,
        FindingKind::Gaps | FindingKind::Jitter | FindingKind::RepeatedTimes
    )
}

fn reported(finding: &Finding, is_used: bool) -> DataFinding {
    let error = finding.severity == Severity::Error;
    let left_out = error && !is_used;
    let severity = match finding.severity {
        Severity::Error if left_out || is_bridged(finding) => "warning",
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Note => "note",
    };
    let signal = finding.signal.map_or("", Signal::name);
    let what = if left_out {
        format!("{signal} is left out: {}", finding.what)
    } else {
        finding.what.clone()
    };
    DataFinding {
        joint: finding.joint.clone(),
        severity: severity.to_owned(),
        what,
        remedy: finding.remedy.clone(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use made_up::swinging;

    use super::*;

    #[test]
    fn a_time_that_is_wrong_is_against_every_joint() {
        let robot = robot::load("pa10").unwrap();
        let mut recording = swinging(&robot, None);
        let rate_hz = recording.sample_rate_hz;
        for joint in &mut recording.joints {
            let position = &joint.signals[&Signal::MotorPositionRad];
            let last = position.len() - 1;
            let velocity = (0..=last).map(|row| {
                let (from, to) = (row.saturating_sub(1), (row + 1).min(last));
                (position[to] - position[from]) * rate_hz / (to - from) as f64
            });
            let velocity = velocity.collect();
            joint.signals.insert(Signal::MotorVelocityRadS, velocity);
        }
        let against = |recording: &Recording| Usable::of(&robot, &[recording]).against;
        assert!(against(&recording).iter().all(Option::is_none));
        recording.sample_rate_hz /= 3.0;
        recording
            .time_s
            .iter_mut()
            .for_each(|time_s| *time_s *= 3.0);
        for against in against(&recording) {
            let against = against.unwrap();
            assert!(against.contains("the time is wrong"), "{against}");
        }
    }
}
