//! What can be typed after `flexspline identify`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use identification::experiment::{PA10_2003, PA10_2005, Protocol};

use super::ModeArgument;

/// `flexspline identify`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline identify friction --out friction/                  Tables I and II of the PA-10, 80 measurements a joint
  flexspline identify periodic --out table/ --joint joint1      position-dependent friction of one joint
  flexspline identify all --out arm/                            everything, into arm/identified.toml
  flexspline identify all --out arm/ --plan                     what would be run; writes the trajectory files
  flexspline identify all --out arm/ --mode realtime --driver NAME   on your robot

The arm moves in velocity mode, one joint at a time; in lockstep the emulator in virtual time. Recordings and trajectories
stay in the folder; what is recorded already is not run again, so a stopped call goes on where it was. A recording made
by other means is taken too if it lies there under the name that --plan prints, as MCAP or CSV.
Exit code: 0 done, 1 stopped or an experiment failed, 2 bad input.")]
pub struct IdentifyArguments {
    /// What to identify
    #[arg(value_enum)]
    pub what: IdentifyWhat,
    /// Robot: pa10, shd17, or a robot file
    #[arg(long, default_value = "pa10", value_name = "NAME|FILE")]
    pub robot: String,
    /// Folder for recordings, results and the identified robot file
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Only this joint; may be given again
    #[arg(long, value_name = "NAME")]
    pub joint: Vec<String>,
    /// Speeds of friction and periodic: those of the paper of 2005 (0.02 to 0.4 rad/s, table at 0.01), or of 2003 (0.005
    /// to 0.5 rad/s, table at 0.005)
    #[arg(long, value_enum, default_value_t = SpeedsArgument::Pa10_2005)]
    pub speeds: SpeedsArgument,
    /// Only print the experiments and write their trajectory files
    #[arg(long)]
    pub plan: bool,
    /// Whether time is the wall clock's, with the loop's own processes, or virtual
    #[arg(long, value_enum, default_value_t = ModeArgument::Lockstep)]
    pub mode: ModeArgument,
    /// Driver that talks to the hardware, in real time
    #[arg(long, default_value = "emulator", value_name = "NAME")]
    pub driver: String,
    /// Name of the instance in real time; two robots need two names
    #[arg(long, default_value = "default", value_name = "NAME")]
    pub instance: String,
    /// Where to write the results as JSON too; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
    /// Seed of everything random in the emulator
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
    /// Prints no tables: another command asked
    #[arg(skip)]
    pub quiet: bool,
}

/// See [`Protocol`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SpeedsArgument {
    /// 0.02 to 0.4 rad/s
    #[value(name = "pa10-2005")]
    Pa10_2005,
    /// 0.005 to 0.5 rad/s
    #[value(name = "pa10-2003")]
    Pa10_2003,
}

impl From<SpeedsArgument> for Protocol {
    fn from(argument: SpeedsArgument) -> Self {
        match argument {
            SpeedsArgument::Pa10_2005 => PA10_2005,
            SpeedsArgument::Pa10_2003 => PA10_2003,
        }
    }
}

/// What can be identified.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum IdentifyWhat {
    /// Friction over velocity: Tables I and II
    Friction,
    /// Friction over the motor angle: Table III and the look-up table that is fed forward
    Periodic,
    /// Torque over gravity load: Table V; friction must be known, from the robot file or with `all`
    Stiffness,
    /// Masses and centres, from the sweeps of `stiffness` with every joint
    Gravity,
    /// Everything, each step with what the steps before it found, and how well it predicts motion it was not fitted to
    All,
}

impl IdentifyWhat {
    /// As typed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Friction => "friction",
            Self::Periodic => "periodic",
            Self::Stiffness => "stiffness",
            Self::Gravity => "gravity",
            Self::All => "all",
        }
    }

    /// Whether friction over velocity is wanted.
    pub fn friction(self) -> bool {
        matches!(self, Self::Friction | Self::All)
    }

    /// Whether torque over gravity load is wanted.
    pub fn stiffness(self) -> bool {
        matches!(self, Self::Stiffness | Self::All)
    }

    /// Whether motion that is not fitted is wanted.
    pub fn held_out(self) -> bool {
        self == Self::All
    }

    /// Whether masses and centres are wanted.
    pub fn gravity(self) -> bool {
        matches!(self, Self::Gravity | Self::All)
    }

    /// Whether friction over the motor angle is wanted.
    pub fn periodic(self) -> bool {
        matches!(self, Self::Periodic | Self::All)
    }
}
