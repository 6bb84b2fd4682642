//! What can be typed: a file for each command.

mod blind;
mod doctor;
mod drives;
mod estimate;
mod faults;
mod gap;
mod identify;
mod monitor;
mod process;
mod recording;
mod reproduce;
mod robot;
mod run;

pub use self::blind::*;
pub use self::doctor::*;
pub use self::drives::*;
pub use self::estimate::*;
pub use self::faults::*;
pub use self::gap::*;
pub use self::identify::*;
pub use self::monitor::*;
pub use self::process::*;
pub use self::recording::*;
pub use self::reproduce::*;
pub use self::robot::*;
pub use self::run::*;

use clap::{Parser, Subcommand};

/// A deterministic 1.5 kHz control loop for harmonic-drive robot joints over shared memory.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Start the loop, its services and the plant; run; print what happened; stop everything
    Run(RunArguments),
    /// Run the papers' identification experiments and fit the joint model
    Identify(IdentifyArguments),
    /// Run a paper's experiments on the emulator and print its numbers beside ours
    Reproduce(ReproduceArguments),
    /// What is in a recording; foreign logs in; CSV, Parquet or MCAP out; the twin's recording for the same reference
    #[command(subcommand)]
    Recording(RecordingCommand),
    /// Calibrate the torque estimators, or compare them with a torque sensor
    Estimate(EstimateArguments),
    /// Live view of a running instance in the terminal
    Monitor(MonitorArguments),
    /// What real-time abilities this machine grants, what is missing, and how to get it
    Doctor(DoctorArguments),
    /// Virtual drives on an emulated robot
    #[command(subcommand)]
    Drives(DrivesCommand),
    /// Put faults into a running system and print what it did about each
    Faults(FaultsArguments),
    /// Where simulation and robot part, which effect causes it, and how far that can be mended
    #[command(subcommand)]
    Gap(GapCommand),
    /// A robot file to begin with; what is known, unknown and doubtful of a robot; URDF, MuJoCo model and robot file into each other
    #[command(subcommand)]
    Robot(RobotCommand),
    /// One process of a running instance; started by `run`
    #[command(hide = true)]
    Process(ProcessArguments),
}
