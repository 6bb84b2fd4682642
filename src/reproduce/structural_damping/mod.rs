//! `flexspline reproduce structural-damping`: the torque paper's experiment on the emulated SHD-17 joint.
//!
//! As in SD, section IV: one data set to find the parameters (Figs. 7 and 8), another to judge (Figs. 9 and 10), of the same
//! joint. Both are recorded in virtual time; calibration and comparison see the recordings and the robot file only.

mod claims;
mod motions;

use std::fs;
use std::path::{Path, PathBuf};

use estimators::calibrate::{Reference, calibrate};
use recording::Recording;
use robot::{Robot, RobotFile};
use serde::Serialize;
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use twin::Robots;

use crate::cli::ReproduceArguments;
use crate::error::CliError;
use crate::estimate::compare::{Compared, one};
use crate::estimate::{page, table};
use crate::output::{cannot_write, print, write_json, write_text};
use crate::run::PERIOD_NS;
use claims::Statement;
use motions::Motion;

/// The joint of the paper.
const ROBOT: &str = "shd17";

/// Everything found, for programs.
#[derive(Serialize)]
struct Reproduction {
    schema: u32,
    paper: &'static str,
    seed: u64,
    robot_file: PathBuf,
    comparison: Compared,
    statements: Vec<Statement>,
}

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
    fs::create_dir_all(&out).map_err(|error| cannot_write(&out, &error))?;
    let (mut file, source) = robot::load_file(ROBOT).map_err(CliError::input)?;
    let robot = robot::load(ROBOT).map_err(CliError::input)?;
    let [first, second] = [&motions::CALIBRATION, &motions::JUDGEMENT]
        .map(|motion| recorded(motion, &robot, &out, arguments.seed));
    let joint = &robot.joints[0];
    let found =
        calibrate(&first?.1, &robot, joint, Reference::JointTorque).map_err(CliError::input)?;
    print(&table::fits(&found))?;
    file.joints[0].estimators = Some(found.parameters);
    let robot_file = out.join("calibrated.toml");
    write_text(&robot_file, &text(&file)?)?;
    let calibrated = file.build(source).map_err(CliError::input)?;
    let (path, recording) = second?;
    let judged =
        one(&path, &recording, &calibrated, &calibrated.joints[0]).map_err(CliError::Input)?;
    let statements = claims::judge(&judged);
    let scores = table::scores(&judged) + &claims::text(&statements);
    print(&scores)?;
    let reproduction = Reproduction {
        schema: 1,
        paper,
        seed: arguments.seed,
        robot_file,
        comparison: Compared {
            schema: 1,
            robot: ROBOT.to_owned(),
            joints: vec![judged],
        },
        statements,
    };
    let html =
        page::page(&reproduction.comparison).section(claims::section(&reproduction.statements));
    let page_path = out.join("report.html");
    write_text(&page_path, &html.to_html())?;
    write_json(&reproduction, &out.join("reproduce.json"))?;
    print(&format!("report: {}\n", page_path.display()))
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
    let waypoints = out.join(format!("{}.csv", motion.name));
    write_text(&waypoints, &motion.waypoints(&robot.joints[0].name))?;
    let name = waypoints.display().to_string();
    let trajectory = motion::load(&name, robot).map_err(CliError::input)?;
    let path = out.join(format!("{}.mcap", motion.name));
    let run = RunConfig {
        session: 1,
        robot: ROBOT.to_owned(),
        driver: "emulator".to_owned(),
        trajectory: name,
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        mode: Mode::Lockstep,
        period_ns: PERIOD_NS,
        cycles: (motion.duration_s * 1e9 / PERIOD_NS as f64) as u64,
        wait: Wait::Block,
        seed,
        inject: None,
        record: Some(path.clone()),
        command_deadline_ns: PERIOD_NS,
        cores: Vec::new(),
        initial_position_rad: vec![0.0],
    };
    twin::record(&run, Robots::same(robot), trajectory, &[], |_| true)
        .map_err(|error| CliError::Negative(format!("data set {}: {error}", motion.name)))?;
    let recording = recording::read(&path).map_err(CliError::input)?;
    Ok((path, recording))
}
