//! What can be typed after `flexspline robot`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

/// `flexspline robot`
#[derive(Debug, Subcommand)]
pub enum RobotCommand {
    /// Write a commented robot file for a URDF or a MuJoCo model, or one to begin with
    Init(RobotInitArguments),
    /// Say what is known of a robot, what is unknown, and what can hardly be meant
    Check(RobotCheckArguments),
    /// Write a robot as URDF, MuJoCo model or robot file, and list what that format cannot hold
    Convert(RobotConvertArguments),
}

/// `flexspline robot init`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline robot init arm.urdf --out arm.toml
  flexspline robot init scene.xml --out arm.toml
  flexspline robot init --out bench.toml              a single joint of [[link]] and [[joint]] tables

The file loads as it stands and says what the description does. What the description cannot say
(gear, rotor, encoders, controller) stands in it as comments with their units.
Exit code: 0 written, 2 bad input, or the file is there already.")]
pub struct RobotInitArguments {
    /// URDF or MuJoCo model; a single joint if not given
    #[arg(value_name = "FILE")]
    pub description: Option<PathBuf>,
    /// Robot file to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

/// `flexspline robot check`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline robot check arm.urdf
  flexspline robot check arm.toml --json check.json

Doubtful are masses of zero, inertias that no body has, joints that nothing turns, and everything
that was not read; with file, line and element. Unknown is what no file says, with what is taken
instead.
Exit code: 0 nothing is doubtful, 1 something is, 2 bad input.")]
pub struct RobotCheckArguments {
    /// Robot: pa10, shd17, a robot file, a URDF or a MuJoCo model
    #[arg(value_name = "NAME|FILE")]
    pub robot: String,
    /// Where to write the same as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `flexspline robot convert`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline robot convert arm.urdf --out arm.xml       URDF to MuJoCo
  flexspline robot convert arm.xml --out arm.urdf       MuJoCo to URDF
  flexspline robot convert arm.urdf --out arm.toml      a robot file that needs no other file

What moves keeps its dynamics; fixed joints become one body, and shapes and meshes are left out.
What else the format cannot hold is listed.
Exit code: 0 written, 2 bad input.")]
pub struct RobotConvertArguments {
    /// Robot: pa10, shd17, a robot file, a URDF or a MuJoCo model
    #[arg(value_name = "NAME|FILE")]
    pub robot: String,
    /// File to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Format; by the name of the file if not given: .urdf, .xml or .mjcf, .toml
    #[arg(long, value_name = "NAME")]
    pub format: Option<RobotFormat>,
    /// Where to write what was left out as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// What a robot is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum RobotFormat {
    /// Robot file
    Toml,
    /// MuJoCo model
    Mjcf,
    /// URDF
    Urdf,
}
