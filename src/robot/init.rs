//! `init`: a commented robot file.

use std::fs;
use std::path::Path;

use robot::{RobotFile, Source, starter};

use crate::cli::RobotInitArguments;
use crate::error::CliError;
use crate::output::{print, write_text};

/// Writes it, unless it is there.
///
/// # Errors
/// [`CliError::Input`] for a description that cannot be read, or a file that is there already.
pub fn init(arguments: &RobotInitArguments) -> Result<(), CliError> {
    let out = &arguments.out;
    if out.exists() {
        return Err(CliError::Input(format!(
            "{}: is there already; it is what people wrote, so move it away first",
            out.display()
        )));
    }
    let description = arguments.description.as_deref();
    let named = description.map_or(Ok(String::new()), |path| named_from(path, out))?;
    let path = description.map(|path| path.display().to_string());
    let text = starter(path.as_deref(), &named).map_err(CliError::input)?;
    let name = out.display().to_string();
    // what is written must be what every other command takes
    RobotFile::parse(&text, &name)
        .and_then(|file| file.build(Source::File(out.clone())))
        .map_err(CliError::input)?;
    write_text(out, &text)?;
    print(&format!("robot file: {name}\n"))
}

/// How the robot file names the description: by its name in the same folder, by its whole path in another.
fn named_from(path: &Path, out: &Path) -> Result<String, CliError> {
    let folder = |path: &Path| {
        let parent = path.parent().filter(|parent| *parent != Path::new(""));
        fs::canonicalize(parent.unwrap_or(Path::new("."))).ok()
    };
    let name = path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    match name {
        Some(name) if folder(path) == folder(out) => Ok(name),
        _ => fs::canonicalize(path)
            .map(|whole| whole.display().to_string())
            .map_err(|error| CliError::Input(format!("{}: {error}", path.display()))),
    }
}
