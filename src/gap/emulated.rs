//! Runs on the emulated plant in this process, kept in memory.

use motion::{Reference, Trajectory};
use recording::{Recording, Window};
use robot::{Injection, Robot};
use services::relay::{CycleMessages, record_row};
use services::tracking::{Tracking, TrackingReport};
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use twin::{Robots, TwinError};

use crate::error::CliError;
use crate::run::PERIOD_NS;

/// What was recorded, and how well the robot followed.
pub struct Emulated {
    /// As a recording has it: what only an emulator could know is left out.
    pub recording: Recording,
    /// How well the reference was followed.
    pub tracking: TrackingReport,
}

/// A trajectory for so long, with a seed of everything random.
pub struct Course {
    /// What is followed.
    pub trajectory: Trajectory,
    /// For so long.
    pub duration_s: f64,
    /// Of the sensors' noise.
    pub seed: u64,
}

impl Course {
    /// On the emulated plant of one robot, controlled by the model of another, with effects injected.
    ///
    /// # Errors
    /// [`CliError::Negative`] if the loop stopped for safety, [`CliError::Input`] if it cannot run.
    pub fn run(&self, robots: Robots<'_>, injections: &[Injection]) -> Result<Emulated, CliError> {
        let mut kept = Kept::new(robots.model);
        self.each(robots, injections, |messages| kept.add(messages))?;
        Ok(kept.finish())
    }

    /// The same, every cycle handed over as it comes until `each` returns `false`.
    ///
    /// # Errors
    /// As [`Course::run`].
    pub fn each(
        &self,
        robots: Robots<'_>,
        injections: &[Injection],
        each: impl FnMut(&CycleMessages) -> bool,
    ) -> Result<(), CliError> {
        let run = self.config(robots.model);
        let trajectory = self.trajectory.clone();
        twin::simulate(&run, robots, trajectory, injections, each).map_err(stopped)
    }

    /// On a plant that is what the robot file says and nothing else, until it is not wanted any more.
    ///
    /// # Errors
    /// As [`Course::run`].
    pub fn run_nominal(
        &self,
        robot: &Robot,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Emulated, CliError> {
        let (run, mut kept) = (self.config(robot), Kept::new(robot));
        let trajectory = self.trajectory.clone();
        let each = |m: &CycleMessages| kept.add(m) && is_wanted();
        twin::simulate_nominal(&run, robot, trajectory, each).map_err(stopped)?;
        Ok(kept.finish())
    }

    fn config(&self, robot: &Robot) -> RunConfig {
        let mut start = Reference::default();
        self.trajectory.sample(0.0, &mut start);
        RunConfig {
            session: 1,
            robot: robot.name.clone(),
            driver: "emulator".to_owned(),
            trajectory: String::new(),
            plant: None,
            control: ControlMode::Torque,
            options: ControlOptions::default(),
            estimators: vec!["residual".to_owned()],
            mode: Mode::Lockstep,
            period_ns: PERIOD_NS,
            cycles: (self.duration_s * 1e9 / PERIOD_NS as f64).round() as u64,
            wait: Wait::Block,
            wake_early_ns: 0,
            seed: self.seed,
            inject: None,
            record: None,
            command_deadline_ns: PERIOD_NS,
            cores: Vec::new(),
            initial_position_rad: start.position_rad[..robot.joints.len()].to_vec(),
        }
    }
}

fn stopped(error: TwinError) -> CliError {
    match error {
        TwinError::SafeStop { .. } | TwinError::Diverged { .. } => {
            CliError::Negative(error.to_string())
        }
        input => CliError::input(input),
    }
}

/// What a run leaves.
struct Kept {
    joints: usize,
    window: Window,
    tracking: Tracking,
    row: Vec<recording::JointCycle>,
    truth: Vec<recording::JointTruth>,
}

impl Kept {
    fn new(robot: &Robot) -> Self {
        let names = robot.joint_names().into_iter().map(str::to_owned).collect();
        Self {
            joints: robot.joints.len(),
            window: Window::new(names, 1e9 / PERIOD_NS as f64),
            tracking: Tracking::new(robot),
            row: Vec::new(),
            truth: Vec::new(),
        }
    }

    fn add(&mut self, messages: &CycleMessages) -> bool {
        self.tracking.add(messages);
        if record_row(messages, self.joints, &mut self.row, &mut self.truth).is_some() {
            let time_s = (messages.cycle * PERIOD_NS) as f64 * 1e-9;
            self.window.push(time_s, &self.row);
        }
        true
    }

    fn finish(self) -> Emulated {
        Emulated {
            recording: self.window.table(0.0, f64::INFINITY),
            tracking: self.tracking.report(),
        }
    }
}
