//! `flexspline recording`: what is in a recording, other formats in and out, and the twin's recording.

mod convert;
mod info;
mod map;
mod simulate;

use std::path::Path;

pub use convert::write;
use recording::{GuessJoint, ReadProblem, Recording, WriteError, read_guessing};
use robot::Robot;
pub use simulate::Followed;

use crate::cli::RecordingCommand;
use crate::error::CliError;

/// Does what was asked for.
///
/// # Errors
/// [`CliError::Input`] for files that cannot be read or written, [`CliError::Negative`] for a recording with errors.
pub fn recording(command: &RecordingCommand) -> Result<(), CliError> {
    match command {
        RecordingCommand::Info(arguments) => info::info(arguments),
        RecordingCommand::Import(arguments) => convert::import(arguments),
        RecordingCommand::Export(arguments) => convert::export(arguments),
        RecordingCommand::Map(arguments) => map::map(arguments),
        RecordingCommand::Simulate(arguments) => simulate::simulate(arguments),
    }
}

/// A recording, read with that mapping file or else the one beside it.
///
/// # Errors
/// [`CliError::Input`] for a file that cannot be read.
pub fn read(path: &Path, mapping: Option<&Path>) -> Result<Recording, CliError> {
    let recording = match mapping {
        Some(mapping) => recording::read_mapped(path, mapping),
        None => recording::read(path),
    };
    recording.map_err(CliError::input)
}

/// A recording of that robot, called so: where nothing says what a log holds it is guessed, and what was decided is told in
/// one line for each joint, as the second.
///
/// # Errors
/// [`CliError::Input`] for a file that cannot be read or a guess that is doubtful.
pub fn read_of(
    path: &Path,
    mapping: Option<&Path>,
    robot: &Robot,
    robot_name: &str,
) -> Result<(Recording, String), CliError> {
    if mapping.is_some() {
        return Ok((read(path, mapping)?, String::new()));
    }
    let (recording, guess) = read_guessing(path, &guess_joints(robot)).map_err(|error| {
        let look = match error.problem {
            ReadProblem::Doubtful { .. }
            | ReadProblem::NoSignals { .. }
            | ReadProblem::NotAllRead { .. }
            | ReadProblem::UnnamedJoints { .. } => format!(
                "; see `flexspline recording map {} --robot {robot_name}`",
                path.display()
            ),
            _ => String::new(),
        };
        CliError::Input(format!("{error}{look}"))
    })?;
    let lines = guess.map_or(Vec::new(), |guess| guess.lines());
    let name = path.display();
    let lines: String = lines
        .iter()
        .map(|line| format!("{name}: guessed: {line}\n"))
        .collect();
    Ok((recording, lines))
}

/// What a guess must know of the robot.
fn guess_joints(robot: &Robot) -> Vec<GuessJoint> {
    let joints = robot.joints.iter();
    joints
        .enumerate()
        .map(|(index, joint)| GuessJoint {
            name: joint.name.clone(),
            gear_ratio: joint.gear_ratio,
            is_limited: joint.position_limit_rad.is_some(),
            has_rotor: joint.rotor_inertia_kg_m2 > 0.0,
            slides: robot.slides(index),
        })
        .collect()
}

/// A table that could not be written; the file is called as it was asked for.
fn cannot_write(path: &Path, error: WriteError) -> CliError {
    let error = match error {
        WriteError::Io { cause, .. } => WriteError::Io {
            path: path.to_owned(),
            cause,
        },
        other => other,
    };
    CliError::input(error)
}
