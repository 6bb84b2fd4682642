//! `flexspline estimate`: calibrates the torque estimators on one recording, compares them on others.

mod calibrate;
pub mod compare;
pub mod page;
pub mod table;

use std::path::Path;

use recording::{Recording, Signal};
use robot::{Robot, RobotJoint};

use crate::cli::{EstimateArguments, EstimateCommand};
use crate::error::CliError;

/// Calibrates or compares.
///
/// # Errors
/// [`CliError::Input`] for bad input: the file, the joint and the signal that is missing.
pub fn estimate(arguments: &EstimateArguments) -> Result<(), CliError> {
    match &arguments.command {
        EstimateCommand::Calibrate(arguments) => calibrate::calibrate(arguments),
        EstimateCommand::Compare(arguments) => compare::compare(arguments),
    }
}

/// The joints asked for; else those of the robot that the recording has with this signal.
fn chosen_joints<'a>(
    robot: &'a Robot,
    recording: &Recording,
    names: &[String],
    needed: Signal,
) -> Result<Vec<&'a RobotJoint>, CliError> {
    if names.is_empty() {
        let has = |joint: &&RobotJoint| recording.signal(&joint.name, needed).is_ok();
        let joints: Vec<&RobotJoint> = robot.joints.iter().filter(has).collect();
        if joints.is_empty() {
            let recorded: Vec<&str> = recording.joint_names().collect();
            return Err(CliError::Input(format!(
                "the recording has {needed} of no joint of robot `{}` ({}); it has signals of {}",
                robot.name,
                robot.joint_names().join(", "),
                recorded.join(", ")
            )));
        }
        return Ok(joints);
    }
    names
        .iter()
        .map(|name| {
            let found = robot.joints.iter().find(|joint| joint.name == *name);
            found.ok_or_else(|| {
                CliError::Input(format!(
                    "--joint {name}: robot `{}` has no such joint; its joints are {}",
                    robot.name,
                    robot.joint_names().join(", ")
                ))
            })
        })
        .collect()
}

fn read(path: &Path) -> Result<Recording, CliError> {
    recording::read(path).map_err(CliError::input)
}
