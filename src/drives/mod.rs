//! `flexspline drives`: virtual drives to try a master or a driver on.

mod emulate_ethercat;

use crate::cli::{DrivesCommand, EmulateCommand};
use crate::error::CliError;

/// Does what was asked of drives.
///
/// # Errors
/// [`CliError::Input`] for bad input.
pub fn drives(command: &DrivesCommand) -> Result<(), CliError> {
    match command {
        DrivesCommand::Emulate(EmulateCommand::Ethercat(arguments)) => {
            emulate_ethercat::emulate(arguments)
        }
    }
}
