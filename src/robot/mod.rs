//! `flexspline robot`: a robot file to begin with, what is known of a robot, and other formats.

mod check;
mod convert;
mod init;

use crate::cli::RobotCommand;
use crate::error::CliError;

/// Does one of the parts.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] for a robot with something doubtful.
pub fn robot(command: &RobotCommand) -> Result<(), CliError> {
    match command {
        RobotCommand::Init(arguments) => init::init(arguments),
        RobotCommand::Check(arguments) => check::check(arguments),
        RobotCommand::Convert(arguments) => convert::convert(arguments),
    }
}
