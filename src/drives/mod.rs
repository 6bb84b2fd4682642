//! `flexspline drives`: what is on a bus, whether it is what the robot file says, and virtual drives.

mod check;
mod emulate_ethercat;
mod scan;

use rt_loop::driver::DriverEntry;

use crate::cli::{DrivesCommand, EmulateCommand};
use crate::error::CliError;

/// The drivers that `--driver` can choose.
pub const DRIVERS: [DriverEntry; 2] = [rt_loop::process::DRIVERS[0], ethercat::ETHERCAT];

/// Does what was asked of drives.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] for drives that do not fit the robot.
pub fn drives(command: &DrivesCommand) -> Result<(), CliError> {
    match command {
        DrivesCommand::Scan(arguments) => scan::scan(arguments),
        DrivesCommand::Check(arguments) => check::check(arguments),
        DrivesCommand::Emulate(EmulateCommand::Ethercat(arguments)) => {
            emulate_ethercat::emulate(arguments)
        }
    }
}
