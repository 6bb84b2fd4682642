//! `flexspline run`: checks the input, starts an instance, watches it, reports.

mod commission;
mod progress;
mod report;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use motion::Trajectory;
use realtime::cores::{current_core, usable_cores};
use realtime::process::user_id;
use robot::Robot;
use rt_loop::report::{LOOP_REPORT_FILE, LoopReport};
use services::controller::Controller;
use services::estimators::{Estimators, EstimatorsError};
use services::tracking::{TRACKING_REPORT_FILE, TrackingReport};
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Instance, Mode, RunConfig};
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::cli::RunArguments;
use crate::drivers;
use crate::error::CliError;
use crate::output::{print, write_json};
use crate::supervisor::last_cycles::{self, stop_path};
use crate::supervisor::{Supervisor, SupervisorError, WATCH_INTERVAL};
use progress::Progress;
use report::RunReport;

/// The servo drivers' rate: where "1.5 kHz" comes from.
pub const PERIOD_NS: u64 = 666_667;
/// Rates at which a loop is worth running: a lost wake-up is found after 0.1 ms, and joints need more than a few samples a second.
const RATE_HZ: std::ops::RangeInclusive<f64> = 50.0..=20_000.0;
/// A loop that watches the clock for a larger part of the period than this, in percent, leaves its core nothing else to do.
const WAKE_EARLY_PERCENT_MAX: u64 = 50;
/// Part of the period, in percent, after which a command that has not come is missing.
const COMMAND_DEADLINE_PERCENT: u64 = 75;

/// Runs a robot and reports.
///
/// # Errors
/// [`CliError::Input`] before anything was started, [`CliError::Negative`] if the run ended badly.
pub fn run(arguments: &RunArguments) -> Result<(), CliError> {
    if let Some(step) = &arguments.commission {
        return commission::commission(arguments, step);
    }
    let plan = Plan::new(arguments)?;
    if !drivers::is_emulated(&arguments.driver)
        && let Some(told) = commission::not_walked(arguments, &plan.robot)?
    {
        eprintln!("flexspline: {told}");
    }
    let stop = stop_on_signals()?;
    let (report, ended) = execute(plan, &stop)?;
    let to_standard_output = arguments.json.as_deref() == Some(Path::new("-"));
    if !to_standard_output {
        print(&format!("{report}\n"))?;
    }
    if let Some(path) = &arguments.json {
        write_json(&report, path)?;
    }
    ended?;
    report.verdict()
}

/// Runs a robot for its recording alone.
///
/// # Errors
/// As [`run`] has them.
pub fn record(arguments: &RunArguments, stop: &AtomicBool) -> Result<(), CliError> {
    let (report, ended) = execute(Plan::new(arguments)?, stop)?;
    ended?;
    report.verdict()
}

/// A flag that Ctrl-C and SIGTERM raise.
///
/// # Errors
/// [`CliError::Input`] if the system refuses.
pub fn stop_on_signals() -> Result<Arc<AtomicBool>, CliError> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(CliError::input)?;
    }
    Ok(stop)
}

/// Starts an instance, watches it, stops it: what it came to, and whether it ended as it should.
fn execute(plan: Plan, stop: &AtomicBool) -> Result<(RunReport, Result<(), CliError>), CliError> {
    let mut supervisor =
        Supervisor::start(&plan.instance, &plan.config).map_err(CliError::input)?;
    let mut stops = StopFiles::new(&plan);
    let watched = watch(&mut supervisor, &plan.config, stop, &mut stops);
    let stopped = supervisor.stop();
    // The loop hands out what is left of them when it ends.
    stops.write(&mut supervisor);
    let report = RunReport {
        robot: plan.robot.name.clone(),
        trajectory: plan.config.trajectory.clone(),
        mode: plan.config.mode,
        seed: plan.config.seed,
        recording: plan.config.record.clone(),
        interrupted: stop.load(Ordering::Relaxed),
        timing: plan
            .instance
            .read_report::<LoopReport>(LOOP_REPORT_FILE)
            .ok(),
        tracking: plan
            .instance
            .read_report::<TrackingReport>(TRACKING_REPORT_FILE)
            .ok(),
        restarts: supervisor.restarts().to_vec(),
        last_cycles: stops.written,
    };
    supervisor.leave();
    let ended = watched.and(stopped).map_err(|error| match error {
        SupervisorError::Refused => CliError::input(error),
        other => CliError::Negative(other.to_string()),
    });
    Ok((report, ended))
}

/// Watches until the loop ends or somebody presses Ctrl-C.
fn watch(
    supervisor: &mut Supervisor,
    config: &RunConfig,
    stop: &AtomicBool,
    stops: &mut StopFiles,
) -> Result<(), SupervisorError> {
    supervisor.start_loop()?;
    let progress = Progress::new(config);
    while !stop.load(Ordering::Relaxed) && supervisor.watch()? {
        if let Some(status) = supervisor.newest_status() {
            progress.show(&status);
        }
        stops.write(supervisor);
        std::thread::sleep(WATCH_INTERVAL);
    }
    Ok(())
}

/// Writes the loop's last cycles before each stop, and remembers where.
struct StopFiles {
    config: RunConfig,
    robot: Robot,
    written: Vec<PathBuf>,
}

impl StopFiles {
    fn new(plan: &Plan) -> Self {
        Self {
            config: plan.config.clone(),
            robot: plan.robot.clone(),
            written: Vec::new(),
        }
    }

    fn write(&mut self, supervisor: &mut Supervisor) {
        let Some(record) = self.config.record.clone() else {
            return;
        };
        while let Some((stop, cycles)) = supervisor.last_cycles() {
            let path = stop_path(&record, stop);
            match last_cycles::write(&path, &self.config, &self.robot, &cycles) {
                Ok(()) => self.written.push(path),
                Err(error) => {
                    eprintln!("flexspline: the last cycles before a stop are lost: {error}")
                }
            }
        }
    }
}

/// A run whose input has been checked.
struct Plan {
    instance: Instance,
    config: RunConfig,
    robot: Robot,
}

impl Plan {
    fn new(arguments: &RunArguments) -> Result<Self, CliError> {
        let instance = Instance::new(&arguments.instance, user_id()).map_err(CliError::input)?;
        drivers::find(&arguments.driver)?;
        let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
        robot.check_fits_loop().map_err(CliError::input)?;
        let period_ns = period_ns(arguments.rate, &robot)?;
        let cycles = cycles(arguments.duration, period_ns)?;
        let mode = arguments.mode.into();
        let loop_core = match mode {
            Mode::Realtime => arguments.loop_core,
            // Every process is on the loop's core then: the one the kernel found free for this process, not always the last.
            Mode::Lockstep => arguments.loop_core.or_else(current_core),
        };
        let wake_early_ns = wake_early_ns(arguments.wake_early, period_ns)?;
        let trajectory = match &arguments.trajectory {
            Some(name) => name.clone(),
            None => motion::default_name(&robot).to_owned(),
        };
        let loaded = motion::load(&trajectory, &robot).map_err(CliError::input)?;
        let mut start = motion::Reference::default();
        loaded.sample(0.0, &mut start);
        if let Some(path) = &arguments.inject {
            robot::load_injection(path, &robot).map_err(CliError::input)?;
            robot::load_pushes(path, &robot).map_err(CliError::input)?;
            robot::load_drive_faults(path, &robot).map_err(CliError::input)?;
        }
        let plant = arguments
            .plant
            .as_ref()
            .map(|plant| absolute_if_file(plant));
        if let Some(plant) = &plant {
            check_plant(plant, &robot)?;
        }
        check_estimators(&robot, &arguments.estimators, period_ns)?;
        let record = recording_path(arguments, &robot.name, &trajectory)?;
        let config = RunConfig {
            session: new_session(),
            robot: absolute_if_file(&arguments.robot),
            driver: arguments.driver.clone(),
            trajectory: absolute_if_file(&trajectory),
            plant,
            control: arguments.control.into(),
            options: control_options(arguments),
            estimators: arguments.estimators.clone(),
            mode,
            period_ns,
            cycles,
            wait: arguments.wait.into(),
            wake_early_ns,
            seed: arguments.seed,
            inject: arguments.inject.as_deref().map(absolute),
            record: Some(record),
            command_deadline_ns: period_ns * COMMAND_DEADLINE_PERCENT / 100,
            cores: cores(loop_core, usable_cores())?,
            initial_position_rad: start.position_rad[..robot.joints.len()].to_vec(),
        };
        check_control(&config, robot.clone(), loaded)?;
        crate::drives::check_hardware(&config, &robot)?;
        Ok(Self {
            instance,
            config,
            robot,
        })
    }
}

/// What was asked for, or the rate for which the robot file's gains are made.
///
/// # Errors
/// [`CliError::Input`] for a rate that is none, with where it stands.
pub fn period_ns(asked_hz: Option<f64>, robot: &Robot) -> Result<u64, CliError> {
    let control = robot.control.as_ref();
    let (place, rate_hz) = match (asked_hz, control) {
        (Some(asked_hz), _) => ("--rate", asked_hz),
        (None, Some(control)) => ("control.rate_hz of the robot file,", control.rate_hz),
        (None, None) => return Ok(PERIOD_NS),
    };
    if !RATE_HZ.contains(&rate_hz) {
        return Err(CliError::Input(format!(
            "{place} {rate_hz}: must be {} to {} cycles a second",
            RATE_HZ.start(),
            RATE_HZ.end()
        )));
    }
    let filter_hz = control.map_or(0.0, |control| control.velocity_filter_hz);
    if filter_hz >= rate_hz / 2.0 {
        return Err(CliError::Input(format!(
            "{place} {rate_hz}: must be more than twice the robot's velocity_filter_hz = {filter_hz}"
        )));
    }
    Ok((1e9 / rate_hz).round() as u64)
}

fn cycles(duration: Duration, period_ns: u64) -> Result<u64, CliError> {
    u64::try_from(duration.as_nanos() / u128::from(period_ns))
        .ok()
        .filter(|&cycles| cycles > 0)
        .ok_or_else(|| {
            CliError::Input(format!(
                "--duration {duration:?}: must be at least one period, {} µs",
                period_ns.div_ceil(1000)
            ))
        })
}

fn wake_early_ns(early: Duration, period_ns: u64) -> Result<u64, CliError> {
    let most_ns = period_ns * WAKE_EARLY_PERCENT_MAX / 100;
    u64::try_from(early.as_nanos())
        .ok()
        .filter(|&early_ns| early_ns <= most_ns)
        .ok_or_else(|| {
            CliError::Input(format!(
                "--wake-early {early:?}: must be at most half of the period, {} µs",
                most_ns / 1000
            ))
        })
}

/// The cores, the loop's last.
fn cores(loop_core: Option<usize>, mut cores: Vec<usize>) -> Result<Vec<usize>, CliError> {
    let Some(own) = loop_core else {
        return Ok(cores);
    };
    let Some(at) = cores.iter().position(|&core| core == own) else {
        return Err(CliError::Input(format!(
            "--loop-core {own}: not a core this process may use; those are {cores:?}"
        )));
    };
    cores.remove(at);
    cores.push(own);
    Ok(cores)
}

fn control_options(arguments: &RunArguments) -> ControlOptions {
    ControlOptions {
        friction_velocity: arguments.friction_velocity.into(),
        stiffness_torque: arguments.stiffness_torque.into(),
        correction_gain: arguments.correction,
        ..ControlOptions::default()
    }
}

/// What the estimator's process would stop over.
fn check_estimators(robot: &Robot, names: &[String], period_ns: u64) -> Result<(), CliError> {
    match Estimators::new(robot, names, period_ns as f64 * 1e-9) {
        Ok(_) => Ok(()),
        Err(error @ EstimatorsError::Estimator(_)) => Err(CliError::input(error)),
        Err(asked) => Err(CliError::Input(format!("--estimators: {asked}"))),
    }
}

/// The robot must be controllable the way that is asked for.
fn check_control(config: &RunConfig, robot: Robot, trajectory: Trajectory) -> Result<(), CliError> {
    if config.control == ControlMode::Velocity && config.options != ControlOptions::default() {
        return Err(CliError::Input(
            "--friction-velocity, --stiffness-torque and --correction change the torque that is fed forward; \
             leave them out or take --control torque"
                .to_owned(),
        ));
    }
    Controller::new(config, robot, trajectory)
        .map(drop)
        .map_err(CliError::input)
}

/// The emulated arm must have the joints the controller knows.
fn check_plant(plant: &str, robot: &Robot) -> Result<(), CliError> {
    let plant_robot = robot::load(plant).map_err(CliError::input)?;
    if plant_robot.joint_names() != robot.joint_names() {
        return Err(CliError::Input(format!(
            "--plant {plant}: its joints are {}, those of --robot are {}; give a robot with the same joints",
            plant_robot.joint_names().join(", "),
            robot.joint_names().join(", ")
        )));
    }
    Ok(())
}

/// Names stay names; files are found from every process's directory.
pub fn absolute_if_file(name_or_path: &str) -> String {
    let path = Path::new(name_or_path);
    if path.is_file() {
        absolute(path).display().to_string()
    } else {
        name_or_path.to_owned()
    }
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// Where the recording goes, proven to be writable.
fn recording_path(
    arguments: &RunArguments,
    robot: &str,
    trajectory: &str,
) -> Result<PathBuf, CliError> {
    let path = match &arguments.record {
        Some(path) => path.clone(),
        None => {
            let stem = Path::new(trajectory)
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let now = humantime::format_rfc3339_seconds(SystemTime::now())
                .to_string()
                .replace(':', "-");
            PathBuf::from(format!("recordings/{robot}-{stem}-{now}.mcap"))
        }
    };
    let refuse = |error: std::io::Error| {
        CliError::Input(format!(
            "cannot write the recording {}: {error}; choose a place with --record",
            path.display()
        ))
    };
    if arguments.record.is_none() {
        fs::create_dir_all("recordings").map_err(refuse)?;
    }
    prove_writable(&path).map_err(refuse)?;
    Ok(absolute(&path))
}

/// Leaves everything as it was: the instance may turn out to be taken.
fn prove_writable(path: &Path) -> std::io::Result<()> {
    if path.exists() {
        return fs::File::options().append(true).open(path).map(drop);
    }
    fs::File::create_new(path)?;
    fs::remove_file(path)
}

/// A number that no other run of this user has: wall clock and process id.
fn new_session() -> u64 {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_nanos() as u64);
    now ^ (u64::from(std::process::id()) << 48)
}

impl RunReport {
    /// Whether the run was what was asked for.
    fn verdict(&self) -> Result<(), CliError> {
        let Some(timing) = &self.timing else {
            return Err(CliError::Negative(
                "the loop left no report; it was killed or could not start".to_owned(),
            ));
        };
        if ["SafeStop", "Faulted"].contains(&timing.final_state.as_str()) {
            let why = timing.last_fault.as_deref().unwrap_or("unknown");
            let kept = self.last_cycles.last().map_or(String::new(), |path| {
                format!("; its last cycles: {}", path.display())
            });
            return Err(CliError::Negative(format!(
                "the loop stopped for safety: {why}{kept}"
            )));
        }
        if let Some(error) = self
            .tracking
            .as_ref()
            .and_then(|tracking| tracking.recording_error.as_ref())
        {
            return Err(CliError::Negative(format!(
                "the recording is not complete: {error}"
            )));
        }
        if self.mode == Mode::Lockstep
            && self
                .tracking
                .as_ref()
                .is_some_and(|tracking| tracking.lost_rows > 0)
        {
            return Err(CliError::Negative(
                "the recording has gaps, which lockstep must not have".to_owned(),
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loop_gets_the_core_that_is_asked_for() {
        let usable = || vec![0, 1, 2, 5];
        assert_eq!(cores(None, usable()).unwrap(), usable());
        assert_eq!(cores(Some(1), usable()).unwrap(), [0, 2, 5, 1]);
        let refused = cores(Some(3), usable()).unwrap_err().to_string();
        assert!(refused.contains("--loop-core 3") && refused.contains("[0, 1, 2, 5]"));
    }

    #[test]
    fn a_robot_runs_at_the_rate_its_gains_are_made_for_unless_told_otherwise() {
        let mut robot = robot::load("shd17").unwrap();
        robot.control.as_mut().unwrap().rate_hz = 1000.0;
        assert_eq!(period_ns(None, &robot).unwrap(), 1_000_000);
        assert_eq!(period_ns(Some(2000.0), &robot).unwrap(), 500_000);
        robot.control.as_mut().unwrap().rate_hz = 20.0;
        let refused = period_ns(None, &robot).unwrap_err().to_string();
        assert!(refused.contains("control.rate_hz") && refused.contains("20"));
        robot.control = None;
        assert_eq!(period_ns(None, &robot).unwrap(), PERIOD_NS);
    }

    #[test]
    fn rate_and_early_waking_are_held_to_what_makes_sense() {
        let robot = robot::load("shd17").unwrap();
        assert_eq!(period_ns(Some(1500.0), &robot).unwrap(), PERIOD_NS);
        for rate_hz in [0.0, -1.0, f64::NAN, f64::INFINITY, 49.0] {
            assert!(period_ns(Some(rate_hz), &robot).is_err(), "{rate_hz}");
        }
        let early = |us| wake_early_ns(Duration::from_micros(us), PERIOD_NS);
        assert_eq!(early(100).unwrap(), 100_000);
        assert!(early(334).unwrap_err().to_string().contains("333 µs"));
        assert!(cycles(Duration::from_micros(1), PERIOD_NS).is_err());
    }
}
