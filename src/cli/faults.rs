//! What can be typed after `flexspline faults`.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};

/// `flexspline faults`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline faults                    every fault, 1000 service kills, 200 start-stop rounds: about half an hour
  flexspline faults --short            a few of each
  flexspline faults --part virtual     frames, readings, commands, orders, buses and 1000 cable pulls, in virtual time
  flexspline faults --part kills --kills 100
  flexspline faults --part soak        a day of control in lockstep: hours; Ctrl-C ends it early

Real processes are killed and frozen, only those of the suite's own runs. Some faults need root and are skipped without.
Exit code: 0 everything ended as documented, 1 something did not, 2 bad input.")]
pub struct FaultsArguments {
    /// Robot: pa10, shd17, or a robot file
    #[arg(long, default_value = "pa10", value_name = "NAME|FILE")]
    pub robot: String,
    /// Driver of the runs with processes; faults in virtual time are on all virtual drives
    #[arg(long, default_value = "emulator", value_name = "NAME")]
    pub driver: String,
    /// Only a few of each kind
    #[arg(long)]
    pub short: bool,
    /// Only this part; may be given again
    #[arg(long, value_enum, value_name = "PART")]
    pub part: Vec<FaultsPart>,
    /// How many services are killed under one running loop; 1000, or 5 with --short
    #[arg(long, value_name = "N")]
    pub kills: Option<u64>,
    /// How many instances are started and struck at a random moment; 200, or 2 with --short
    #[arg(long, value_name = "N")]
    pub rounds: Option<u64>,
    /// How much virtual time the soak runs; 24h, or 20s with --short
    #[arg(long, value_name = "D", value_parser = humantime::parse_duration)]
    pub soak: Option<Duration>,
    /// Where to write the results as JSON too; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// Parts of the fault suite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FaultsPart {
    /// Frames, readings, commands, orders and buses, on all virtual drives, in virtual time
    Virtual,
    /// Processes killed and frozen, and the machine they run on, in real time
    Processes,
    /// Services killed in great number under one running loop
    Kills,
    /// Instances started and struck at random moments
    Rounds,
    /// A long run in lockstep; hours, and so only where it is named
    Soak,
}
