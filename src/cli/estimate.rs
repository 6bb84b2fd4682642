//! What can be typed after `flexspline estimate`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

/// `flexspline estimate`
#[derive(Debug, Args)]
pub struct EstimateArguments {
    /// Which part
    #[command(subcommand)]
    pub command: EstimateCommand,
}

/// The two parts of `flexspline estimate`.
#[derive(Debug, Subcommand)]
pub enum EstimateCommand {
    /// Find the estimators' parameters on one recording with a reference torque, and write them into a robot file
    Calibrate(CalibrateArguments),
    /// Compare the estimators with the torque sensor on recordings they were not calibrated on
    Compare(CompareArguments),
}

/// `flexspline estimate calibrate`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline estimate calibrate --robot shd17 --recording first.mcap --out calibrated.toml
  flexspline estimate calibrate --robot arm.toml --recording log.csv --joint elbow --reference gravity --out new.toml

Estimators whose signals the recording lacks are left out and named. Move under changing load, fast and slow, in both
directions, with some holds; the kinematic error needs the motor encoder's zero to stay.
Exit code: 0 done, 2 bad input.")]
pub struct CalibrateArguments {
    /// Robot: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: String,
    /// Recording, or CSV log with its mapping file beside it
    #[arg(long, value_name = "FILE")]
    pub recording: PathBuf,
    /// What the torque is known from
    #[arg(long, value_enum, default_value_t = ReferenceArgument::JointTorque, value_name = "WHICH")]
    pub reference: ReferenceArgument,
    /// Only this joint; may be given again
    #[arg(long, value_name = "NAME")]
    pub joint: Vec<String>,
    /// Robot file to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Where to write the results as JSON too; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// See [`estimators::calibrate::Reference`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum ReferenceArgument {
    /// A torque sensor at the gear's output
    JointTorque,
    /// The robot file's bodies, a payload among them, in slow and even motion
    Gravity,
}

/// `flexspline estimate compare`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline estimate compare --robot calibrated.toml --recording second.mcap --report second.html
  flexspline estimate compare --robot calibrated.toml --recording second.mcap --recording third.csv --json out.json

Exit code: 0 done, 2 bad input.")]
pub struct CompareArguments {
    /// Robot file with calibrated estimators
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: String,
    /// Recording, or CSV log with its mapping file beside it; may be given again
    #[arg(long, required = true, num_args = 1.., value_name = "FILE")]
    pub recording: Vec<PathBuf>,
    /// Only this joint; may be given again
    #[arg(long, value_name = "NAME")]
    pub joint: Vec<String>,
    /// Page to write, with figures
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Where to write the results as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}
