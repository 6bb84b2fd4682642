//! `flexspline gap blind`: the sealed evaluation.

mod make;
mod page;
mod run;
mod score;
mod table;

use crate::cli::BlindCommand;
use crate::error::CliError;

/// Does one of the parts.
///
/// # Errors
/// [`CliError::Input`] for bad input.
pub fn blind(command: &BlindCommand) -> Result<(), CliError> {
    match command {
        BlindCommand::Make(arguments) => make::make(arguments),
        BlindCommand::Run(arguments) => run::run(arguments),
        BlindCommand::Score(arguments) => score::score_all(arguments),
    }
}
