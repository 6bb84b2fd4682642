//! What can be typed after `flexspline reproduce`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use virtual_drives::Kind;

/// `flexspline reproduce`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline reproduce pa10-2005                           identifies an emulated arm, then tracks with what was found
  flexspline reproduce pa10-2003 --identified arm/identified.toml   with a model identified before, on the same --seed
  flexspline reproduce pa10-2005 --arms 3                  on three arms, results with their range
  flexspline reproduce pa10-2005 --drives ethercat         the same through virtual drives on EtherCAT
  flexspline reproduce structural-damping                  two data sets of the emulated joint: one to calibrate, one to judge
  flexspline reproduce structural-damping --arms 3         on three joints, results with their range

Everything runs in virtual time. The folder gets report.html, reproduce.json and, in identify/, what identification
recorded: recordings that are there already are not made again.
Exit code: 0 done, whatever the numbers say; 1 stopped; 2 bad input.")]
pub struct ReproduceArguments {
    /// Which paper
    #[arg(value_enum)]
    pub paper: Paper,
    /// Folder for the report, the results and the identification; reproduce/PAPER if not given
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Robot file identified before on the arm of this seed; identified now if not given
    #[arg(long, value_name = "FILE", conflicts_with = "arms")]
    pub identified: Option<String>,
    /// How many emulated arms, each with a seed of its own
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100))]
    pub arms: u64,
    /// Drives that the arm tracks with; it is identified with the emulator's
    #[arg(long, value_enum, default_value = "emulator", value_name = "DRIVES")]
    pub drives: DrivesArgument,
    /// Seed of the first arm, or joint, and of everything random on it
    #[arg(long, default_value_t = 11, value_name = "N")]
    pub seed: u64,
    /// Where to write the results as JSON too; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// Drives in virtual time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DrivesArgument {
    /// The emulator's, which take any torque
    Emulator,
    /// Virtual CiA 402 drives behind the EtherCAT driver: torque in 0.1 % of the rated one
    Ethercat,
    /// Virtual moteus drives behind their driver
    Moteus,
}

impl DrivesArgument {
    /// What stands behind the loop.
    pub fn kind(self) -> Kind {
        match self {
            Self::Emulator => Kind::Emulator,
            Self::Ethercat => Kind::Ethercat,
            Self::Moteus => Kind::Moteus,
        }
    }
}

/// What can be reproduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Paper {
    /// Kennedy and Desai on all joints of the PA-10: lemniscate, trapezoids, gains, low-stiffness region
    #[value(name = "pa10-2005")]
    Pa10Of2005,
    /// The same authors on its elbow: low gains with the model, high gains without
    #[value(name = "pa10-2003")]
    Pa10Of2003,
    /// Torque by structural damping, and by compliance, on the SHD-17 joint
    StructuralDamping,
}

impl Paper {
    /// As typed, and as its published numbers are called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pa10Of2005 => "pa10-2005",
            Self::Pa10Of2003 => "pa10-2003",
            Self::StructuralDamping => "structural-damping",
        }
    }
}
