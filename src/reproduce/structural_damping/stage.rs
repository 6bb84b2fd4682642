//! One emulated joint: its motions in virtual time, and the folder of what is recorded of it.

use std::path::{Path, PathBuf};

use motion::Trajectory;
use recording::Recording;
use robot::{Injection, Robot};
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use twin::Robots;

use super::motions::Motion;
use crate::error::CliError;
use crate::output::write_text;
use crate::run::PERIOD_NS;

/// A joint and where its files go.
pub struct Stage<'a> {
    /// What is emulated, and controls itself.
    pub robot: &'a Robot,
    /// Folder.
    pub out: &'a Path,
    /// Of the joint.
    pub seed: u64,
}

impl Stage<'_> {
    /// Runs a motion on the joint with these effects added and reads its recording, which has this name.
    ///
    /// # Errors
    /// [`CliError`] if the loop stopped or a file cannot be written.
    pub fn record(
        &self,
        motion: &Motion,
        injections: &[Injection],
        name: &str,
    ) -> Result<(PathBuf, Recording), CliError> {
        let trajectory = self.trajectory(motion)?;
        let path = self.out.join(format!("{name}.mcap"));
        let run = RunConfig {
            record: Some(path.clone()),
            ..self.run_config(motion)
        };
        let robots = Robots::same(self.robot);
        twin::record(&run, robots, trajectory, injections, |_| true)
            .map_err(|error| CliError::Negative(format!("data set {name}: {error}")))?;
        let recording = recording::read(&path).map_err(CliError::input)?;
        Ok((path, recording))
    }

    /// A motion's waypoints, written into the folder and read from there.
    ///
    /// # Errors
    /// [`CliError::Input`] if they cannot be written.
    pub fn trajectory(&self, motion: &Motion) -> Result<Trajectory, CliError> {
        let waypoints = self.out.join(format!("{}.csv", motion.name));
        write_text(&waypoints, &motion.waypoints(&self.robot.joints[0].name))?;
        motion::load(&waypoints.display().to_string(), self.robot).map_err(CliError::input)
    }

    /// A run in virtual time that is not recorded.
    pub fn run_config(&self, motion: &Motion) -> RunConfig {
        RunConfig {
            session: 1,
            robot: self.robot.name.clone(),
            driver: "emulator".to_owned(),
            trajectory: motion.name.to_owned(),
            plant: None,
            control: ControlMode::Torque,
            options: ControlOptions::default(),
            estimators: Vec::new(),
            mode: Mode::Lockstep,
            period_ns: PERIOD_NS,
            cycles: (motion.duration_s * 1e9 / PERIOD_NS as f64) as u64,
            wait: Wait::Block,
            wake_early_ns: 0,
            seed: self.seed,
            inject: None,
            record: None,
            command_deadline_ns: PERIOD_NS,
            cores: Vec::new(),
            initial_position_rad: vec![0.0],
        }
    }
}
