//! `flexspline reproduce structural-damping`: the torque paper's experiment on the emulated SHD-17 joint.
//!
//! As in SD, section IV: one data set to find the parameters (Figs. 7 and 8), another to judge (Figs. 9 and 10), of the same
//! joint. Both are recorded in virtual time; calibration and comparison see the recordings and the robot file only. Then the
//! same joint is pushed, and left alone, with what was calibrated: [`collisions`].

mod claims;
mod collisions;
mod motions;

use std::fs;
use std::path::{Path, PathBuf};

use estimators::calibrate::{Reference, calibrate};
use motion::Trajectory;
use recording::Recording;
use robot::{Robot, RobotFile};
use serde::Serialize;
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use twin::Robots;

use crate::cli::{Paper, ReproduceArguments};
use crate::error::CliError;
use crate::estimate::compare::{Compared, one};
use crate::estimate::{page, table};
use crate::output::{cannot_write, print, write_json, write_text};
use crate::run::PERIOD_NS;
use claims::Statement;
use collisions::{Collisions, Stage};
use motions::Motion;

/// With the figures, in the folder.
const PAGE_FILE: &str = "report.html";
/// The joint of the paper.
const ROBOT: &str = "shd17";

/// Everything found, for programs.
#[derive(Serialize)]
struct Reproduction {
    schema: u32,
    paper: &'static str,
    seed: u64,
    robot_file: PathBuf,
    #[serde(skip)]
    fits: String,
    comparison: Compared,
    statements: Vec<Statement>,
    collisions: Collisions,
}

/// What is moved: to calibrate, to judge, and to count false alarms.
struct Motions {
    calibration: Motion,
    judgement: Motion,
    alone: Motion,
}

/// As long as the results are documented for.
const MOTIONS: Motions = Motions {
    calibration: motions::CALIBRATION,
    judgement: motions::JUDGEMENT,
    alone: motions::ROUTINE,
};

/// Records, calibrates, compares, judges, prints and writes.
///
/// # Errors
/// [`CliError::Input`] for a folder that cannot be written, [`CliError::Negative`] if the loop stopped.
pub fn reproduce(arguments: &ReproduceArguments) -> Result<(), CliError> {
    let paper = arguments.paper.name();
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => Path::new("reproduce").join(paper),
    };
    let found = experiment(&MOTIONS, &out, arguments.seed)?;
    if let Some(path) = &arguments.json {
        write_json(&found, path)?;
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    let [judged] = &found.comparison.joints[..] else {
        return Ok(());
    };
    let scores = table::scores(judged) + &claims::text(&found.statements);
    print(&(found.fits + &scores + &collisions::text(&found.collisions)))?;
    print(&format!("report: {}\n", out.join(PAGE_FILE).display()))
}

/// Everything, into a folder.
fn experiment(motions: &Motions, out: &Path, seed: u64) -> Result<Reproduction, CliError> {
    fs::create_dir_all(out).map_err(|error| cannot_write(out, &error))?;
    let (mut file, source) = robot::load_file(ROBOT).map_err(CliError::input)?;
    let robot = robot::load(ROBOT).map_err(CliError::input)?;
    let (_, first) = recorded(&motions.calibration, &robot, out, seed)?;
    let (path, second) = recorded(&motions.judgement, &robot, out, seed)?;
    let joint = &robot.joints[0];
    let found =
        calibrate(&first, &robot, joint, Reference::JointTorque).map_err(CliError::input)?;
    let fits = table::fits(&found);
    file.joints[0].estimators = Some(found.parameters);
    let robot_file = out.join("calibrated.toml");
    write_text(&robot_file, &text(&file)?)?;
    let calibrated = file.build(source).map_err(CliError::input)?;
    let judged =
        one(&path, &second, &calibrated, &calibrated.joints[0]).map_err(CliError::Input)?;
    let stage = Stage {
        plant: &robot,
        model: &calibrated,
        out,
        seed,
    };
    let pushed = [&motions.calibration, &motions.judgement];
    let collisions = stage.collide(&pushed, &motions.alone)?;
    let reproduction = Reproduction {
        schema: 2,
        paper: Paper::StructuralDamping.name(),
        seed,
        robot_file,
        fits,
        statements: claims::judge(&judged),
        comparison: Compared {
            schema: 1,
            robot: ROBOT.to_owned(),
            joints: vec![judged],
        },
        collisions,
    };
    let html = page::page(&reproduction.comparison)
        .section(claims::section(&reproduction.statements))
        .section(collisions::section(&reproduction.collisions));
    write_text(&out.join(PAGE_FILE), &html.to_html())?;
    write_json(&reproduction, &out.join("reproduce.json"))?;
    Ok(reproduction)
}

fn text(file: &RobotFile) -> Result<String, CliError> {
    toml::to_string(file).map_err(CliError::input)
}

/// Runs a motion on the emulated joint and reads its recording.
fn recorded(
    motion: &Motion,
    robot: &Robot,
    out: &Path,
    seed: u64,
) -> Result<(PathBuf, Recording), CliError> {
    let trajectory = trajectory(motion, robot, out)?;
    let path = out.join(format!("{}.mcap", motion.name));
    let run = RunConfig {
        record: Some(path.clone()),
        ..run_config(motion, seed)
    };
    twin::record(&run, Robots::same(robot), trajectory, &[], |_| true)
        .map_err(|error| CliError::Negative(format!("data set {}: {error}", motion.name)))?;
    let recording = recording::read(&path).map_err(CliError::input)?;
    Ok((path, recording))
}

/// A motion's waypoints, written into the folder and read from there.
fn trajectory(motion: &Motion, robot: &Robot, out: &Path) -> Result<Trajectory, CliError> {
    let waypoints = out.join(format!("{}.csv", motion.name));
    write_text(&waypoints, &motion.waypoints(&robot.joints[0].name))?;
    motion::load(&waypoints.display().to_string(), robot).map_err(CliError::input)
}

/// A run in virtual time that is not recorded.
fn run_config(motion: &Motion, seed: u64) -> RunConfig {
    RunConfig {
        session: 1,
        robot: ROBOT.to_owned(),
        driver: "emulator".to_owned(),
        trajectory: motion.name.to_owned(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        estimators: Vec::new(),
        mode: Mode::Lockstep,
        period_ns: PERIOD_NS,
        cycles: (motion.duration_s * 1e9 / PERIOD_NS as f64) as u64,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed,
        inject: None,
        record: None,
        command_deadline_ns: PERIOD_NS,
        cores: Vec::new(),
        initial_position_rad: vec![0.0],
    }
}

#[cfg(test)]
mod tests {
    use estimators::Kind;

    use super::*;

    #[test]
    fn the_short_form_calibrates_judges_and_finds_pushes() {
        let out = tempfile::tempdir().expect("a folder");
        let short = |motion: Motion, duration_s| Motion {
            duration_s,
            ..motion
        };
        let motions = Motions {
            calibration: short(motions::CALIBRATION, 26.0),
            judgement: short(motions::JUDGEMENT, 20.0),
            alone: short(motions::ROUTINE, 40.0),
        };
        let found = experiment(&motions, out.path(), 4).expect("runs");
        let scores = &found.comparison.joints[0].estimators;
        let rms_nm = |kind| {
            let score = scores.iter().find(|found| found.score.kind == kind);
            score
                .expect("there")
                .score
                .dynamic
                .expect("it moved")
                .rms_nm
        };
        assert!(rms_nm(Kind::Fusion) < rms_nm(Kind::Compliance));
        assert_eq!(found.statements.len(), 10);
        let hardest = found.collisions.detections.last().expect("sizes");
        assert!(hardest.pushes > 1);
        assert_eq!(hardest.found, hardest.pushes, "{hardest:?}");
        assert_eq!(found.collisions.false_alarms.alarms, 0);
        for file in ["calibrated.toml", "report.html", "reproduce.json"] {
            assert!(out.path().join(file).is_file(), "{file}");
        }
    }
}
