//! Flexspline as a library: the whole command line, with drivers of your own.
//!
//! The program `flexspline` is [`main_with`] and nothing else. A package of yours that hands it a
//! [`DriverEntry`](driver::DriverEntry) is the same program with one more name for `--driver`: supervisor, loop, services,
//! doctor and fault suite are all its own.
//!
//! ```no_run
//! use flexspline::driver::{Behind, DriverEntry, OpenError};
//!
//! const MINE: DriverEntry = DriverEntry {
//!     name: "mine",
//!     summary: "the arm in the corner",
//!     behind: Behind::Hardware,
//!     open: |_context| Err(OpenError::Hardware("nothing is plugged in; plug it in".to_owned())),
//! };
//!
//! fn main() -> std::process::ExitCode {
//!     flexspline::main_with(&[MINE])
//! }
//! ```
//!
//! `examples/own_driver` is a package that does so.

#![deny(unsafe_code)]

mod cli;
mod doctor;
mod drivers;
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

/// What the commands do, for programs that have robot and recordings in memory.
pub mod library {
    pub use crate::error::CliError;
    pub use crate::gap::apply::{Change, Mended, RobotText, mended, save};
    pub use crate::gap::diagnose::{nothing_to_say, recorded_joints_of, summary};
    pub use crate::gap::emulated::{Course, Emulated};
    pub use crate::gap::page::words::{sentence, words};
    pub use crate::gap::page::{page, short_page};
    pub use crate::gap::suggest::{Suggested, suggested};
    pub use crate::gap::watch::Feed;
    pub use crate::identify::identify_into;
    pub use crate::recording::{Followed, read, read_of, write};
}

/// The contract with the hardware.
pub use rt_loop::driver;
/// How drives tell what they are.
pub use shm_types::drive;
/// What goes between loop and drives.
pub use shm_types::messages;

/// Runs the command line of this process, with `drivers` beside those that come with Flexspline.
///
/// A run starts this very program again for each of its processes, so call it first of all in `main`.
pub fn main_with(drivers: &[driver::DriverEntry]) -> ExitCode {
    if let Err(error) = drivers::add(drivers) {
        eprintln!("flexspline: {error}");
        return ExitCode::from(2);
    }
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
