//! What can be typed after `flexspline drives`.

mod ethercat;
mod moteus;

pub use self::ethercat::*;
pub use self::moteus::*;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use rt_loop::driver::Object;

/// `flexspline drives`
#[derive(Debug, Subcommand)]
pub enum DrivesCommand {
    /// Say which slaves are on an EtherCAT interface, and what their axes are
    Scan(ScanArguments),
    /// Read back from the drives what matters and hold it against the robot file; nothing moves
    Check(CheckArguments),
    /// Virtual drives on an emulated robot, for drivers, tests and tools that have no hardware
    #[command(subcommand)]
    Emulate(EmulateCommand),
}

/// `flexspline drives emulate`
#[derive(Debug, Subcommand)]
pub enum EmulateCommand {
    /// moteus drives behind pseudo-terminals that speak the fdcanusb line protocol
    Moteus(EmulateMoteusArguments),
    /// EtherCAT drives with CiA 402 on a network interface, for any master
    Ethercat(EmulateEthercatArguments),
}

/// `flexspline drives scan`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline drives scan --interface eth1
  flexspline drives scan --interface eth1 --json -

The slaves are brought to PRE-OP and back to INIT. Nothing is written to their objects.
Exit code: 0 slaves were found, 2 bad input: no interface, no permission, no slaves, another master.")]
pub struct ScanArguments {
    /// Network interface of the drives
    #[arg(long, value_name = "NAME")]
    pub interface: String,
    /// Where to write the same as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `flexspline drives check`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline drives check --robot arm.toml
  flexspline drives check --robot arm.toml --rate 1000
  flexspline drives check --robot arm.toml --read 0x6079 --read 0x1018:4    what the drive's manual says of itself

The drives are configured as for a run, up to SAFE-OP, and left in INIT. Brakes stay closed.
Exit code: 0 they fit the robot file, 2 they do not, or bad input.")]
pub struct CheckArguments {
    /// Robot file with a [drive] table
    #[arg(long, value_name = "FILE")]
    pub robot: String,
    /// Driver that reaches the drives
    #[arg(long, default_value = "ethercat", value_name = "NAME")]
    pub driver: String,
    /// Read this object of each joint's drive too, as 0x6079 or 0x1018:4; may be given more than once
    #[arg(long, value_name = "INDEX[:SUB]", value_parser = object)]
    pub read: Vec<Object>,
    /// Cycles a second that they are to run at; control.rate_hz of the robot file if not given, 1500 where it has none
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// Where to write the same as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `0x6079`, `0x1018:4`, or the same in decimal digits.
fn object(text: &str) -> Result<Object, String> {
    let (index, sub_index) = text.split_once(':').unwrap_or((text, "0"));
    let number = |text: &str| match text.strip_prefix("0x") {
        Some(digits) => u16::from_str_radix(digits, 16),
        None => text.parse(),
    };
    let read = number(index).ok().zip(number(sub_index).ok());
    let object = read.and_then(|(index, sub_index)| {
        let sub_index = u8::try_from(sub_index).ok()?;
        Some(Object { index, sub_index })
    });
    object.ok_or_else(|| {
        "give an index up to 0xffff, and a sub-index up to 255 behind a colon".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_read_in_either_number_system() {
        let read = |text| object(text).map(|object| (object.index, object.sub_index));
        assert_eq!(read("0x6079"), Ok((0x6079, 0)));
        assert_eq!(read("0x1018:4"), Ok((0x1018, 4)));
        assert_eq!(read("4120:0x10"), Ok((4120, 16)));
        for wrong in ["", "6079h", "0x10000", "0x1018:256", "0x1018:"] {
            assert!(object(wrong).is_err(), "{wrong}");
        }
    }
}
