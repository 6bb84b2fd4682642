//! `flexspline drives`: virtual drives to try a driver on.

mod moteus;

use moteus_driver::MOTEUS;
use rt_loop::driver::DriverEntry;
use rt_loop::process::DRIVERS as EMULATED;

use crate::cli::{DrivesCommand, EmulateCommand};
use crate::error::CliError;

/// The drivers of this program: the loop's own, and those of hardware.
pub const DRIVERS: [DriverEntry; 2] = [EMULATED[0], MOTEUS];

/// Does what was asked of drives.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if it could not be kept up.
pub fn drives(command: &DrivesCommand) -> Result<(), CliError> {
    match command {
        DrivesCommand::Emulate(EmulateCommand::Moteus(arguments)) => moteus::emulate(arguments),
    }
}
