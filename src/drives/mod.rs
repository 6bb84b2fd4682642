//! `flexspline drives`: what is on a bus, whether it is what the robot file says, and virtual drives.

mod check;
mod emulate_ethercat;
mod scan;

use robot::Robot;
use rt_loop::driver::{Behind, Driver, DriverEntry, OpenContext};
use rt_loop::process::{find_driver, open_driver};
use shm_types::instance::RunConfig;

use crate::cli::{DrivesCommand, EmulateCommand};
use crate::error::CliError;

/// The drivers that `--driver` can choose.
pub const DRIVERS: [DriverEntry; 2] = [rt_loop::process::DRIVERS[0], ethercat::ETHERCAT];

/// Opens the drives of a run, which must be those of the robot. Nothing moves.
///
/// # Errors
/// [`CliError::Input`] with what does not fit.
fn open(run: &RunConfig, robot: &Robot) -> Result<Box<dyn Driver>, CliError> {
    let entry = find_driver(&DRIVERS, &run.driver).map_err(CliError::input)?;
    let context = OpenContext {
        run,
        robot,
        bus: None,
    };
    open_driver(entry, &context).map_err(CliError::input)
}

/// That the hardware of a run is there and is the robot's, before anything is started.
///
/// # Errors
/// [`CliError::Input`] with what does not fit.
pub fn check_hardware(run: &RunConfig, robot: &Robot) -> Result<(), CliError> {
    let entry = find_driver(&DRIVERS, &run.driver).map_err(CliError::input)?;
    if entry.behind == Behind::Hardware {
        open(run, robot)?.shutdown();
    }
    Ok(())
}

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
