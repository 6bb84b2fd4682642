//! What can be typed after `flexspline run`.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use shm_types::control_options::{FrictionVelocity, StiffnessTorque};
use shm_types::instance::{ControlMode, Mode, Wait};

/// `flexspline run`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline run                                     the PA-10 along its lemniscate for 20 s
  flexspline run --robot shd17 --duration 5s         the single test joint
  flexspline run --mode lockstep --record run.mcap   as fast as it goes, the same bytes every time
  flexspline run --inject gap.toml --json out.json   with effects added to the plant
  flexspline run --commission --driver ethercat --robot arm.toml   new drives, step by step, to the first small sine

Ctrl-C stops cleanly: brakes first, then the services, then the recording is closed.
Exit code: 0 done, 1 the loop stopped for safety, a process could not be kept alive or a step of --commission was not passed,
2 bad input.")]
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
    /// Try new drives step by step, each confirmed at the terminal; with =STEP that step alone, once all before it are passed
    ///
    /// The steps, in their order: scan, check, brakes-closed, brakes-open, zero-torque, sign, limits, emergency-stop,
    /// operator-stop, first-torque, sine. Nothing gets torque before first-torque. What was passed is kept beside the robot
    /// file, and a walk that was ended goes on where it stood; a robot file that has changed begins again. --json writes the
    /// same and what was refused. docs/commissioning.md says what each step is for.
    #[arg(long, value_name = "STEP", num_args = 0..=1, require_equals = true, default_missing_value = "", hide_default_value = true,
          conflicts_with_all = ["record", "duration", "mode", "trajectory"])]
    pub commission: Option<String>,
    /// Where --commission keeps what was passed; ROBOT.commission.json beside the robot file if not given
    #[arg(long, value_name = "FILE", requires = "commission")]
    pub commission_file: Option<PathBuf>,
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
    /// Cycles a second; control.rate_hz of the robot file if not given, 1500 where it has no `[control]`
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
