//! The whole control loop with the emulated plant in one process: lockstep without processes.
//!
//! The same cores as in a run ([`rt_loop::cycle`], [`services::controller`], [`services::estimators`],
//! [`plant_emulator::drives`]) pass their messages by hand instead of through shared memory. A twin's recording has the
//! same bytes as that of `flexspline run --mode lockstep`; a test holds it to that.
//!
//! ```no_run
//! # fn example(run: &shm_types::instance::RunConfig) -> Result<(), Box<dyn std::error::Error>> {
//! let robot = robot::load("pa10")?;
//! let trajectory = motion::load("lemniscate", &robot)?;
//! let report = twin::record(run, twin::Robots::same(&robot), trajectory, &[], |_cycle| true)?;
//! println!("{:?}", report.end_effector_error_m);
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]

use motion::Trajectory;
use plant_emulator::drives::EmulatedDrives;
use plant_emulator::process::emulated_plant;
use plant_emulator::{Plant, PlantError, PlantParameters};
use recording::{CycleRow, WriteError, Writer};
use robot::{Injection, Robot};
use rt_loop::config::cycle_config;
use rt_loop::cycle::{CycleInput, CycleState, Orders};
use rt_loop::driver::DriveFault;
use rt_loop::statistics::{Counters, CycleTimes};
use rt_loop::status::loop_status;
use services::controller::Controller;
use services::estimators::{Estimators, EstimatorsError};
use services::feedforward::FeedforwardError;
use services::relay::{CycleMessages, record_row, recording_header};
use services::tracking::{Tracking, TrackingReport};
use shm_types::instance::RunConfig;
use shm_types::messages::{DriveCommand, DriveMode, DriveSample, Header, PlantTruth};

/// No motor of an arm turns this far, motor side: beyond it the plant's numbers mean nothing.
const DIVERGED_RAD: f64 = 1e6;

/// Why a twin cannot run.
#[derive(Debug, thiserror::Error)]
pub enum TwinError {
    /// The plant cannot be built.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// This robot cannot be controlled this way.
    #[error(transparent)]
    Feedforward(#[from] FeedforwardError),
    /// An estimator cannot be built.
    #[error(transparent)]
    Estimator(#[from] EstimatorsError),
    /// The recording cannot be written.
    #[error(transparent)]
    Recording(#[from] WriteError),
    /// The emulated plant has left what it can compute.
    #[error(
        "the emulated plant diverged at {time_s:.3} s; its effects are stronger than any gear would bear"
    )]
    Diverged {
        /// When.
        time_s: f64,
    },
    /// The loop stopped for safety.
    #[error("the loop stopped for safety at {time_s:.3} s: {fault}")]
    SafeStop {
        /// When.
        time_s: f64,
        /// Why.
        fault: String,
    },
}

/// What the emulated arm is made from and what the controller knows. They differ where a model was identified.
#[derive(Clone, Copy, Debug)]
pub struct Robots<'a> {
    /// The plant deviates from this one.
    pub plant: &'a Robot,
    /// Limits, feedforward and estimators use this one.
    pub model: &'a Robot,
}

impl<'a> Robots<'a> {
    /// Both from one file, as `flexspline run` has it.
    pub fn same(robot: &'a Robot) -> Self {
        Self {
            plant: robot,
            model: robot,
        }
    }
}

/// Runs `run.cycles` cycles and hands every cycle's messages to `each`, until it returns `false`.
///
/// Of `run` only session, period, cycles, control mode and options, estimators, seed and initial position count.
///
/// # Errors
/// [`TwinError`], also when the loop stopped for safety.
pub fn simulate(
    run: &RunConfig,
    robots: Robots<'_>,
    trajectory: Trajectory,
    injections: &[Injection],
    each: impl FnMut(&CycleMessages) -> bool,
) -> Result<(), TwinError> {
    let plant = emulated_plant(robots.plant, run, injections)?;
    simulate_plant(run, robots.model, plant, trajectory, each)
}

/// Runs as [`simulate`] does on a plant that is what the robot file says and nothing else: the nominal model.
///
/// # Errors
/// [`TwinError`], also when the loop stopped for safety.
pub fn simulate_nominal(
    run: &RunConfig,
    robot: &Robot,
    trajectory: Trajectory,
    each: impl FnMut(&CycleMessages) -> bool,
) -> Result<(), TwinError> {
    let plant = Plant::new(
        robot,
        &PlantParameters::nominal(robot),
        &[],
        run.seed,
        &run.initial_position_rad,
        run.period_ns as f64 * 1e-9,
    )?;
    simulate_plant(run, robot, plant, trajectory, each)
}

/// Runs as [`simulate`] does on a plant that was built before, with `robot` as the controller's model.
///
/// # Errors
/// [`TwinError`], also when the loop stopped for safety.
pub fn simulate_plant(
    run: &RunConfig,
    robot: &Robot,
    plant: Plant,
    trajectory: Trajectory,
    each: impl FnMut(&CycleMessages) -> bool,
) -> Result<(), TwinError> {
    simulate_drives(run, robot, drives(run, robot, plant), trajectory, each)
}

/// The drives of a run, braked, in front of a plant that was built before.
pub fn drives(run: &RunConfig, robot: &Robot, plant: Plant) -> EmulatedDrives {
    let mut drives = EmulatedDrives::new(plant, run.session, robot, run.period_ns);
    drives.take(brake(run, robot.joints.len()));
    drives
}

/// What a twin moves: drives with a plant behind them, at whose latches it stands.
pub trait Drives {
    /// What the drives latched for a cycle, and what is true then.
    ///
    /// # Errors
    /// [`DriveFault`]: nothing came of any joint.
    fn measure(
        &mut self,
        cycle: u64,
        planned_ns: u64,
    ) -> (Result<DriveSample, DriveFault>, PlantTruth);

    /// Takes the command of this cycle; whether it could be sent.
    ///
    /// # Errors
    /// [`DriveFault`]: it could not.
    fn take(&mut self, command: DriveCommand) -> Result<(), DriveFault>;

    /// Moves on to the next latch.
    fn advance(&mut self);
}

impl Drives for EmulatedDrives {
    fn measure(
        &mut self,
        _: u64,
        planned_ns: u64,
    ) -> (Result<DriveSample, DriveFault>, PlantTruth) {
        let (sample, truth) = Self::measure(self, planned_ns);
        (Ok(sample), truth)
    }

    fn take(&mut self, command: DriveCommand) -> Result<(), DriveFault> {
        Self::take(self, command);
        Ok(())
    }

    fn advance(&mut self) {
        Self::advance(self);
    }
}

/// Runs as [`simulate_plant`] does with [`drives`] that may have faults of their own, or with others.
///
/// # Errors
/// [`TwinError`], also when the loop stopped for safety.
pub fn simulate_drives(
    run: &RunConfig,
    robot: &Robot,
    mut drives: impl Drives,
    trajectory: Trajectory,
    mut each: impl FnMut(&CycleMessages) -> bool,
) -> Result<(), TwinError> {
    let config = cycle_config(run, robot);
    let period_s = run.period_ns as f64 * 1e-9;
    let mut controller = Controller::new(run, robot.clone(), trajectory)?;
    let mut estimators = Estimators::new(robot, &run.estimators, period_s)?;
    let joint_count = robot.joints.len();
    let mut state = CycleState::default();
    for cycle in 0..run.cycles {
        let planned_ns = cycle * run.period_ns;
        let (latched, truth) = drives.measure(cycle, planned_ns);
        if let Ok(latched) = &latched {
            let position_rad = &latched.readings.motor_position_rad[..joint_count];
            // false for NaN too
            if !position_rad.iter().all(|angle| angle.abs() < DIVERGED_RAD) {
                return Err(TwinError::Diverged {
                    time_s: planned_ns as f64 * 1e-9,
                });
            }
        }
        let admitted = latched.and_then(|latched| {
            state.admit(&config, cycle, &latched)?;
            Ok(latched)
        });
        let sample = admitted
            .as_ref()
            .ok()
            .map(|latched| state.sensor_sample(&config, cycle, latched));
        let command = sample.and_then(|sample| controller.command(&sample));
        let estimate = sample.map(|sample| estimators.estimate(&sample));
        if let Some(estimate) = estimate {
            controller.take_estimate(estimate);
        }
        let output = state.step(
            &config,
            &CycleInput {
                cycle,
                planned_ns,
                sample: admitted.as_ref().map_err(|fault| *fault),
                command: command.as_ref(),
                orders: Orders::default(),
            },
        );
        let taken = drives.take(output.drive_command);
        state.written(taken);
        let status = loop_status(
            &state,
            &output,
            &CycleTimes::default(),
            &Counters::default(),
        );
        let messages = CycleMessages {
            cycle,
            sample,
            command,
            estimate,
            status: Some(status),
            truth: Some(truth),
        };
        if !each(&messages) {
            return Ok(());
        }
        if state.state.is_latched() {
            let reason = state.fault.map(|fault| fault.sentence(&config.joint_names));
            return Err(TwinError::SafeStop {
                time_s: planned_ns as f64 * 1e-9,
                fault: reason.unwrap_or_default(),
            });
        }
        drives.advance();
    }
    Ok(())
}

/// Runs as [`simulate`] does and writes `run.record`, if it names a file. `each` is told every cycle and may end the run.
///
/// # Errors
/// [`TwinError`]; what was recorded up to then stays.
pub fn record(
    run: &RunConfig,
    robots: Robots<'_>,
    trajectory: Trajectory,
    injections: &[Injection],
    mut each: impl FnMut(u64) -> bool,
) -> Result<TrackingReport, TwinError> {
    let robot = robots.model;
    let mut writer = match &run.record {
        Some(path) => Some(Writer::create(path, &recording_header(run, robot))?),
        None => None,
    };
    let mut tracking = Tracking::new(robot);
    let (mut joints, mut truth) = (Vec::new(), Vec::new());
    let mut written = Ok(());
    let simulated = simulate(run, robots, trajectory, injections, |messages| {
        tracking.add(messages);
        let loop_cycle = record_row(messages, robot.joints.len(), &mut joints, &mut truth);
        if let (Some(writer), Some(loop_cycle)) = (&mut writer, &loop_cycle) {
            written = writer.write_cycle(&CycleRow {
                cycle: messages.cycle,
                time_ns: messages.cycle * run.period_ns,
                loop_cycle: Some(loop_cycle),
                joints: &joints,
                truth: (!truth.is_empty()).then_some(truth.as_slice()),
            });
        }
        written.is_ok() && each(messages.cycle)
    });
    if let Some(writer) = writer {
        writer.finish()?;
    }
    written?;
    simulated?;
    Ok(tracking.report())
}

/// The loop's first command: it tells the drives its clock, and keeps the brakes closed.
fn brake(run: &RunConfig, joint_count: usize) -> DriveCommand {
    DriveCommand {
        header: Header {
            session: run.session,
            cycle: 0,
            measured_at_ns: 0,
            joint_count: joint_count as u64,
        },
        mode: DriveMode::Braked as u32,
        ..DriveCommand::default()
    }
}
