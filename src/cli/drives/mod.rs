//! What can be typed after `flexspline drives`.

mod ethercat;

pub use self::ethercat::*;

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
    /// EtherCAT drives with CiA 402 on a network interface, for any master
    Ethercat(EmulateEthercatArguments),
}
