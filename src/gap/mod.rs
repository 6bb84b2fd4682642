//! `flexspline gap`: where simulation and robot part, why, and how far that can be mended.

pub mod apply;
mod beside;
mod blind;
pub mod diagnose;
pub mod emulated;
pub mod page;
mod repeats;
mod round;
pub mod suggest;
pub mod watch;

use std::path::Path;

use ::recording::Recording;

use crate::cli::GapCommand;
use crate::error::CliError;

/// Does one of the parts.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] where there is nothing to do.
pub fn gap(command: &GapCommand) -> Result<(), CliError> {
    match command {
        GapCommand::Apply(arguments) => apply::apply(arguments),
        GapCommand::Diagnose(arguments) => diagnose::diagnose(arguments),
        GapCommand::Repeats(arguments) => repeats::tell(arguments),
        GapCommand::Suggest(arguments) => suggest::suggest(arguments),
        GapCommand::Watch(arguments) => watch::watch(arguments),
        GapCommand::Round(arguments) => round::round(arguments),
        GapCommand::Blind(command) => blind::blind(command),
    }
}

/// A recording with its name, read with the mapping file beside it.
fn read(path: &Path) -> Result<(String, Recording), CliError> {
    let recording = crate::recording::read(path, None)?;
    Ok((path.display().to_string(), recording))
}
