//! What can be typed after `flexspline doctor`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

/// `flexspline doctor`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline doctor                    everything, with two seconds of wake-ups on the loop's core
  flexspline doctor --no-probe         only what can be read
  flexspline doctor --driver NAME --robot arm.toml    the drives on the bus too
  flexspline doctor --json doctor.json --probe 60s

What is granted is read back from a thread that asks for what the loop asks for. Call it as the user, and in the unit or
container, that will run the robot: limits differ. Nothing is changed.
Exit code: 0 the loop gets what it asks for, 1 something is missing, 2 bad input.")]
pub struct DoctorArguments {
    /// How long the probe wakes up on the loop's core, as 2s or 500ms
    #[arg(long, default_value = "2s", value_name = "D", value_parser = humantime::parse_duration)]
    pub probe: Duration,
    /// Leave the probe out: nothing is asked of the kernel
    #[arg(long, conflicts_with = "probe")]
    pub no_probe: bool,
    /// Driver whose drives are looked at: opened, read back, exchanged with for a second, brakes closed
    #[arg(long, value_name = "NAME")]
    pub driver: Option<String>,
    /// Robot that the drives are held against: pa10, shd17, or a robot file
    #[arg(
        long,
        default_value = "pa10",
        value_name = "NAME|FILE",
        requires = "driver"
    )]
    pub robot: String,
    /// Where to write the findings as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}
