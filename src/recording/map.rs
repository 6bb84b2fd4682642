//! `map`: guesses what the columns of a foreign log hold, and writes the mapping file.

use comfy_table::{Table, presets};
use recording::{Guess, guess, mapping_beside};

use super::guess_joints;
use crate::cli::RecordingMapArguments;
use crate::error::CliError;
use crate::output::{print, write_text};

/// Guesses, shows, writes.
///
/// # Errors
/// [`CliError::Input`] if the log or the robot cannot be read, nothing in the log is the robot's, or it has a mapping file;
/// [`CliError::Negative`] if the guess is too doubtful to be written unasked.
pub fn map(arguments: &RecordingMapArguments) -> Result<(), CliError> {
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    let out = mapping_beside(&arguments.file);
    if out.exists() {
        return Err(CliError::Input(format!(
            "{}: is there already; it is what people wrote, so move it away first",
            out.display()
        )));
    }
    let guess = guess(&arguments.file, &guess_joints(&robot)).map_err(CliError::input)?;
    print(&told(&guess))?;
    if guess.columns.is_empty() {
        return Err(CliError::Input(format!(
            "{}: no column is of a joint of `{}`; its joints are {}",
            arguments.file.display(),
            robot.name,
            robot.joint_names().join(", ")
        )));
    }
    let doubtful: Vec<&str> = guess
        .doubtful()
        .map(|found| found.column.as_str())
        .collect();
    if !doubtful.is_empty() && !arguments.yes {
        return Err(CliError::Negative(format!(
            "doubtful: {}; nothing was written: look at the table, and give --yes if it is right",
            doubtful.join(", ")
        )));
    }
    write_text(&out, &guess.to_toml())?;
    let time = match guess.has_time {
        true => "",
        false => ": say in it which column is the time, or how many rows there were in a second",
    };
    print(&format!("{}{time}\n", out.display()))
}

fn told(guess: &Guess) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(["column", "joint", "signal", "scale", "", "why"]);
    for found in &guess.columns {
        table.add_row([
            found.column.clone(),
            found.joint.clone(),
            found.signal.to_string(),
            report::number(found.scale, 6),
            found.sure.to_string(),
            found.why.clone(),
        ]);
    }
    for (column, why) in &guess.left_out {
        table.add_row([column, "", "left out", "", "", why]);
    }
    format!("{table}\n")
}
