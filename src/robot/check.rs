//! `check`: what is known, unknown and doubtful.

use std::fmt::Write;
use std::path::Path;

use robot::{Survey, survey};
use serde::Serialize;

use crate::cli::RobotCheckArguments;
use crate::error::CliError;
use crate::output::{print, write_json};

/// For programs.
#[derive(Serialize)]
struct Checked<'a> {
    schema: u32,
    robot: &'a str,
    joints: Vec<&'a str>,
    known: &'a [String],
    unknown: &'a [String],
    doubtful: &'a [String],
}

/// Looks, and tells.
///
/// # Errors
/// [`CliError::Input`] if there is no robot, [`CliError::Negative`] if something is doubtful.
pub fn check(arguments: &RobotCheckArguments) -> Result<(), CliError> {
    let survey = survey(&arguments.robot).map_err(CliError::input)?;
    if let Some(path) = &arguments.json {
        let checked = Checked {
            schema: 1,
            robot: &survey.robot.name,
            joints: survey.robot.joint_names(),
            known: &survey.known,
            unknown: &survey.unknown,
            doubtful: &survey.doubtful,
        };
        write_json(&checked, path)?;
    }
    if arguments.json.as_deref() != Some(Path::new("-")) {
        print(&told(&survey))?;
    }
    match survey.doubtful.as_slice() {
        [] => Ok(()),
        [first, others @ ..] => {
            let more = match others.len() {
                0 => String::new(),
                count => format!(", and {count} more"),
            };
            Err(CliError::Negative(format!("doubtful: {first}{more}")))
        }
    }
}

fn told(survey: &Survey) -> String {
    let mut text = format!("{}\n", survey.robot.name);
    let lists = [
        ("known", &survey.known),
        ("unknown", &survey.unknown),
        ("doubtful", &survey.doubtful),
    ];
    for (heading, lines) in lists.into_iter().filter(|(_, lines)| !lines.is_empty()) {
        let _ = writeln!(text, "\n{heading}");
        for line in lines {
            let _ = writeln!(text, "  {line}");
        }
    }
    text
}
