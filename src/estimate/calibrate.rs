//! `flexspline estimate calibrate`.

use std::path::Path;

use estimators::calibrate::{Calibration, Reference, WITHOUT_SENSOR};
use recording::Signal;
use robot::{EstimatorParameters, RobotFile, Source};
use serde::Serialize;

use super::{chosen_joints, read, table};
use crate::cli::{CalibrateArguments, ReferenceArgument};
use crate::error::CliError;
use crate::output::{print, write_json, write_text};

/// For programs.
#[derive(Serialize)]
struct Calibrated<'a> {
    schema: u32,
    robot: &'a str,
    recording: &'a Path,
    robot_file: &'a Path,
    joints: &'a [Calibration],
}

/// Reads, fits, writes the robot file, prints.
///
/// # Errors
/// [`CliError::Input`] for bad input.
pub fn calibrate(arguments: &CalibrateArguments) -> Result<(), CliError> {
    let (mut file, source) = robot::load_file(&arguments.robot).map_err(CliError::input)?;
    let robot = file
        .clone()
        .build(source.clone())
        .map_err(CliError::input)?;
    let recording = read(&arguments.recording)?;
    let place = |error: &dyn std::fmt::Display| {
        CliError::Input(format!("{}: {error}", arguments.recording.display()))
    };
    let reference = match arguments.reference {
        ReferenceArgument::JointTorque => Reference::JointTorque,
        ReferenceArgument::Gravity => Reference::Gravity,
    };
    let needed = match reference {
        Reference::JointTorque => Signal::JointTorqueNm,
        Reference::Gravity => Signal::MotorPositionRad,
    };
    let joints = chosen_joints(&robot, &recording, &arguments.joint, needed).map_err(|error| {
        let otherwise = match reference {
            Reference::JointTorque => WITHOUT_SENSOR,
            Reference::Gravity => "",
        };
        place(&format!("{error}{otherwise}"))
    })?;
    let mut found = Vec::new();
    for joint in joints {
        let calibration = estimators::calibrate::calibrate(&recording, &robot, joint, reference)
            .map_err(|error| place(&error))?;
        replace(&mut file, &calibration);
        found.push(calibration);
    }
    write_robot(&file, source, &arguments.out)?;
    let results = Calibrated {
        schema: 1,
        robot: &robot.name,
        recording: &arguments.recording,
        robot_file: &arguments.out,
        joints: &found,
    };
    if let Some(path) = &arguments.json {
        write_json(&results, path)?;
    }
    if arguments.json.as_deref() != Some(Path::new("-")) {
        let fits: String = found.iter().map(table::fits).collect();
        print(&format!("{fits}robot file: {}\n", arguments.out.display()))?;
    }
    Ok(())
}

/// New parameters in place of old ones; what was not calibrated now stays.
fn replace(file: &mut RobotFile, found: &Calibration) {
    let joint = file
        .joints
        .iter_mut()
        .find(|joint| joint.name == found.joint);
    let Some(joint) = joint else { return };
    let new = found.parameters.clone();
    let old = joint.estimators.take().unwrap_or_default();
    joint.estimators = Some(EstimatorParameters {
        structural_damping: new.structural_damping.or(old.structural_damping),
        taghirad: new.taghirad.or(old.taghirad),
        disturbance_observer: new.disturbance_observer.or(old.disturbance_observer),
        // a process belongs to the compliance model it was trained on
        gaussian_process: match &new.compliance {
            Some(_) => new.gaussian_process,
            None => old.gaussian_process,
        },
        compliance: new.compliance.or(old.compliance),
        fusion: new.fusion.or(old.fusion),
    });
}

/// What is written must be what every other command takes.
fn write_robot(file: &RobotFile, source: Source, path: &Path) -> Result<(), CliError> {
    file.clone().build(source).map_err(|error| {
        CliError::Input(format!(
            "the calibration gives parameters that no joint has, so nothing was written: {error}"
        ))
    })?;
    let text = file.to_toml().map_err(CliError::input)?;
    write_text(path, &text)
}
