//! What can be typed after `flexspline monitor`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

/// `flexspline monitor`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline monitor                       the instance `default`, until q is pressed or the run ends
  flexspline monitor --instance arm1
  flexspline monitor --once                what the screen shows after listening for a second, as text
  flexspline monitor --once --json -       the same for programs

Keys: e stops the robot at once; r, then y, leaves a safe stop; c counts times anew; q leaves, and the robot goes on.
It reads what the relay hands on, and runs on the core of the relay: the loop does not notice. A stop by key is a
convenience: people near the robot need a switch wired to the drives.
Exit code: 0 done or the run has ended, 1 nothing came, 2 bad input or no such instance.")]
pub struct MonitorArguments {
    /// Name of the instance
    #[arg(long, default_value = "default", value_name = "NAME")]
    pub instance: String,
    /// Listen for a while, show what came, and end
    #[arg(long)]
    pub once: bool,
    /// How long --once listens, as 1s or 500ms
    #[arg(long, default_value = "1s", value_name = "D", value_parser = humantime::parse_duration)]
    pub listen: Duration,
    /// With --once, where to write what came as JSON; - for standard output
    #[arg(long, value_name = "PATH", requires = "once")]
    pub json: Option<PathBuf>,
}
