//! `flexspline recording`: what is in a recording, other formats in and out, and the twin's recording.

mod convert;
mod info;
mod simulate;

use std::path::Path;

use recording::{Recording, WriteError};

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
