//! Experiments on the emulated robot, in virtual time, recorded to files. What is recorded already is not run again.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use identification::experiment::Experiment;
use indicatif::{ProgressBar, ProgressStyle};
use motion::Reference;
use recording::Recording;
use robot::{Effect, Injection, Robot};
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use signal_hook::consts::{SIGINT, SIGTERM};
use twin::Robots;

use super::cannot_write;
use crate::error::CliError;

/// The drives' rate, as in a run.
const PERIOD_NS: u64 = 666_667;
/// Cycles between two looks at Ctrl-C and the progress bar.
const LOOK_CYCLES: u64 = 1500;

/// The emulated robot and the folder its recordings go to.
pub struct Rig<'a> {
    robot: &'a Robot,
    robot_argument: &'a str,
    out: &'a Path,
    seed: u64,
}

impl<'a> Rig<'a> {
    /// Makes the folder.
    ///
    /// # Errors
    /// [`CliError::Input`] if it cannot be made.
    pub fn new(
        robot: &'a Robot,
        robot_argument: &'a str,
        out: &'a Path,
        seed: u64,
    ) -> Result<Self, CliError> {
        for folder in ["recordings", "trajectories"] {
            let path = out.join(folder);
            fs::create_dir_all(&path).map_err(|error| cannot_write(&path, &error))?;
        }
        Ok(Self {
            robot,
            robot_argument,
            out,
            seed,
        })
    }

    /// Records every experiment that is not recorded yet; Ctrl-C stops, and the next call goes on from there.
    ///
    /// # Errors
    /// [`CliError`] of the first that failed, or that was stopped.
    pub fn record_all(&self, plan: &[Experiment]) -> Result<(), CliError> {
        let todo: Vec<&Experiment> = plan
            .iter()
            .filter(|experiment| !self.is_recorded(experiment))
            .collect();
        let stop = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(CliError::input)?;
        }
        let bar = progress_bar(&todo);
        let next = AtomicUsize::new(0);
        let failure: Mutex<Option<CliError>> = Mutex::new(None);
        let workers = std::thread::available_parallelism().map_or(1, usize::from);
        std::thread::scope(|scope| {
            for _ in 0..workers.min(todo.len()) {
                scope.spawn(|| {
                    while let Some(experiment) = todo.get(next.fetch_add(1, Ordering::Relaxed)) {
                        if let Err(error) = self.record(experiment, &stop, &bar) {
                            stop.store(true, Ordering::Relaxed);
                            if let Ok(mut first) = failure.lock() {
                                first.get_or_insert(error);
                            }
                            return;
                        }
                    }
                });
            }
        });
        bar.finish_and_clear();
        match failure.into_inner() {
            Ok(None) => Ok(()),
            Ok(Some(error)) => Err(error),
            Err(_) => Err(CliError::Negative("an experiment panicked".to_owned())),
        }
    }

    /// The recordings of experiments, in their order.
    ///
    /// # Errors
    /// [`CliError::Input`] if one cannot be read.
    pub fn read(&self, plan: &[Experiment]) -> Result<Vec<Recording>, CliError> {
        let read = |experiment: &Experiment| recording::read(&self.recording_path(experiment));
        plan.iter()
            .map(|experiment| read(experiment).map_err(CliError::input))
            .collect()
    }

    fn recording_path(&self, experiment: &Experiment) -> PathBuf {
        self.out
            .join("recordings")
            .join(format!("{}.mcap", experiment.name))
    }

    fn trajectory_path(&self, experiment: &Experiment) -> PathBuf {
        self.out
            .join("trajectories")
            .join(format!("{}.toml", experiment.name))
    }

    /// A recording under its last name is complete; it must also be of this motion, this robot and this seed.
    fn is_recorded(&self, experiment: &Experiment) -> bool {
        let same_motion = toml::to_string(&experiment.trajectory).ok()
            == fs::read_to_string(self.trajectory_path(experiment)).ok();
        same_motion
            && recording::read(&self.recording_path(experiment)).is_ok_and(|recording| {
                let told = |key: &str| recording.metadata.get(key).cloned();
                told("robot").as_deref() == Some(self.robot_argument)
                    && told("seed") == Some(self.seed.to_string())
            })
    }

    fn record(
        &self,
        experiment: &Experiment,
        stop: &AtomicBool,
        bar: &ProgressBar,
    ) -> Result<(), CliError> {
        let trajectory_path = self.trajectory_path(experiment);
        let text = toml::to_string(&experiment.trajectory).map_err(CliError::input)?;
        fs::write(&trajectory_path, text)
            .map_err(|error| cannot_write(&trajectory_path, &error))?;
        let trajectory = experiment
            .trajectory
            .build(&experiment.name, self.robot)
            .map_err(CliError::input)?;
        let mut start = Reference::default();
        trajectory.sample(0.0, &mut start);
        let path = self.recording_path(experiment);
        let unfinished = path.with_extension("mcap.unfinished");
        let run = RunConfig {
            session: 1,
            robot: self.robot_argument.to_owned(),
            driver: "emulator".to_owned(),
            trajectory: trajectory_path.display().to_string(),
            plant: None,
            control: ControlMode::Velocity,
            options: ControlOptions::default(),
            mode: Mode::Lockstep,
            period_ns: PERIOD_NS,
            cycles: (experiment.duration_s * 1e9 / PERIOD_NS as f64).ceil() as u64,
            wait: Wait::Block,
            seed: self.seed,
            inject: None,
            record: Some(unfinished.clone()),
            command_deadline_ns: PERIOD_NS,
            cores: Vec::new(),
            initial_position_rad: start.position_rad[..self.robot.joints.len()].to_vec(),
        };
        let mut stopped = false;
        let payload = (experiment.payload.mass_kg > 0.0).then_some(Injection {
            joint: None,
            effect: Effect::Payload {
                mass_kg: experiment.payload.mass_kg,
                centre_m: experiment.payload.centre_m,
            },
            start_s: 0.0,
        });
        twin::record(
            &run,
            Robots::same(self.robot),
            trajectory,
            payload.as_slice(),
            |cycle| {
                if cycle.is_multiple_of(LOOK_CYCLES) {
                    bar.inc(1);
                    stopped = stop.load(Ordering::Relaxed);
                }
                !stopped
            },
        )
        .map_err(|error| CliError::Negative(format!("experiment {}: {error}", experiment.name)))?;
        if stopped {
            let _ = fs::remove_file(&unfinished);
            return Err(CliError::Negative(
                "stopped; the same command goes on from here".to_owned(),
            ));
        }
        fs::rename(&unfinished, &path).map_err(|error| cannot_write(&path, &error))
    }
}

/// In seconds of the robot's time.
fn progress_bar(todo: &[&Experiment]) -> ProgressBar {
    let total_s: f64 = todo.iter().map(|experiment| experiment.duration_s).sum();
    let bar = ProgressBar::new(total_s as u64);
    let template = "{bar:32} {pos} of {len} s of motion, {eta} left";
    bar.set_style(
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar
}
