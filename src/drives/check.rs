//! `flexspline drives check`: what the drives say, beside what the robot file says.

use std::path::Path;

use comfy_table::{Table, presets};
use robot::{Robot, RobotJoint};
use rt_loop::driver::{Capabilities, Driver, JointCapabilities};
use rt_loop::limits::RUNAWAY_VELOCITY_FACTOR;
use serde::Serialize;
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};

use crate::cli::CheckArguments;
use crate::error::CliError;
use crate::output::{print, write_json};
use crate::run::period_ns;

/// Longest object that is read: a device's name has 64 bytes at most in the drives known, numbers have 8.
const OBJECT_BYTES: usize = 128;

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
    what: String,
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
    let read = objects(arguments, &robot, driver.as_mut());
    driver.shutdown();
    let mut rows = rows(&robot, &drives);
    rows.extend(read?);
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
        table.add_row([&row.joint, &row.what, &row.robot_file, &row.drive]);
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

/// What was asked for beside, over the channel beside the cycle.
fn objects(
    arguments: &CheckArguments,
    robot: &Robot,
    driver: &mut dyn Driver,
) -> Result<Vec<Row>, CliError> {
    if arguments.read.is_empty() {
        return Ok(Vec::new());
    }
    let mut channel = driver.acyclic().ok_or_else(|| {
        CliError::Input(format!(
            "--read: the driver `{}` reads no objects; leave it out",
            arguments.driver
        ))
    })?;
    let mut rows = Vec::new();
    for (index, joint) in robot.joints.iter().enumerate() {
        for &object in &arguments.read {
            let mut buffer = [0; OBJECT_BYTES];
            let read = channel.read(index, object, &mut buffer);
            rows.push(Row {
                joint: joint.name.clone(),
                what: format!("object {:#06x}:{}", object.index, object.sub_index),
                robot_file: "-".to_owned(),
                // One that a drive has not is an answer too.
                drive: match read {
                    Ok(bytes) => told(&buffer[..bytes]),
                    Err(error) => error.to_string(),
                },
            });
        }
    }
    Ok(rows)
}

/// A number as the bus has it, or a text.
fn told(bytes: &[u8]) -> String {
    let is_text = |byte: &u8| byte.is_ascii_graphic() || *byte == b' ';
    if matches!(bytes.len(), 1 | 2 | 4 | 8) {
        let number = bytes
            .iter()
            .rev()
            .fold(0_u64, |number, &byte| number << 8 | u64::from(byte));
        let unused = 64 - 8 * bytes.len() as u32;
        let signed = ((number << unused) as i64) >> unused;
        return match signed < 0 {
            true => format!("{number} = {number:#x}, or {signed}"),
            false => format!("{number} = {number:#x}"),
        };
    }
    if bytes.iter().all(is_text) {
        return String::from_utf8_lossy(bytes).into_owned();
    }
    bytes
        .iter()
        .map(|byte| format!("{byte:02x} "))
        .collect::<String>()
        .trim_end()
        .to_owned()
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
        what: what.to_owned(),
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
        row(
            "quick stop",
            asked_quick_stop(joint),
            quick_stop(joint, drive),
        ),
    ]
}

/// What a CiA 402 drive's table asks for.
fn asked_quick_stop(joint: &RobotJoint) -> String {
    let table = joint.drive.as_ref();
    let ramp = table.and_then(|table| table.get("quick_stop_rad_s2"));
    ramp.map_or_else(|| "-".to_owned(), |ramp| format!("{ramp} rad/s²"))
}

/// The ramp, and how long a joint that is as fast as the loop lets it run goes on.
fn quick_stop(joint: &RobotJoint, drive: &JointCapabilities) -> String {
    let Some(stop) = drive.quick_stop else {
        return "-".to_owned();
    };
    let option = stop
        .option
        .map_or_else(|| "none".to_owned(), |option| option.to_string());
    let Some(ramp_rad_s2) = stop.ramp_rad_s2 else {
        return format!("no ramp, option {option}");
    };
    let fastest_rad_s = joint
        .velocity_limit_rad_s
        .map(|limit_rad_s| RUNAWAY_VELOCITY_FACTOR * limit_rad_s);
    let lasts = fastest_rad_s.map_or_else(String::new, |rad_s| {
        format!(", {:.3} s from {rad_s:.2} rad/s", rad_s / ramp_rad_s2)
    });
    format!("{ramp_rad_s2:.1} rad/s², option {option}{lasts}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_numbers_texts_or_bytes() {
        assert_eq!(told(&[0x40, 0xbb, 0, 0]), "47936 = 0xbb40");
        assert_eq!(told(&[0xfe, 0xff]), "65534 = 0xfffe, or -2");
        assert_eq!(told(b"FS-VD"), "FS-VD");
        assert_eq!(told(&[1, 2, 3]), "01 02 03");
        assert_eq!(told(&[]), "");
    }
}
