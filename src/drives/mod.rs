//! `flexspline drives`: what is on a bus, whether it is what the robot file says, and virtual drives.

mod check;
mod emulate_ethercat;
mod hands;
mod moteus;
mod scan;

use robot::Robot;
use rt_loop::driver::{Behind, Driver, OpenContext};
use rt_loop::process::open_driver;
use shm_types::instance::RunConfig;

use crate::cli::{DrivesCommand, EmulateCommand};
use crate::drivers;
use crate::error::CliError;

/// Opens the drives of a run, which must be those of the robot. Nothing moves.
///
/// # Errors
/// [`CliError::Input`] with what does not fit.
fn open(run: &RunConfig, robot: &Robot) -> Result<Box<dyn Driver>, CliError> {
    let entry = drivers::find(&run.driver)?;
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
    let entry = drivers::find(&run.driver)?;
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
        DrivesCommand::Emulate(EmulateCommand::Moteus(arguments)) => moteus::emulate(arguments),
    }
}
