//! `import` and `export`: tables from and to other formats.

use std::path::Path;

use recording::{Recording, WriteError, write_csv, write_mcap, write_parquet};

use super::{cannot_write, read, read_of};
use crate::cli::{RecordingExportArguments, RecordingImportArguments};
use crate::error::CliError;
use crate::output::{print, write_whole};

/// Where an imported recording tells what it was made from.
const SOURCE: &str = "source";

/// A table's writer.
type Write = fn(&Recording, &Path) -> Result<(), WriteError>;

/// Writes a foreign log as an MCAP recording.
///
/// # Errors
/// [`CliError::Input`] if the log cannot be read or the recording not written.
pub fn import(arguments: &RecordingImportArguments) -> Result<(), CliError> {
    let (file, mapping) = (&arguments.file, arguments.mapping.as_deref());
    let (mut table, guessed) = match &arguments.robot {
        Some(name) => {
            let robot = robot::load(name).map_err(CliError::input)?;
            read_of(file, mapping, &robot, name)?
        }
        None => (read(file, mapping)?, String::new()),
    };
    print(&guessed)?;
    let name = arguments.file.file_name().unwrap_or_default();
    table
        .metadata
        .insert(SOURCE.to_owned(), name.to_string_lossy().into_owned());
    match extension(&arguments.out).as_str() {
        "mcap" => write_told(&table, &arguments.out, write_mcap),
        _ => Err(CliError::Input(format!(
            "--out {}: an imported recording is an MCAP file; name it .mcap, or take `recording export`",
            arguments.out.display()
        ))),
    }
}

/// Writes a recording, or a part of it, in the format that the name of the new file asks for.
///
/// # Errors
/// [`CliError::Input`] if there is nothing to write, or a file cannot be read or written.
pub fn export(arguments: &RecordingExportArguments) -> Result<(), CliError> {
    let writer =
        writer(&arguments.out).map_err(|error| CliError::Input(format!("--out {error}")))?;
    let table = read(&arguments.file, arguments.mapping.as_deref())?;
    let (from_s, to_s) = (arguments.from, arguments.to);
    let part = table
        .part(from_s, to_s, &arguments.joint)
        .map_err(|missing| CliError::Input(format!("--joint: {missing}")))?;
    if part.rows() == 0 && table.rows() > 0 {
        let (first_s, last_s) = table
            .time_s
            .iter()
            .fold((f64::MAX, f64::MIN), |range, time_s| {
                (range.0.min(*time_s), range.1.max(*time_s))
            });
        return Err(CliError::Input(format!(
            "{}: no row lies between --from {from_s} and --to {to_s}; its times go from {first_s} to {last_s} s",
            arguments.file.display()
        )));
    }
    write_told(&part, &arguments.out, writer)
}

/// Writes a recording in the format that the file's name asks for.
///
/// # Errors
/// [`CliError::Input`] if it asks for none, or the file cannot be written.
pub fn write(table: &Recording, out: &Path) -> Result<(), CliError> {
    write_with(table, out, writer(out)?)
}

/// For a file of that name.
fn writer(out: &Path) -> Result<Write, CliError> {
    match extension(out).as_str() {
        "csv" => Ok(write_csv),
        "parquet" => Ok(write_parquet),
        "mcap" => Ok(write_mcap),
        _ => Err(CliError::Input(format!(
            "{}: unknown format; name it .csv, .parquet or .mcap",
            out.display()
        ))),
    }
}

fn write_with(table: &Recording, out: &Path, writer: Write) -> Result<(), CliError> {
    write_whole(out, |unfinished| {
        writer(table, unfinished).map_err(|error| cannot_write(out, error))
    })
}

fn write_told(table: &Recording, out: &Path, writer: Write) -> Result<(), CliError> {
    write_with(table, out, writer)?;
    print(&format!(
        "{}: {} rows, {} joints\n",
        out.display(),
        table.rows(),
        table.joints.len()
    ))
}

fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_lowercase()
}
