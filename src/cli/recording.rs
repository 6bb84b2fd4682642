//! What can be typed after `flexspline recording`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

/// `flexspline recording`
#[derive(Debug, Subcommand)]
#[command(after_help = "\
A recording is an MCAP file of `run`, a bag of ROS 1 or 2, a LeRobot dataset, or a CSV, Parquet, .npz, .pt, .pkl, .mat or HDF5 file with
one row per control cycle. Columns are named JOINT.SIGNAL, or a mapping file, NAME.mapping.toml beside NAME.csv, says which
column is which signal. With a robot, what is certain is guessed without one.
Exit code: 0 done, 1 `info --robot` found errors or the twin stopped for safety, 2 bad input.")]
pub enum RecordingCommand {
    /// Print what is in recordings, how good it is, and what it cannot support
    Info(RecordingInfoArguments),
    /// Turn a log into an MCAP recording
    Import(RecordingImportArguments),
    /// Guess what the columns of a log hold, show why, and write its mapping file
    Map(RecordingMapArguments),
    /// Write a recording, or a part of it, as CSV, Parquet or MCAP
    Export(RecordingExportArguments),
    /// Write the recording that the robot file's nominal model makes of the same reference
    Simulate(RecordingSimulateArguments),
}

/// `flexspline recording info`
#[derive(Debug, Args)]
pub struct RecordingInfoArguments {
    /// Recordings
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Robot to check them against: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: Option<String>,
    /// Which column is which signal; NAME.mapping.toml beside the log if not given
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Where to write the same as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `flexspline recording import`
#[derive(Debug, Args)]
pub struct RecordingImportArguments {
    /// Log: bag of ROS, LeRobot dataset, CSV, Parquet, .npz, .pt, .pkl, .mat, HDF5
    pub file: PathBuf,
    /// Robot that it is of, to guess what its columns hold: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: Option<String>,
    /// Which column is which signal; NAME.mapping.toml beside the log if not given
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Recording to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

/// `flexspline recording map`
#[derive(Debug, Args)]
#[command(after_help = "\
Exit code: 0 the mapping file was written, 1 something is doubtful and --yes was not given, 2 bad input.")]
pub struct RecordingMapArguments {
    /// Log
    pub file: PathBuf,
    /// Robot that it is of: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: String,
    /// Write the best guess, however doubtful
    #[arg(long)]
    pub yes: bool,
}

/// `flexspline recording export`
#[derive(Debug, Args)]
pub struct RecordingExportArguments {
    /// Recording
    pub file: PathBuf,
    /// Which column is which signal; NAME.mapping.toml beside the log if not given
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// File to write: .csv, .parquet or .mcap
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// First time to write, in seconds as in `time_s`
    #[arg(long, value_name = "S", default_value_t = f64::NEG_INFINITY, hide_default_value = true)]
    pub from: f64,
    /// Last time to write
    #[arg(long, value_name = "S", default_value_t = f64::INFINITY, hide_default_value = true)]
    pub to: f64,
    /// Only this joint; may be given again
    #[arg(long, value_name = "NAME")]
    pub joint: Vec<String>,
}

/// `flexspline recording simulate`
#[derive(Debug, Args)]
pub struct RecordingSimulateArguments {
    /// Recording whose reference is followed
    pub file: PathBuf,
    /// Which column is which signal; NAME.mapping.toml beside the log if not given
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Robot: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: String,
    /// Recording to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Seed of the sensors' noise
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
}
