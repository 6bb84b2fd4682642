//! `flexspline recording`: what is in a recording, other formats in and out, and the twin's recording.

mod convert;
mod info;
mod robot;
mod simulate;

use std::fs;
use std::path::{Path, PathBuf};

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

fn read(path: &Path) -> Result<Recording, CliError> {
    recording::read(path).map_err(CliError::input)
}

/// Writes a file under another name first, so that nothing half done is ever found under its own, and the file that
/// is read may be the one that is written.
fn write_whole(
    path: &Path,
    write: impl FnOnce(&Path) -> Result<(), CliError>,
) -> Result<(), CliError> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".unfinished");
    let unfinished: PathBuf = path.with_file_name(name);
    let written = write(&unfinished).and_then(|()| {
        fs::rename(&unfinished, path).map_err(|error| {
            CliError::Input(format!(
                "cannot write {}: {error}; choose a place with --out",
                path.display()
            ))
        })
    });
    if written.is_err() {
        let _ = fs::remove_file(&unfinished);
    }
    written
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
