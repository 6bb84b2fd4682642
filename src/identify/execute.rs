//! Experiments recorded to files: on the emulated robot in virtual time, or on any robot in real time, by the processes that
//! `flexspline run` starts. What is recorded already is not run again, whoever recorded it.

use std::fs;
use std::io::{IsTerminal, stdin};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use comfy_table::{Table, presets};
use identification::Payload;
use identification::experiment::Experiment;
use indicatif::{ProgressBar, ProgressStyle};
use motion::Reference;
use recording::Recording;
use robot::{Effect, Injection, Robot};
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use twin::Robots;

use crate::cli::{
    ControlArgument, FrictionVelocityArgument, IdentifyArguments, ModeArgument, RunArguments,
    StiffnessTorqueArgument, WaitArgument,
};
use crate::drivers;
use crate::error::CliError;
use crate::output::{cannot_write, print, write_text};
use crate::run;

/// Cycles between two looks at Ctrl-C and the progress bar.
const LOOK_CYCLES: u64 = 1500;
/// Formats a recording may have, ours first.
const EXTENSIONS: [&str; 2] = ["mcap", "csv"];

/// The robot and the folder its recordings go to.
pub struct Rig<'a> {
    robot: &'a Robot,
    arguments: &'a IdentifyArguments,
    /// As recordings name it.
    robot_name: String,
}

impl<'a> Rig<'a> {
    /// Makes the folder.
    ///
    /// # Errors
    /// [`CliError::Input`] if it cannot be made, or the driver needs another mode.
    pub fn new(robot: &'a Robot, arguments: &'a IdentifyArguments) -> Result<Self, CliError> {
        drivers::find(&arguments.driver)?;
        let emulated = drivers::is_emulated(&arguments.driver);
        if arguments.mode == ModeArgument::Lockstep && !emulated {
            return Err(CliError::Input(format!(
                "--driver {}: virtual time is the emulator's; add --mode realtime",
                arguments.driver
            )));
        }
        for folder in ["recordings", "trajectories"] {
            let path = arguments.out.join(folder);
            fs::create_dir_all(&path).map_err(|error| cannot_write(&path, &error))?;
        }
        Ok(Self {
            robot,
            arguments,
            robot_name: run::absolute_if_file(&arguments.robot),
        })
    }

    /// As its file says, before anything was identified: what the experiments are planned by.
    pub fn robot(&self) -> &'a Robot {
        self.robot
    }

    /// Writes every trajectory and tells what would be run.
    ///
    /// # Errors
    /// [`CliError::Input`] if a trajectory cannot be written.
    pub fn print_plan(&self, plan: &[Experiment]) -> Result<(), CliError> {
        let mut table = Table::new();
        table
            .load_preset(presets::UTF8_HORIZONTAL_ONLY)
            .set_header(["trajectory", "recording", "s", "kg at the flange", ""]);
        for experiment in plan {
            let recorded = self.is_recorded(experiment)?;
            if !recorded {
                self.write_trajectory(experiment)?;
            }
            table.add_row([
                self.trajectory_path(experiment).display().to_string(),
                self.new_recording_path(experiment).display().to_string(),
                format!("{:.1}", experiment.duration_s),
                in_words(&experiment.payload),
                if recorded { "recorded" } else { "" }.to_owned(),
            ]);
        }
        let total_s: f64 = plan.iter().map(|experiment| experiment.duration_s).sum();
        print(&format!(
            "{table}\n{} experiments, {total_s:.0} s of motion. Each is recorded as by\n  flexspline run --control velocity \
             --trajectory TRAJECTORY --duration SECONDS --record RECORDING\nor by other means, as NAME.mcap or NAME.csv.\n",
            plan.len()
        ))
    }

    /// Records every experiment that is not recorded yet; Ctrl-C stops, and the next call goes on from there.
    ///
    /// # Errors
    /// [`CliError`] of the first that failed, or that was stopped.
    pub fn record_all(&self, plan: &[Experiment]) -> Result<(), CliError> {
        let mut todo = Vec::new();
        for experiment in plan {
            if !self.is_recorded(experiment)? {
                todo.push(experiment);
            }
        }
        let stop = run::stop_on_signals()?;
        match self.arguments.mode {
            ModeArgument::Lockstep => self.record_in_virtual_time(&todo, &stop),
            ModeArgument::Realtime => self.record_in_real_time(todo, &stop),
        }
    }

    /// The recordings of experiments, in their order.
    ///
    /// # Errors
    /// [`CliError::Input`] if one cannot be read.
    pub fn read(&self, plan: &[Experiment]) -> Result<Vec<Recording>, CliError> {
        let read = |experiment: &Experiment| {
            let found = self.found_recording(experiment);
            let path = found.unwrap_or_else(|| self.new_recording_path(experiment));
            recording::read(&path).map_err(CliError::input)
        };
        plan.iter().map(read).collect()
    }

    fn recording_path(&self, experiment: &Experiment, extension: &str) -> PathBuf {
        let name = format!("{}.{extension}", experiment.name);
        self.arguments.out.join("recordings").join(name)
    }

    fn new_recording_path(&self, experiment: &Experiment) -> PathBuf {
        self.recording_path(experiment, EXTENSIONS[0])
    }

    fn found_recording(&self, experiment: &Experiment) -> Option<PathBuf> {
        let paths = EXTENSIONS.map(|extension| self.recording_path(experiment, extension));
        paths.into_iter().find(|path| path.exists())
    }

    fn trajectory_path(&self, experiment: &Experiment) -> PathBuf {
        let name = format!("{}.toml", experiment.name);
        self.arguments.out.join("trajectories").join(name)
    }

    fn write_trajectory(&self, experiment: &Experiment) -> Result<PathBuf, CliError> {
        let path = self.trajectory_path(experiment);
        let text = experiment.trajectory.to_toml().map_err(CliError::input)?;
        write_text(&path, &text)?;
        Ok(path)
    }

    /// A recording under its last name is complete. As far as it tells, it must be of this robot and this seed, and as far
    /// as its trajectory lies there, of this motion.
    fn is_recorded(&self, experiment: &Experiment) -> Result<bool, CliError> {
        let Some(path) = self.found_recording(experiment) else {
            return Ok(false);
        };
        let recording = recording::read(&path).map_err(CliError::input)?;
        let agrees = |key: &str, value: &str| {
            let told = recording.metadata.get(key);
            told.is_none_or(|told| told == value)
        };
        let same_motion = match fs::read_to_string(self.trajectory_path(experiment)) {
            Ok(text) => experiment
                .trajectory
                .to_toml()
                .is_ok_and(|wanted| wanted == text),
            Err(_) => true,
        };
        Ok(same_motion
            && agrees("robot", &self.robot_name)
            && agrees("seed", &self.arguments.seed.to_string()))
    }

    /// On the emulator, as many experiments at a time as there are cores.
    fn record_in_virtual_time(
        &self,
        todo: &[&Experiment],
        stop: &AtomicBool,
    ) -> Result<(), CliError> {
        let bar = progress_bar(todo);
        let next = AtomicUsize::new(0);
        let failure: Mutex<Option<CliError>> = Mutex::new(None);
        let workers = std::thread::available_parallelism().map_or(1, usize::from);
        std::thread::scope(|scope| {
            for _ in 0..workers.min(todo.len()) {
                scope.spawn(|| {
                    while let Some(experiment) = todo.get(next.fetch_add(1, Ordering::Relaxed)) {
                        if let Err(error) = self.simulate(experiment, stop, &bar) {
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

    fn simulate(
        &self,
        experiment: &Experiment,
        stop: &AtomicBool,
        bar: &ProgressBar,
    ) -> Result<(), CliError> {
        let unfinished = Unfinished::new(&self.new_recording_path(experiment))?;
        let trajectory_path = self.write_trajectory(experiment)?;
        let trajectory = experiment
            .trajectory
            .build(&experiment.name, self.robot)
            .map_err(CliError::input)?;
        let mut start = Reference::default();
        trajectory.sample(0.0, &mut start);
        let run = RunConfig {
            session: 1,
            robot: self.robot_name.clone(),
            driver: self.arguments.driver.clone(),
            trajectory: trajectory_path.display().to_string(),
            plant: None,
            control: ControlMode::Velocity,
            options: ControlOptions::default(),
            estimators: Vec::new(),
            mode: Mode::Lockstep,
            period_ns: run::PERIOD_NS,
            cycles: (experiment.duration_s * 1e9 / run::PERIOD_NS as f64).ceil() as u64,
            wait: Wait::Block,
            wake_early_ns: 0,
            seed: self.arguments.seed,
            inject: None,
            record: Some(unfinished.path.clone()),
            command_deadline_ns: run::PERIOD_NS,
            cores: Vec::new(),
            initial_position_rad: start.position_rad[..self.robot.joints.len()].to_vec(),
        };
        let mut stopped = false;
        let payload = injected(&experiment.payload);
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
        unfinished.finish(stopped)
    }

    /// One after the other, by `flexspline run`'s own processes. Bare experiments first, so that the payload is changed as
    /// seldom as can be.
    fn record_in_real_time(
        &self,
        mut todo: Vec<&Experiment>,
        stop: &AtomicBool,
    ) -> Result<(), CliError> {
        todo.sort_by(|a, b| a.payload.mass_kg.total_cmp(&b.payload.mass_kg));
        let mut mounted_kg = 0.0;
        for (number, experiment) in todo.iter().enumerate() {
            let payload_kg = experiment.payload.mass_kg;
            if !drivers::is_emulated(&self.arguments.driver) && payload_kg != mounted_kg {
                ask_for(&experiment.payload, experiment)?;
            }
            mounted_kg = payload_kg;
            eprintln!(
                "experiment {} of {}: {}, {:.0} s",
                number + 1,
                todo.len(),
                experiment.name,
                experiment.duration_s
            );
            self.run(experiment, stop)?;
        }
        Ok(())
    }

    fn run(&self, experiment: &Experiment, stop: &AtomicBool) -> Result<(), CliError> {
        let unfinished = Unfinished::new(&self.new_recording_path(experiment))?;
        let trajectory = self.write_trajectory(experiment)?;
        let arguments = RunArguments {
            rate: Some(1e9 / run::PERIOD_NS as f64),
            loop_core: None,
            wake_early: Duration::ZERO,
            robot: self.arguments.robot.clone(),
            driver: self.arguments.driver.clone(),
            trajectory: Some(trajectory.display().to_string()),
            duration: Duration::from_secs_f64(experiment.duration_s),
            control: ControlArgument::Velocity,
            friction_velocity: FrictionVelocityArgument::Desired,
            stiffness_torque: StiffnessTorqueArgument::Load,
            correction: 0.0,
            estimators: Vec::new(),
            mode: ModeArgument::Realtime,
            plant: None,
            inject: self.injection_file(experiment)?,
            commission: None,
            commission_file: None,
            record: Some(unfinished.path.clone()),
            json: None,
            instance: self.arguments.instance.clone(),
            seed: self.arguments.seed,
            wait: WaitArgument::Block,
        };
        run::record(&arguments, stop)?;
        unfinished.finish(stop.load(Ordering::Relaxed))
    }

    /// The payload as the emulator takes it, beside the trajectory.
    fn injection_file(&self, experiment: &Experiment) -> Result<Option<PathBuf>, CliError> {
        let Payload { mass_kg, centre_m } = experiment.payload;
        if mass_kg == 0.0 || !drivers::is_emulated(&self.arguments.driver) {
            return Ok(None);
        }
        let path = self
            .trajectory_path(experiment)
            .with_extension("inject.toml");
        let text = format!(
            "[[effect]]\neffect = \"payload\"\nmass_kg = {mass_kg:?}\ncentre_m = {centre_m:?}\n"
        );
        write_text(&path, &text)?;
        Ok(Some(path))
    }
}

/// A recording that gets its name when it is complete.
struct Unfinished {
    path: PathBuf,
    last_name: PathBuf,
}

impl Unfinished {
    /// Takes away what stood under the last name: it was of another motion.
    fn new(last_name: &Path) -> Result<Self, CliError> {
        if last_name.exists() {
            fs::remove_file(last_name).map_err(|error| cannot_write(last_name, &error))?;
        }
        Ok(Self {
            path: last_name.with_extension("unfinished.mcap"),
            last_name: last_name.to_owned(),
        })
    }

    fn finish(self, stopped: bool) -> Result<(), CliError> {
        if stopped {
            let _ = fs::remove_file(&self.path);
            return Err(CliError::Negative(
                "stopped; the same command goes on from here".to_owned(),
            ));
        }
        fs::rename(&self.path, &self.last_name)
            .map_err(|error| cannot_write(&self.last_name, &error))
    }
}

fn injected(payload: &Payload) -> Option<Injection> {
    (payload.mass_kg > 0.0).then_some(Injection {
        joint: None,
        effect: Effect::Payload {
            mass_kg: payload.mass_kg,
            centre_m: payload.centre_m,
        },
        start_s: 0.0,
    })
}

fn in_words(payload: &Payload) -> String {
    let [x_m, y_m, z_m] = payload.centre_m;
    if payload.mass_kg == 0.0 {
        return "0".to_owned();
    }
    format!(
        "{} at ({x_m}, {y_m}, {z_m}) m of the last link",
        payload.mass_kg
    )
}

/// Waits until somebody has mounted it.
fn ask_for(payload: &Payload, experiment: &Experiment) -> Result<(), CliError> {
    let what = in_words(payload);
    if !stdin().is_terminal() {
        return Err(CliError::Input(format!(
            "experiment {} needs {what} kg at the flange, and there is no terminal to ask at; see --plan and record it \
             yourself",
            experiment.name
        )));
    }
    eprintln!("mount {what} kg at the flange, then press Enter");
    match stdin().read_line(&mut String::new()) {
        Ok(0) => Err(CliError::Negative(
            "no payload was mounted; the same command goes on from here".to_owned(),
        )),
        Ok(_) => Ok(()),
        Err(error) => Err(CliError::input(error)),
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
