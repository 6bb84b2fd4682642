//! Files that commands write for people and programs: whole or not at all, and text that goes to standard output.

use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::error::CliError;

/// Writes a file under another name and renames it: whoever reads it meanwhile, or another name of the old file, keeps
/// what was there.
///
/// # Errors
/// [`CliError::Input`] if it cannot be written.
pub fn write_whole(path: &Path, text: &str) -> Result<(), CliError> {
    // A device or a pipe has no place beside it.
    let written = if path.exists() && !path.is_file() {
        fs::write(path, text)
    } else {
        let unfinished = unfinished(path);
        fs::write(&unfinished, text).and_then(|()| fs::rename(&unfinished, path))
    };
    written.map_err(|error| cannot_write(path, &error))
}

/// Writes what programs read; `-` is standard output.
///
/// # Errors
/// [`CliError::Input`] if it cannot be written.
pub fn write_json(value: &impl Serialize, path: &Path) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(value).map_err(CliError::input)? + "\n";
    if path == Path::new("-") {
        return std::io::stdout()
            .write_all(text.as_bytes())
            .map_err(|error| cannot_write(path, &error));
    }
    write_whole(path, &text)
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
        write_whole(&path, "old").expect("written");
        fs::hard_link(&path, &link).expect("linked");
        write_whole(&path, "new").expect("written");
        let read = |path| fs::read_to_string(path).expect("read");
        assert_eq!((read(&path), read(&link)), ("new".into(), "old".into()));
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 2);
    }
}
