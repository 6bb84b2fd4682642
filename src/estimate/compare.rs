//! `flexspline estimate compare`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use estimators::compare::{Judge, Score};
use estimators::{JointEstimators, JointLog, Kind};
use recording::{Recording, Signal};
use robot::{Robot, RobotJoint};
use serde::Serialize;

use super::{chosen_joints, page, read, table};
use crate::cli::CompareArguments;
use crate::error::CliError;
use crate::output::{print, write_json, write_text};

/// All recordings, for programs and pages.
#[derive(Debug, Serialize)]
pub struct Compared {
    /// Of this layout.
    pub schema: u32,
    /// The robot's name.
    pub robot: String,
    /// One for each recording and joint.
    pub joints: Vec<JointCompared>,
}

/// One joint on one recording.
#[derive(Debug, Serialize)]
pub struct JointCompared {
    /// Where it comes from.
    pub recording: PathBuf,
    /// The joint.
    pub joint: String,
    /// Rows in which it moved.
    pub dynamic_rows: usize,
    /// Rows in which it stood.
    pub static_rows: usize,
    /// Estimator by estimator.
    pub estimators: Vec<Measured>,
    /// Those that the robot file has no parameters for.
    pub not_calibrated: Vec<Kind>,
    /// What the page draws.
    #[serde(skip)]
    pub traces: Traces,
}

/// One estimator's score and cost.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Against the sensor.
    #[serde(flatten)]
    pub score: Score,
    /// Of one sample of one joint, the recording's mean on this machine.
    pub cost_ns: f64,
}

/// Torques over time.
#[derive(Debug, Default)]
pub struct Traces {
    /// Of the recording.
    pub time_s: Vec<f64>,
    /// The sensor.
    pub reference_nm: Vec<f64>,
    /// Each estimator's torque; NaN where it gave none.
    pub torques_nm: Vec<(Kind, Vec<f64>)>,
    /// The fused estimator's standard deviation; NaN where it gave none.
    pub fusion_std_nm: Vec<f64>,
}

/// Reads, runs, prints and writes.
///
/// # Errors
/// [`CliError::Input`] for bad input.
pub fn compare(arguments: &CompareArguments) -> Result<(), CliError> {
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    robot.check_fits_loop().map_err(CliError::input)?;
    let mut joints = Vec::new();
    for path in &arguments.recording {
        let recording = read(path)?;
        let place =
            |error: &dyn std::fmt::Display| CliError::Input(format!("{}: {error}", path.display()));
        let chosen = chosen_joints(&robot, &recording, &arguments.joint, Signal::JointTorqueNm)
            .map_err(|error| place(&error))?;
        for joint in chosen {
            joints.push(one(path, &recording, &robot, joint).map_err(|error| place(&error))?);
        }
    }
    let compared = Compared {
        schema: 1,
        robot: robot.name.clone(),
        joints,
    };
    if let Some(path) = &arguments.json {
        write_json(&compared, path)?;
    }
    if let Some(path) = &arguments.report {
        write_text(path, &page::page(&compared).to_html())?;
    }
    if arguments.json.as_deref() != Some(Path::new("-")) {
        let scores: String = compared.joints.iter().map(table::scores).collect();
        print(&scores)?;
        if let Some(path) = &arguments.report {
            print(&format!("report: {}\n", path.display()))?;
        }
    }
    Ok(())
}

/// All estimators the joint has, on one recording.
pub fn one(
    path: &Path,
    recording: &Recording,
    robot: &Robot,
    joint: &RobotJoint,
) -> Result<JointCompared, String> {
    let judge = Judge::new(recording, robot, joint).map_err(|error| error.to_string())?;
    let mut estimators =
        JointEstimators::new(joint, judge.log.period_s).map_err(|error| error.to_string())?;
    let (mut measured, mut not_calibrated) = (Vec::new(), Vec::new());
    let mut traces = Traces {
        time_s: judge.log.time_s.clone(),
        reference_nm: judge.log.joint_torque_nm.clone(),
        ..Traces::default()
    };
    for kind in Kind::ALL {
        let Some(estimator) = estimators.get(kind) else {
            not_calibrated.push(kind);
            continue;
        };
        let begun = Instant::now();
        let answers = judge.run(estimator);
        let cost_ns = begun.elapsed().as_nanos() as f64 / judge.log.rows().max(1) as f64;
        let score = judge.score(kind, &answers);
        if score.missing.is_none() {
            let torque = |answer: &Result<estimators::Estimate, _>| {
                answer.as_ref().map_or(f64::NAN, |found| found.torque_nm)
            };
            traces
                .torques_nm
                .push((kind, answers.iter().map(torque).collect()));
        }
        if kind == Kind::Fusion {
            let std = answers.iter().map(|answer| {
                let found = answer.as_ref().ok().and_then(|found| found.std_nm);
                found.unwrap_or(f64::NAN)
            });
            traces.fusion_std_nm = std.collect();
        }
        measured.push(Measured { score, cost_ns });
    }
    let standing = judge.phases.stands.iter().filter(|stands| **stands).count();
    Ok(JointCompared {
        recording: path.to_owned(),
        joint: joint.name.clone(),
        dynamic_rows: JointLog::rows(&judge.log) - standing,
        static_rows: standing,
        estimators: measured,
        not_calibrated,
        traces,
    })
}
