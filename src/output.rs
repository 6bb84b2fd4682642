//! Files that commands write for people and programs: whole or not at all, and text that goes to standard output.

use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::error::CliError;

/// Has a file written under another name and renames it: nothing half done is ever found under its own, and whoever reads
/// the old one meanwhile, or has another name for it, keeps it. A device or a pipe is written as it is.
///
/// # Errors
/// What `write` says, or [`CliError::Input`] if the file cannot be renamed.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&Path) -> Result<(), CliError>,
) -> Result<(), CliError> {
    if path.exists() && !path.is_file() {
        return write(path);
    }
    let unfinished = unfinished(path);
    let written = write(&unfinished)
        .and_then(|()| fs::rename(&unfinished, path).map_err(|error| cannot_write(path, &error)));
    if written.is_err() {
        let _ = fs::remove_file(&unfinished);
    }
    written
}

/// Writes a text as a whole.
///
/// # Errors
/// [`CliError::Input`] if it cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), CliError> {
    write_whole(path, |unfinished| {
        fs::write(unfinished, text).map_err(|error| cannot_write(path, &error))
    })
}

/// Writes what programs read; `-` is standard output.
///
/// # Errors
/// [`CliError::Input`] if it cannot be written.
pub fn write_json(value: &(impl Serialize + ?Sized), path: &Path) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(value).map_err(CliError::input)? + "\n";
    if path == Path::new("-") {
        return print(&text);
    }
    write_text(path, &text)
}

/// Writes to standard output. A reader that has seen enough, such as `head`, is no error.
///
/// # Errors
/// [`CliError::Negative`] if it cannot be written.
pub fn print(text: &str) -> Result<(), CliError> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(CliError::Negative(format!("cannot print: {error}")))
        }
        _ => Ok(()),
    }
}

/// Why a file was not written, and what to change.
pub fn cannot_write(path: &Path, error: &std::io::Error) -> CliError {
    CliError::Input(format!(
        "cannot write {}: {error}; choose a place with --out or --json",
        path.display()
    ))
}

fn unfinished(path: &Path) -> PathBuf {
    let mut name = path.file_name().map_or_else(OsString::new, OsString::from);
    name.push(".unfinished");
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_name_of_the_file_keeps_what_was_there() {
        let folder = tempfile::tempdir().expect("a folder");
        let [path, link] = ["a.json", "b.json"].map(|name| folder.path().join(name));
        write_text(&path, "old").expect("written");
        fs::hard_link(&path, &link).expect("linked");
        write_text(&path, "new").expect("written");
        let read = |path| fs::read_to_string(path).expect("read");
        assert_eq!((read(&path), read(&link)), ("new".into(), "old".into()));
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 2);
    }
}
