//! The command line of Flexspline, with the drivers that come with it.

use std::process::ExitCode;

fn main() -> ExitCode {
    flexspline::main_with(&[])
}
