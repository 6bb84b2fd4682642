//! What can be typed after `flexspline gap`.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Subcommand, ValueEnum};

use super::BlindCommand;

/// `flexspline gap`
#[derive(Debug, Subcommand)]
pub enum GapCommand {
    /// Say where robot and simulation part, which effect causes it, and how far the gap shrinks once it is added
    Diagnose(GapDiagnoseArguments),
    /// Write the robot file with the diagnosed effects added
    Apply(GapApplyArguments),
    /// Find repeats of one input among recordings, how far they scatter, and which differ: the noise floor, without a model
    Repeats(GapRepeatsArguments),
    /// Write the trajectory that would best tell apart what the data could not
    Suggest(GapSuggestArguments),
    /// Watch a running robot, or a recording, and say when a gap appears and what it most likely is
    Watch(GapWatchArguments),
    /// Put effects into the emulated plant, diagnose, apply, and run with the mended file: tracking before and after
    Round(GapRoundArguments),
    /// Evaluate the diagnosis on sealed cases whose cause is known
    #[command(subcommand)]
    Blind(BlindCommand),
}

/// `flexspline gap diagnose`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline gap diagnose --robot arm.toml --recording run.mcap --out gap
  flexspline gap diagnose --robot arm.toml --recording first.mcap second.csv --json report.json
  flexspline gap diagnose --robot arm.xml --recording robot.csv --simulated mujoco.csv --out gap

With --simulated both are held against the same file. The report then has one key more,
`beside_simulator`, and DIR/simulated.json is the simulator's own report.
Exit code: 0 done, whatever was found; 2 bad input.")]
pub struct GapDiagnoseArguments {
    /// The simulation: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: String,
    /// The robot: recording, bag of ROS, LeRobot dataset, or CSV, Parquet, .npz, .mat or HDF5 log; may be given again
    #[arg(long, required = true, num_args = 1.., value_name = "FILE")]
    pub recording: Vec<PathBuf>,
    /// Recordings of your own simulator on the same references: what the robot has and the simulator has not is told
    #[arg(long, num_args = 1.., value_name = "FILE")]
    pub simulated: Vec<PathBuf>,
    /// Which column is which signal, for all recordings; NAME.mapping.toml beside each if not given, else
    /// guessed where that is certain
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Folder for report.json and report.html
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Share of a joint's gap below which an effect is told apart as a minor one
    #[arg(long, value_name = "SHARE", default_value_t = gap_diagnosis::Options::default().materiality, value_parser = share)]
    pub materiality: f64,
    /// What to hold the recording against; by default a simulation where the robot file tells controller and encoders, else the
    /// recorded motion
    #[arg(long, value_name = "NAME")]
    pub engine: Option<GapEngine>,
    /// Where to write the report as JSON too; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// What a recording is held against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum GapEngine {
    /// Inverse dynamics of the recorded motion
    Motion,
    /// A simulation of each joint in its loop
    ClosedLoop,
}

impl From<GapEngine> for gap_diagnosis::Engine {
    fn from(engine: GapEngine) -> Self {
        match engine {
            GapEngine::Motion => Self::Motion,
            GapEngine::ClosedLoop => Self::ClosedLoop,
        }
    }
}

/// A part of one.
fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if (0.0..1.0).contains(&share) => Ok(share),
        _ => Err("a share is a number from 0 to below 1, such as 0.02".to_owned()),
    }
}

/// `flexspline gap apply`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline gap apply --report gap/report.json --robot arm.toml --out mended.toml
  flexspline gap apply --report gap/report.json --robot arm.toml --out mended.toml --remaining
  flexspline gap apply --report gap/report.json --robot arm.xml --format mjcf --out mended.xml
  flexspline gap apply --report gap/report.json --robot arm.urdf --format urdf --out mended.urdf
  flexspline gap apply --report gap/report.json --robot arm.toml --format isaaclab --out arm.py

Everything else in the file stays as it was written, comments included. A change of a value that
the file has is added to that value; what was changed is printed. Feedforward, emulator and
diagnosis take the new file. Masses of links that a URDF or a MuJoCo model has go into a new one
beside it (mended_links.urdf), which it names.

With another --format the effects are written where that simulator reads them:
  mjcf      joints' damping, frictionloss, armature and spring, actuators' gains, limits and
            delay, bodies for a payload, <inertial> of links
  urdf      <dynamics> damping and friction, <limit effort>, links for a payload, <inertial>
  isaaclab  Python text for ArticulationCfg.actuators: gains, armature, friction, limits, delay
The MuJoCo model or URDF that --robot is, or that its robot file names, is taken as it stands;
another robot is converted. What the format cannot say is told, with the share of the gap it is.
Exit code: 0 done, 1 the report names no effect, or none that the format can say; 2 bad input.")]
pub struct GapApplyArguments {
    /// Report of `gap diagnose`
    #[arg(long, value_name = "FILE")]
    pub report: PathBuf,
    /// Robot that was diagnosed: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: String,
    /// File to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// What to write it for
    #[arg(long, value_name = "NAME", default_value = "toml")]
    pub format: ApplyFormat,
    /// Write what has no name too, as a torque table over the variable that holds most of it; what no table holds is told
    #[arg(long)]
    pub remaining: bool,
    /// Where to write the changes as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// Whose file is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ApplyFormat {
    /// Robot file
    Toml,
    /// MuJoCo model
    Mjcf,
    /// URDF
    Urdf,
    /// Actuator configuration of Isaac Lab, as Python text
    Isaaclab,
}

/// `flexspline gap repeats`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline gap repeats --recording first.mcap second.mcap third.mcap
  flexspline gap repeats --recording trials/*.parquet --json repeats.json

Repeats had the same reference in every joint; where none was recorded the same commanded torque, else bit for bit the same
measured torque. What differs between them is nobody's model error: no simulation comes nearer than that. Each repeat is
judged against the others: it differs where chance would hardly make one like it. In one group in a hundred of repeats that
are alike one is said to differ. `next to any` is how far a repeat is from the next one over how far any two are apart, in the order
of the files: well below 1 they drift, as while a robot warms up. Five repeats find what is coarse, ten what matters;
three are the least. `gap diagnose` takes its noise floor from repeats too.
Exit code: 0 done, whatever was found; 2 bad input, or no input was repeated three times.")]
pub struct GapRepeatsArguments {
    /// Recording, or CSV or Parquet log with its mapping file beside it; may be given again
    #[arg(long, required = true, num_args = 1.., value_name = "FILE")]
    pub recording: Vec<PathBuf>,
    /// Where to write the result as JSON too; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `flexspline gap suggest`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline gap suggest --report gap/report.json --robot arm.toml --out next.toml
  flexspline gap suggest --effects two.toml --robot shd17 --out next.toml
  flexspline run --robot arm.toml --trajectory next.toml --duration 30s

Tries slow ramps, sweeps, chirps, reversals at two loads, moves from point to point and a warm repeat on the nominal plant, and
takes the one on which the least separable pair is furthest apart. d² is the squared whitened difference that the other effect
and the robot file's tolerances leave; below 9 nobody can tell two effects apart.
Exit code: 0 done, 1 nothing is confused or no motion helps, 2 bad input.")]
pub struct GapSuggestArguments {
    /// Report of `gap diagnose`: its confusable pairs are to be told apart
    #[arg(long, value_name = "FILE", conflicts_with = "effects")]
    pub report: Option<PathBuf>,
    /// Instead of a report, a file of effects as `run --inject` takes it: every two of one joint, at their sizes
    #[arg(long, value_name = "FILE")]
    pub effects: Option<PathBuf>,
    /// Robot that was diagnosed: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: String,
    /// Trajectory file to write, TOML
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// How long the trajectory shall last
    #[arg(long, default_value = "30s", value_name = "D", value_parser = humantime::parse_duration)]
    pub duration: Duration,
    /// Where to write the choice as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `flexspline gap watch`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline gap watch                                            the instance `default`, through its relay
  flexspline gap watch --recording run.mcap --robot arm.toml      along a recording
  flexspline gap watch --emulate 2min --robot shd17 --inject gap.toml    the emulator in virtual time; start_s says when

Each joint learns from its first --window what it is like; what is already there is named and taken as given. Then its residual
against the simulation is watched, and what makes it grow is diagnosed, first after 4 s.
Exit code: 0 done, whatever was found; 1 the emulated loop stopped for safety; 2 bad input.")]
pub struct GapWatchArguments {
    /// Name of the running instance
    #[arg(long, default_value = "default", value_name = "NAME")]
    pub instance: String,
    /// Recording to watch instead, or a log with its mapping file beside it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["instance", "emulate"])]
    pub recording: Option<PathBuf>,
    /// Watch the emulator in virtual time instead, for so long
    #[arg(long, value_name = "D", value_parser = humantime::parse_duration, conflicts_with = "instance")]
    pub emulate: Option<Duration>,
    /// Robot file to watch against; that of the instance if not given
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: Option<String>,
    /// With --emulate: trajectory, the robot's own if not given
    #[arg(long, value_name = "NAME|FILE", requires = "emulate")]
    pub trajectory: Option<String>,
    /// With --emulate: file of effects to add to the plant
    #[arg(long, value_name = "FILE", requires = "emulate")]
    pub inject: Option<PathBuf>,
    /// With --emulate: seed of everything random
    #[arg(long, default_value_t = 1, value_name = "N", requires = "emulate")]
    pub seed: u64,
    /// What a joint learns from
    #[arg(long, default_value = "20s", value_name = "D", value_parser = humantime::parse_duration)]
    pub window: Duration,
    /// Mean time between two diagnoses for nothing, of each joint
    #[arg(long, default_value = "10h", value_name = "D", value_parser = humantime::parse_duration)]
    pub between_false: Duration,
    /// Where to write everything that was told as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `flexspline gap round`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline gap round --robot shd17 --inject effects.toml
  flexspline gap round --robot arm.toml --inject effects.toml --trajectory sweep.toml --tracked work.csv --json rounds.json

Every [[effect]] of the file is a round of its own, in virtual time: the plant gets the effect, the diagnosis sees a recording
of --trajectory, its effects are written into the robot file, and the control follows --tracked on the plant with the effect,
with the file as it was and with the mended one.
Exit code: 0 done, whatever was found; 1 a loop stopped for safety; 2 bad input.")]
pub struct GapRoundArguments {
    /// Robot: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: String,
    /// File of effects, as `run --inject` takes it
    #[arg(long, value_name = "FILE")]
    pub inject: PathBuf,
    /// Trajectory of the recording that is diagnosed
    #[arg(long, default_value = "multi_sine", value_name = "NAME|FILE")]
    pub trajectory: String,
    /// Trajectory that is then followed
    #[arg(long, default_value = "sine", value_name = "NAME|FILE")]
    pub tracked: String,
    /// How long each trajectory is run, as 30s
    #[arg(long, default_value = "30s", value_name = "D", value_parser = humantime::parse_duration)]
    pub duration: Duration,
    /// Seed of everything random in the emulator
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
    /// Where to write the rounds as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}
