//! What every diagnosis begins with, whatever its twin: the samples looked at, the recordings mended, an empty report.

use gap_report::{
    Candidate, DataFinding, Gap, JointReport, Remaining, Report, SCHEMA, TwinKind, Verdict, Where,
};
use joint_model::filter::FilterError;
use joint_twin::TwinError;
use joint_twin::control;
use joint_twin::on_all_cores::OnAllCores;
use joint_twin::stretch::StretchError;
use recording::Recording;
use recording_checks::found::Found;
use recording_checks::mend;
use recording_checks::samples;
use recording_checks::timing::Timing;
use robot::Robot;

/// Why a diagnosis cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// The recordings cannot be cut into stretches.
    #[error(transparent)]
    Stretch(#[from] StretchError),
    /// The twin cannot be run.
    #[error(transparent)]
    Twin(#[from] TwinError),
    /// Nothing was given.
    #[error("no recording was given")]
    Nothing,
}

impl From<FilterError> for DiagnoseError {
    fn from(error: FilterError) -> Self {
        Self::Twin(error.into())
    }
}

/// How far a diagnosis is.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Joints that are done.
    pub done: usize,
    /// Joints in all.
    pub of: usize,
}

/// Torque of one joint over time: disturbance torque measured, by the robot file, and by the file with the effects.
#[derive(Clone, Debug, PartialEq)]
pub struct JointTraces {
    /// Name.
    pub joint: String,
    /// Since the recording began, of its first stretch.
    pub time_s: Vec<f64>,
    /// From the recording.
    pub measured_nm: Vec<f64>,
    /// From the twin as the robot file has it.
    pub nominal_nm: Vec<f64>,
    /// From the twin with the effects.
    pub augmented_nm: Vec<f64>,
    /// Joint angle in the same rows; empty where they are not told.
    pub position_rad: Vec<f64>,
    /// Its rate.
    pub velocity_rad_s: Vec<f64>,
}

/// A report with what its pictures need.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The report.
    pub report: Report,
    /// In the robot file's order, of joints that could be diagnosed.
    pub traces: Vec<JointTraces>,
}

/// Data and robot file with what the samples show taken out.
pub(crate) struct Prepared {
    pub robot: Robot,
    /// Of each joint.
    pub counted: Vec<Vec<Found>>,
    /// What a reader of the report should know.
    pub findings: Vec<DataFinding>,
    mended: Option<Vec<Recording>>,
}

impl Prepared {
    /// Mended recordings, or the ones given where nothing had to be mended.
    pub fn tables<'a>(&'a self, given: &[&'a Recording]) -> Vec<&'a Recording> {
        match &self.mended {
            Some(mended) => mended.iter().collect(),
            None => given.to_vec(),
        }
    }
}

/// Looks at the samples of the joints that can be diagnosed.
pub(crate) fn prepared(
    robot: &Robot,
    tables: &[&Recording],
    looks_at: impl Fn(usize) -> bool + Sync,
) -> Prepared {
    let timing = Timing::of(robot, tables);
    let counted: Vec<Vec<Found>> = robot
        .joints
        .iter()
        .enumerate()
        .on_all_cores(|(index, joint)| {
            if looks_at(index) {
                samples::find(tables, index, joint, &timing)
            } else {
                Vec::new()
            }
        })
        .collect();
    Prepared {
        robot: Robot {
            control: timing.control.clone(),
            ..mend::robot(robot, &counted)
        },
        mended: mend::recordings(tables, robot, &counted, &timing),
        counted,
        findings: timing.findings,
    }
}

/// A report that says nothing of any joint yet.
pub(crate) fn blank_report(
    robot: &Robot,
    recordings: &[(String, Recording)],
) -> Result<Report, DiagnoseError> {
    let (_, first) = recordings.first().ok_or(DiagnoseError::Nothing)?;
    Ok(Report {
        schema: SCHEMA,
        robot: robot.name.clone(),
        recordings: recordings.iter().map(|(name, _)| name.clone()).collect(),
        samples: recordings.iter().map(|(_, table)| table.rows()).sum(),
        seconds: recordings.iter().map(|(_, table)| seconds(table)).sum(),
        sample_rate_hz: first.sample_rate_hz,
        twin: if control::is_known(robot) {
            TwinKind::ClosedLoop
        } else {
            TwinKind::FollowsMotion
        },
        compute_seconds: 0.0,
        shared_effects: Vec::new(),
        joints: Vec::new(),
        links: Vec::new(),
        data: Vec::new(),
    })
}

fn seconds(recording: &Recording) -> f64 {
    let ends = recording.time_s.last().zip(recording.time_s.first());
    ends.map_or(0.0, |(last, first)| last - first)
}

pub(crate) fn insufficient(joint: &str, why: String) -> JointReport {
    JointReport {
        joint: joint.to_owned(),
        verdict: Verdict::InsufficientData,
        reason: why,
        effects: Vec::new(),
        minor_effects: Vec::new(),
        candidates: vec![Candidate {
            effect: "unknown".to_owned(),
            probability: 1.0,
        }],
        confusable: Vec::new(),
        place: Where::default(),
        gap: Gap::default(),
        remaining: Remaining::Structured,
        remaining_share: 1.0,
        remaining_over: Vec::new(),
        torque: None,
        plain_friction: None,
    }
}
