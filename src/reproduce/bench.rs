//! One motion of the emulated arm under one controller, in virtual time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressStyle};
use motion::{Reference, Trajectory};
use services::feedforward::Feedforward;
use services::relay::CycleMessages;
use services::tracking::{Tracking, TrackingReport};
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use shm_types::messages::{LoopState, PerJoint};
use signal_hook::consts::{SIGINT, SIGTERM};
use twin::{Robots, TwinError};
use virtual_drives::Kind;

use super::controllers::Controller;
use super::drives::OnBus;
use crate::error::CliError;

/// The drives' rate, as in a run.
const PERIOD_NS: u64 = 666_667;
/// Cycles between two rows that are kept: a hundred rows a second draw every figure.
const ROW_CYCLES: u64 = 15;
/// Time between two rows.
pub const ROW_S: f64 = (ROW_CYCLES * PERIOD_NS) as f64 * 1e-9;
/// Cycles between two looks at Ctrl-C and the progress bar: one second.
const LOOK_CYCLES: u64 = 1500;

/// What one instant of a run looked like, joint side.
#[derive(Clone, Copy, Debug, Default)]
pub struct Row {
    /// Since the start.
    pub time_s: f64,
    /// Where the joints should be.
    pub reference_rad: PerJoint,
    /// How fast they should move.
    pub reference_rad_s: PerJoint,
    /// Where the links truly are.
    pub link_rad: PerJoint,
    /// What the feedback added.
    pub feedback_nm: PerJoint,
    /// What the model gave for gravity.
    pub gravity_nm: PerJoint,
    /// For friction.
    pub friction_nm: PerJoint,
    /// For what load changes about friction.
    pub stiffness_nm: PerJoint,
}

/// One run.
#[derive(Clone, Debug)]
pub struct Tracked {
    /// Sums over every cycle.
    pub sums: TrackingReport,
    /// A hundred a second.
    pub rows: Vec<Row>,
    /// When and why the loop stopped for safety, if it did.
    pub stopped: Option<String>,
    /// Of all cycles, in how many each joint's command was cut to its limit.
    pub limited: Vec<f64>,
}

/// A motion and how long it takes.
#[derive(Clone, Debug)]
pub struct Course {
    /// What the arm does.
    pub trajectory: Trajectory,
    /// For how long.
    pub duration_s: f64,
}

/// The emulated arm behind drives of a kind, with the bar that shows how far it is.
pub struct Bench {
    kind: Kind,
    stop: Arc<AtomicBool>,
    bar: ProgressBar,
}

impl Bench {
    /// Ctrl-C ends the run that is going on.
    ///
    /// # Errors
    /// [`CliError::Input`] if signals cannot be caught.
    pub fn new(kind: Kind) -> Result<Self, CliError> {
        let stop = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(CliError::input)?;
        }
        let bar = ProgressBar::new_spinner();
        bar.set_style(
            ProgressStyle::with_template("{spinner} {msg}: {pos} s of motion in {elapsed}")
                .unwrap_or_else(|_| ProgressStyle::default_spinner()),
        );
        Ok(Self { kind, stop, bar })
    }

    /// Says what is being done.
    pub fn announce(&self, what: impl Into<String>) {
        self.bar.set_message(what.into());
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    /// Runs `course` on the arm of this seed. A loop that stops for safety is a result, not an error.
    ///
    /// # Errors
    /// [`CliError`] if the twin cannot run, or Ctrl-C was pressed.
    pub fn track(
        &self,
        controller: &Controller,
        course: &Course,
        seed: u64,
    ) -> Result<Tracked, CliError> {
        let model = &controller.model;
        let run = run_config(controller, course, seed);
        let period_s = run.period_ns as f64 * 1e-9;
        let mut parts = Feedforward::new(
            model.clone(),
            course.trajectory.clone(),
            period_s,
            &controller.options,
        )
        .map_err(CliError::input)?;
        let mut sums = Tracking::new(model);
        let mut rows = Vec::new();
        let mut limited = vec![0.0; model.joints.len()];
        let mut interrupted = false;
        let each = |messages: &CycleMessages| {
            sums.add(messages);
            let limited_joints = messages.status.map_or(0, |status| status.limited_joints);
            for (joint, share) in limited.iter_mut().enumerate() {
                *share += ((limited_joints >> joint) & 1) as f64 / run.cycles as f64;
            }
            if let Some(sample) = &messages.sample {
                parts.command(sample);
            }
            if let Some(estimate) = messages.estimate {
                parts.take_estimate(estimate);
            }
            if messages.cycle.is_multiple_of(ROW_CYCLES) {
                rows.extend(row(messages, model, &parts));
            }
            if messages.cycle.is_multiple_of(LOOK_CYCLES) {
                self.bar.inc(1);
                interrupted = self.stop.load(Ordering::Relaxed);
            }
            !interrupted
        };
        let simulated = self.simulate(&run, controller, course.trajectory.clone(), each)?;
        if interrupted {
            return Err(CliError::Negative(
                "stopped; the same command identifies from where it was, and runs the experiments anew".to_owned(),
            ));
        }
        let stopped = match simulated {
            Ok(()) => None,
            Err(TwinError::SafeStop { time_s, fault }) => {
                Some(format!("at {time_s:.2} s: {fault}"))
            }
            Err(error) => return Err(CliError::input(error)),
        };
        Ok(Tracked {
            sums: sums.report(),
            rows,
            stopped,
            limited,
        })
    }

    fn simulate(
        &self,
        run: &RunConfig,
        controller: &Controller,
        trajectory: Trajectory,
        each: impl FnMut(&CycleMessages) -> bool,
    ) -> Result<Result<(), TwinError>, CliError> {
        let robots = Robots {
            plant: &controller.plant,
            model: &controller.model,
        };
        if self.kind == Kind::Emulator {
            return Ok(twin::simulate(run, robots, trajectory, &[], each));
        }
        let joints = robots.model.joints.len();
        let drives = virtual_drives::open(self.kind, robots.plant, run).map_err(CliError::input)?;
        let drives = OnBus::new(drives, run.session, joints, run.period_ns);
        Ok(twin::simulate_drives(
            run,
            robots.model,
            drives,
            trajectory,
            each,
        ))
    }
}

fn run_config(controller: &Controller, course: &Course, seed: u64) -> RunConfig {
    let mut start = Reference::default();
    course.trajectory.sample(0.0, &mut start);
    RunConfig {
        session: 1,
        robot: controller.name.to_owned(),
        driver: "emulator".to_owned(),
        trajectory: String::new(),
        plant: None,
        control: ControlMode::Torque,
        options: controller.options,
        estimators: Vec::new(),
        mode: Mode::Lockstep,
        period_ns: PERIOD_NS,
        cycles: (course.duration_s * 1e9 / PERIOD_NS as f64).ceil() as u64,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed,
        inject: None,
        record: None,
        command_deadline_ns: PERIOD_NS,
        cores: Vec::new(),
        initial_position_rad: start.position_rad[..controller.model.joints.len()].to_vec(),
    }
}

/// `None` while the loop is not running.
fn row(messages: &CycleMessages, model: &robot::Robot, parts: &Feedforward) -> Option<Row> {
    let sample = messages.sample.as_ref()?;
    let running = LoopState::from_raw(messages.status?.state) == Some(LoopState::Running);
    let (command, truth) = (messages.command.as_ref()?, messages.truth.as_ref()?);
    let mut row = Row {
        time_s: command.header.measured_at_ns as f64 * 1e-9,
        reference_rad: command.reference_position_rad,
        reference_rad_s: command.reference_velocity_rad_s,
        link_rad: truth.link_position_rad,
        ..Row::default()
    };
    for (joint, drive) in model.joints.iter().enumerate() {
        let torque = parts.torque_parts(joint, sample);
        row.feedback_nm[joint] = command.feedback_torque_nm[joint] * drive.gear_ratio;
        row.gravity_nm[joint] = torque.gravity_nm;
        row.friction_nm[joint] = torque.friction_nm;
        row.stiffness_nm[joint] = torque.stiffness_nm;
    }
    running.then_some(row)
}
