//! What can be typed.

use std::path::PathBuf;
use std::time::Duration;

use blind::CaseKind;
use clap::{Args, Parser, Subcommand, ValueEnum};
use identification::experiment::{PA10_2003, PA10_2005, Protocol};
use shm_types::control_options::{FrictionVelocity, StiffnessTorque};
use shm_types::instance::{ControlMode, Mode, Wait};

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
    /// Put faults into a running system and print what it did about each
    Faults(FaultsArguments),
    /// Where simulation and robot part, which effect causes it, and how far that can be mended
    #[command(subcommand)]
    Gap(GapCommand),
    /// One process of a running instance; started by `run`
    #[command(hide = true)]
    Process(ProcessArguments),
}

/// `flexspline run`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline run                                     the PA-10 along its lemniscate for 20 s
  flexspline run --robot shd17 --duration 5s         the single test joint
  flexspline run --mode lockstep --record run.mcap   as fast as it goes, the same bytes every time
  flexspline run --inject gap.toml --json out.json   with effects added to the plant

Ctrl-C stops cleanly: brakes first, then the services, then the recording is closed.
Exit code: 0 done, 1 the loop stopped for safety or a process could not be kept alive, 2 bad input.")]
pub struct RunArguments {
    /// Robot: pa10, shd17, or a robot file
    #[arg(long, default_value = "pa10", value_name = "NAME|FILE")]
    pub robot: String,
    /// Driver that talks to the hardware
    #[arg(long, default_value = "emulator", value_name = "NAME")]
    pub driver: String,
    /// Trajectory: lemniscate, trapezoid, sine, multi_sine, hold, or a trajectory file; the robot's own if not given
    #[arg(long, value_name = "NAME|FILE")]
    pub trajectory: Option<String>,
    /// How long to run, as 15s or 500ms
    #[arg(long, default_value = "20s", value_name = "D", value_parser = humantime::parse_duration)]
    pub duration: Duration,
    /// What the drives are commanded: torque, or velocity held by their own loops
    #[arg(long, value_enum, default_value_t = ControlArgument::Torque)]
    pub control: ControlArgument,
    /// Velocity that friction is fed forward on: the desired one, as the papers do, or the joint's own
    ///
    /// `measured` takes the level of friction at the speed the joint really has, observed from its motor encoder, in the
    /// direction it shall move: never more than the model says is there, and no torque at standstill without desired motion.
    /// It ends the stick-slip of joints whose friction falls with speed.
    #[arg(long, value_enum, default_value_t = FrictionVelocityArgument::Desired, value_name = "WHICH")]
    pub friction_velocity: FrictionVelocityArgument,
    /// Load at which load-dependent friction is taken: the model's gravity, or the measured torsion of the gear
    ///
    /// `torsion` needs a link encoder and a stiffness on every joint. The gear's kinematic error is read as load.
    #[arg(long, value_enum, default_value_t = StiffnessTorqueArgument::Load, value_name = "WHICH")]
    pub stiffness_torque: StiffnessTorqueArgument,
    /// Share of the model error seen by the torque estimator that is fed forward, 0 to 1
    ///
    /// Learned over 0.2 s while a joint moves as desired, held at standstill, at most half of the joint's modelled friction.
    /// Contact gets stiffer with it.
    #[arg(long, default_value_t = 0.0, value_name = "GAIN")]
    pub correction: f64,
    /// Torque estimators that run, as residual,fusion; all that the robot file has parameters for if not given
    ///
    /// residual, structural_damping, compliance, taghirad, disturbance_observer, gaussian_process, fusion. Contacts are
    /// found with fusion.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub estimators: Vec<String>,
    /// Whether time is the wall clock's or waits for everybody
    #[arg(long, value_enum, default_value_t = ModeArgument::Realtime)]
    pub mode: ModeArgument,
    /// Robot the emulated plant is made from, where --robot is a model identified on it; --robot if not given
    #[arg(long, value_name = "NAME|FILE")]
    pub plant: Option<String>,
    /// File of effects to add to the emulated plant, and of pushes from outside
    #[arg(long, value_name = "FILE")]
    pub inject: Option<PathBuf>,
    /// Recording to write; recordings/ROBOT-TRAJECTORY-TIME.mcap if not given
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Where to write the results as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
    /// Name of this instance; two robots need two names
    #[arg(long, default_value = "default", value_name = "NAME")]
    pub instance: String,
    /// Seed of everything random in the emulator
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
    /// How loop and services wait for each other: sleeping, or spinning on cores of their own
    #[arg(long, value_enum, default_value_t = WaitArgument::Block)]
    pub wait: WaitArgument,
    /// Cycles a second; control.rate_hz of the robot file if not given, 1500 where it has no [control]
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// Core that the loop has to itself; the last one if not given
    ///
    /// In lockstep the core that loop, services and emulator share: the one that is free at the start if not given.
    #[arg(long, value_name = "N")]
    pub loop_core: Option<usize>,
    /// Wake the loop so long before each cycle and watch the clock until its instant; 100us where no time is given
    ///
    /// A wake-up that is late by less than this is not late any more. It takes that share of the loop's core: 15 % for 100us
    /// at 1500 cycles a second. Without this option the loop sleeps to the instant.
    #[arg(long, value_name = "D", num_args = 0..=1, default_value = "0s", default_missing_value = "100us", value_parser = humantime::parse_duration)]
    pub wake_early: Duration,
}

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

Exit code: 0 done, whatever was found; 2 bad input.")]
pub struct GapDiagnoseArguments {
    /// The simulation: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: String,
    /// The robot: recording, or CSV or Parquet log with its mapping file beside it; may be given again
    #[arg(long, required = true, num_args = 1.., value_name = "FILE")]
    pub recording: Vec<PathBuf>,
    /// Folder for report.json and report.html
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Where to write the report as JSON too; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `flexspline gap apply`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline gap apply --report gap/report.json --robot arm.toml --out mended.toml

Everything else in the file stays as it was written, comments included. A change of a value that the file has is added to
that value; what was changed is printed. Feedforward, emulator and diagnosis take the new file.
Exit code: 0 done, 1 the report names no effect, 2 bad input.")]
pub struct GapApplyArguments {
    /// Report of `gap diagnose`
    #[arg(long, value_name = "FILE")]
    pub report: PathBuf,
    /// Robot that was diagnosed: pa10, shd17, or a robot file
    #[arg(long, value_name = "NAME|FILE")]
    pub robot: String,
    /// Robot file to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Where to write the changes as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
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

/// `flexspline gap blind`
#[derive(Debug, Subcommand)]
#[command(after_help = "\
Examples:
  flexspline gap blind make --out cases --cases 200 --seed 7
  flexspline gap blind run --cases cases --out predictions
  flexspline gap blind score --cases cases --predictions predictions --report scores.html

Cases are made by the emulated plant, labels put away in labels.sealed before anybody predicts; seal.json holds a salted
SHA-256 of each.
Exit code: 0 done, 2 bad input.")]
pub enum BlindCommand {
    /// Make cases and seal their labels
    Make(BlindMakeArguments),
    /// Diagnose cases from robot file and recording alone
    Run(BlindRunArguments),
    /// Open the seal and score predictions
    Score(BlindScoreArguments),
}

/// `flexspline gap blind run`
#[derive(Debug, Args)]
pub struct BlindRunArguments {
    /// Folder of cases
    #[arg(long, value_name = "DIR")]
    pub cases: PathBuf,
    /// Folder for the predictions; cases that have one there are not diagnosed again
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Predict by a simpler method instead, for comparison
    #[arg(long, value_enum, value_name = "METHOD")]
    pub baseline: Option<BaselineMethod>,
    /// Where to write what was done as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// A simpler method than the diagnosis.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum BaselineMethod {
    /// The effect whose response alone explains most of the residual
    LargestR2,
    /// The effect with the smallest Bayesian information criterion, samples taken for independent
    Bic,
}

/// `flexspline gap blind score`
#[derive(Debug, Args)]
pub struct BlindScoreArguments {
    /// Folder of cases, with seal.json and labels.sealed
    #[arg(long, value_name = "DIR")]
    pub cases: PathBuf,
    /// Folder of predictions: CASE/report.json
    #[arg(long, value_name = "DIR")]
    pub predictions: PathBuf,
    /// Folder of predictions to stand beside them; may be given again
    #[arg(long, value_name = "DIR")]
    pub baseline: Vec<PathBuf>,
    /// Fit the true effects of each case as well, to hold the shrink against; takes as long as the diagnosis
    #[arg(long)]
    pub oracle: bool,
    /// Page to write, with figures
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Where to write the scores as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `flexspline gap blind make`
#[derive(Debug, Args)]
pub struct BlindMakeArguments {
    /// Folder for the cases; a new one
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// How many cases
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub cases: u32,
    /// Makes the same cases again
    #[arg(long, value_name = "N")]
    pub seed: u64,
    /// Only cases of this kind; the mix of all if not given
    #[arg(long, value_enum, value_name = "KIND")]
    pub kind: Option<CaseKindArgument>,
    /// Share of cases about the seven-joint arm, 0 to 1; the others are one-joint benches
    #[arg(long, default_value_t = 0.25, value_name = "SHARE", value_parser = share)]
    pub seven_joints: f64,
    /// Length of each recording
    #[arg(long, default_value = "30s", value_name = "D", value_parser = humantime::parse_duration)]
    pub duration: Duration,
    /// Cases made at a time; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    /// Where to write what was made as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

fn share(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|share| (0.0..=1.0).contains(share))
        .ok_or_else(|| "must be between 0 and 1".to_owned())
}

/// See [`CaseKind`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum CaseKindArgument {
    /// Nothing but tolerance and noise
    NoGap,
    /// One effect of the list
    OneEffect,
    /// Two effects of the list
    TwoEffects,
    /// A law on no list
    Unknown,
    /// An effect that the motion cannot tell from another
    Pair,
}

impl From<CaseKindArgument> for CaseKind {
    fn from(argument: CaseKindArgument) -> Self {
        match argument {
            CaseKindArgument::NoGap => Self::NoGap,
            CaseKindArgument::OneEffect => Self::OneEffect,
            CaseKindArgument::TwoEffects => Self::TwoEffects,
            CaseKindArgument::Unknown => Self::Unknown,
            CaseKindArgument::Pair => Self::Pair,
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

/// `flexspline reproduce`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline reproduce pa10-2005                           identifies an emulated arm, then tracks with what was found
  flexspline reproduce pa10-2003 --identified arm/identified.toml   with a model identified before, on the same --seed
  flexspline reproduce pa10-2005 --arms 3                  on three arms, results with their range
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
    /// Seed of the first arm, or joint, and of everything random on it
    #[arg(long, default_value_t = 11, value_name = "N")]
    pub seed: u64,
    /// Where to write the results as JSON too; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
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

/// `flexspline recording`
#[derive(Debug, Subcommand)]
#[command(after_help = "\
A recording is an MCAP file of `run`, or a CSV or Parquet file with one row per control cycle. Columns are named
JOINT.SIGNAL, or a mapping file NAME.toml beside NAME.csv says which column is which signal.
Exit code: 0 done, 1 `info --robot` found errors or the twin stopped for safety, 2 bad input.")]
pub enum RecordingCommand {
    /// Print what is in recordings, how good it is, and what it cannot support
    Info(RecordingInfoArguments),
    /// Turn a CSV or Parquet log into an MCAP recording
    Import(RecordingImportArguments),
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
    /// Where to write the same as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `flexspline recording import`
#[derive(Debug, Args)]
pub struct RecordingImportArguments {
    /// CSV or Parquet log
    pub file: PathBuf,
    /// Which column is which signal; NAME.toml beside the log if not given
    #[arg(long, value_name = "FILE")]
    pub mapping: Option<PathBuf>,
    /// Recording to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

/// `flexspline recording export`
#[derive(Debug, Args)]
pub struct RecordingExportArguments {
    /// Recording
    pub file: PathBuf,
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

/// `flexspline faults`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline faults                    every fault, 1000 service kills, 200 start-stop rounds: about half an hour
  flexspline faults --short            a few of each
  flexspline faults --part virtual     frames, readings, commands and orders, in virtual time: the same figures every time
  flexspline faults --part kills --kills 100
  flexspline faults --part soak        a day of control in lockstep: hours; Ctrl-C ends it early

Real processes are killed and frozen, only those of the suite's own runs. Some faults need root and are skipped without.
Exit code: 0 everything ended as documented, 1 something did not, 2 bad input.")]
pub struct FaultsArguments {
    /// Robot: pa10, shd17, or a robot file
    #[arg(long, default_value = "pa10", value_name = "NAME|FILE")]
    pub robot: String,
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
    /// Frames, readings, commands and orders, in virtual time
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

/// See [`Mode`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ModeArgument {
    /// By the wall clock
    Realtime,
    /// Virtual time: a cycle ends when every process has done its part
    Lockstep,
}

impl From<ModeArgument> for Mode {
    fn from(argument: ModeArgument) -> Self {
        match argument {
            ModeArgument::Realtime => Self::Realtime,
            ModeArgument::Lockstep => Self::Lockstep,
        }
    }
}

/// See [`ControlMode`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ControlArgument {
    /// Model feedforward and low-gain feedback, as torque
    Torque,
    /// The reference's velocity, as in identification
    Velocity,
}

impl From<ControlArgument> for ControlMode {
    fn from(argument: ControlArgument) -> Self {
        match argument {
            ControlArgument::Torque => Self::Torque,
            ControlArgument::Velocity => Self::Velocity,
        }
    }
}

/// See [`FrictionVelocity`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FrictionVelocityArgument {
    /// The reference's
    Desired,
    /// The joint's own, observed
    Measured,
}

impl From<FrictionVelocityArgument> for FrictionVelocity {
    fn from(argument: FrictionVelocityArgument) -> Self {
        match argument {
            FrictionVelocityArgument::Desired => Self::Desired,
            FrictionVelocityArgument::Measured => Self::Measured,
        }
    }
}

/// See [`StiffnessTorque`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum StiffnessTorqueArgument {
    /// Gravity of the model at the reference
    Load,
    /// Torque from the measured torsion
    Torsion,
}

impl From<StiffnessTorqueArgument> for StiffnessTorque {
    fn from(argument: StiffnessTorqueArgument) -> Self {
        match argument {
            StiffnessTorqueArgument::Load => Self::Load,
            StiffnessTorqueArgument::Torsion => Self::Torsion,
        }
    }
}

/// See [`Wait`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum WaitArgument {
    /// Sleep until woken
    Block,
    /// Look without pause
    Spin,
}

impl From<WaitArgument> for Wait {
    fn from(argument: WaitArgument) -> Self {
        match argument {
            WaitArgument::Block => Self::Block,
            WaitArgument::Spin => Self::Spin,
        }
    }
}

/// `flexspline doctor`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline doctor                    everything, with two seconds of wake-ups on the loop's core
  flexspline doctor --no-probe         only what can be read
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
    /// Where to write the findings as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

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

/// `flexspline process`
#[derive(Debug, Args)]
pub struct ProcessArguments {
    /// Which process
    #[arg(value_enum)]
    pub role: RoleArgument,
    /// Name of the instance it belongs to
    #[arg(long)]
    pub instance: String,
}

/// The processes of an instance, and the one that cleans up after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names say it; see the roles in shm-types")]
pub enum RoleArgument {
    Loop,
    Emulator,
    Estimator,
    Feedforward,
    Relay,
    Janitor,
}
