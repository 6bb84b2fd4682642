//! `convert`: URDF, MuJoCo model or robot file.

use std::fmt::Write;
use std::path::Path;

use serde::Serialize;

use crate::cli::{RobotConvertArguments, RobotFormat};
use crate::error::CliError;
use crate::output::{print, write_json, write_text};

/// For programs.
#[derive(Serialize)]
struct Converted<'a> {
    schema: u32,
    robot: &'a str,
    file: &'a Path,
    joints: Vec<&'a str>,
    /// What of the robot the format cannot hold.
    left_out: &'a [String],
    /// What was not read of the robot itself.
    notes: &'a [String],
}

/// Reads, writes, tells.
///
/// # Errors
/// [`CliError::Input`] for bad input.
pub fn convert(arguments: &RobotConvertArguments) -> Result<(), CliError> {
    let format = match arguments.format {
        Some(format) => format,
        None => format_of(&arguments.out)?,
    };
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    let written = match format {
        RobotFormat::Toml => robot.to_robot_file().map_err(CliError::input)?,
        RobotFormat::Mjcf => robot.to_mjcf(),
        RobotFormat::Urdf => robot.to_urdf(),
    };
    write_text(&arguments.out, &written.text)?;
    if let Some(path) = &arguments.json {
        let converted = Converted {
            schema: 1,
            robot: &robot.name,
            file: &arguments.out,
            joints: robot.joint_names(),
            left_out: &written.left_out,
            notes: &robot.notes,
        };
        write_json(&converted, path)?;
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    let mut text = String::new();
    for line in &robot.notes {
        let _ = writeln!(text, "{line}");
    }
    for line in &written.left_out {
        let _ = writeln!(text, "left out: {line}");
    }
    print(&format!("{text}{}\n", arguments.out.display()))
}

fn format_of(path: &Path) -> Result<RobotFormat, CliError> {
    let extension = path
        .extension()
        .map(|kind| kind.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("toml") => Ok(RobotFormat::Toml),
        Some("xml" | "mjcf") => Ok(RobotFormat::Mjcf),
        Some("urdf") => Ok(RobotFormat::Urdf),
        _ => Err(CliError::Input(format!(
            "{}: which format it shall be its name does not say; end it with .urdf, .xml or .toml, or give --format",
            path.display()
        ))),
    }
}
