//! `flexspline drives`: virtual drives to try a driver on.

mod moteus;

use crate::cli::{DrivesCommand, EmulateCommand};
use crate::error::CliError;

/// Does what was asked of drives.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if it could not be kept up.
pub fn drives(command: &DrivesCommand) -> Result<(), CliError> {
    match command {
        DrivesCommand::Emulate(EmulateCommand::Moteus(arguments)) => moteus::emulate(arguments),
    }
}
