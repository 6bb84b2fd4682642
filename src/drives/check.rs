//! `flexspline drives check`: what the drives say, beside what the robot file says.

use std::path::Path;

use comfy_table::{Table, presets};
use robot::{Robot, RobotJoint};
use rt_loop::driver::{Capabilities, JointCapabilities};
use serde::Serialize;
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};

use crate::cli::CheckArguments;
use crate::error::CliError;
use crate::output::{print, write_json};
use crate::run::period_ns;

/// For programs.
#[derive(Serialize)]
struct Checked<'a> {
    schema: u32,
    robot: &'a str,
    bus: &'a str,
    rows: &'a [Row],
}

/// One thing, as both sides have it.
#[derive(Serialize)]
struct Row {
    joint: String,
    what: &'static str,
    robot_file: String,
    drive: String,
}

/// Opens the drives as a run would, and tells.
///
/// # Errors
/// [`CliError::Input`] with what does not fit.
pub fn check(arguments: &CheckArguments) -> Result<(), CliError> {
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    robot.check_fits_loop().map_err(CliError::input)?;
    let run = run_config(arguments, &robot)?;
    let mut driver = super::open(&run, &robot)?;
    let drives = driver.capabilities();
    driver.shutdown();
    let rows = rows(&robot, &drives);
    if let Some(path) = &arguments.json {
        let checked = Checked {
            schema: 1,
            robot: &robot.name,
            bus: &drives.bus,
            rows: &rows,
        };
        write_json(&checked, path)?;
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    let mut table = Table::new();
    table.load_preset(presets::UTF8_HORIZONTAL_ONLY);
    table.set_header(["joint", "", "robot file", "drive"]);
    for row in &rows {
        table.add_row([&row.joint, row.what, &row.robot_file, &row.drive]);
    }
    print(&format!(
        "{}\n{table}\nThe drives fit the robot file.\n",
        drives.bus
    ))
}

fn run_config(arguments: &CheckArguments, robot: &Robot) -> Result<RunConfig, CliError> {
    Ok(RunConfig {
        session: 0,
        robot: arguments.robot.clone(),
        driver: arguments.driver.clone(),
        trajectory: String::new(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        estimators: Vec::new(),
        mode: Mode::Realtime,
        period_ns: period_ns(arguments.rate, robot)?,
        cycles: 0,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 0,
        inject: None,
        record: None,
        command_deadline_ns: 0,
        cores: Vec::new(),
        initial_position_rad: Vec::new(),
    })
}

fn rows(robot: &Robot, drives: &Capabilities) -> Vec<Row> {
    let pairs = robot.joints.iter().zip(&drives.joints);
    pairs
        .flat_map(|(joint, drive)| of_joint(joint, drive))
        .collect()
}

fn of_joint(joint: &RobotJoint, drive: &JointCapabilities) -> Vec<Row> {
    let number = |value: Option<f64>, unit: &str| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.4} {unit}"))
    };
    let step = |value: Option<f64>| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3e} rad"))
    };
    let modes: Vec<String> = drive.modes.iter().map(|mode| format!("{mode:?}")).collect();
    let watchdog = drive.watchdog.map_or_else(
        || "none".to_owned(),
        |time| format!("{} ms", time.as_millis()),
    );
    let row = |what: &'static str, robot_file: String, drive: String| Row {
        joint: joint.name.clone(),
        what,
        robot_file,
        drive,
    };
    vec![
        row("device", "-".to_owned(), drive.device.clone()),
        row("modes", "-".to_owned(), modes.join(", ").to_lowercase()),
        row(
            "largest torque",
            number(joint.torque_limit_nm, "Nm"),
            number(drive.motor_torque_max_nm, "Nm"),
        ),
        row(
            "step of the torque",
            "-".to_owned(),
            number(drive.motor_torque_step_nm, "Nm"),
        ),
        row(
            "step of the motor's position",
            step(joint.motor_encoder_resolution_rad),
            step(drive.motor_position_step_rad),
        ),
        row("watchdog", "-".to_owned(), watchdog),
    ]
}
