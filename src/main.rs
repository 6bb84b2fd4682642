//! The command line of Flexspline, with the drivers that come with it.

use std::process::ExitCode;

use ethercat::ETHERCAT;
use moteus_driver::MOTEUS;

fn main() -> ExitCode {
    flexspline::main_with(&[ETHERCAT, MOTEUS])
}
