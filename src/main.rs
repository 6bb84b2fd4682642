//! The command line of Flexspline.

#![deny(unsafe_code)]

mod cli;
mod doctor;
mod drives;
mod error;
mod estimate;
mod faults;
mod gap;
mod identify;
mod monitor;
mod output;
mod process;
mod recording;
mod reproduce;
mod robot;
mod run;
mod supervisor;

use std::process::ExitCode;

use clap::Parser;

use crate::cli::{Cli, Command};
use crate::error::CliError;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) if error.use_stderr() => {
            eprintln!("flexspline: {}", one_line(&error.to_string()));
            return ExitCode::from(2);
        }
        // Help or version was asked for.
        Err(error) => error.exit(),
    };
    let outcome = match cli.command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Identify(arguments) => identify::identify(&arguments),
        Command::Recording(command) => recording::recording(&command),
        Command::Reproduce(arguments) => reproduce::reproduce(&arguments),
        Command::Estimate(arguments) => estimate::estimate(&arguments),
        Command::Monitor(arguments) => monitor::monitor(&arguments),
        Command::Doctor(arguments) => doctor::doctor(&arguments),
        Command::Drives(command) => drives::drives(&command),
        Command::Faults(arguments) => faults::faults(&arguments),
        Command::Gap(command) => gap::gap(&command),
        Command::Robot(command) => robot::robot(&command),
        Command::Process(arguments) => process::run(&arguments),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("flexspline: {error}");
            match error {
                CliError::Input(_) => ExitCode::from(2),
                CliError::Negative(_) => ExitCode::from(1),
            }
        }
    }
}

/// The argument parser's message without its layout.
fn one_line(message: &str) -> String {
    let wanted = |line: &&str| !line.is_empty() && !line.starts_with("Usage:");
    let parts: Vec<&str> = message.lines().map(str::trim).filter(wanted).collect();
    parts
        .join("; ")
        .replacen("error: ", "", 1)
        .replace("For more information, try '--help'.", "--help tells more")
}
