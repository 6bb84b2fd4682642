//! What can be typed after `flexspline drives`.

mod moteus;

pub use self::moteus::*;

use clap::Subcommand;

/// `flexspline drives`
#[derive(Debug, Subcommand)]
pub enum DrivesCommand {
    /// Virtual drives on an emulated robot, for drivers, tests and tools that have no hardware
    #[command(subcommand)]
    Emulate(EmulateCommand),
}

/// `flexspline drives emulate`
#[derive(Debug, Subcommand)]
pub enum EmulateCommand {
    /// moteus drives behind pseudo-terminals that speak the fdcanusb line protocol
    Moteus(EmulateMoteusArguments),
}
