//! `flexspline run --commission`: new drives, step by step, each in a run of its own.
//!
//! What is tried, in which order, and what decides is the crate `commissioning`; here are the terminal, the runs and the file.
//! Every step is an ordinary run of the loop, which is asked for nothing, no torque, one joint's torque or a small sine. It ends
//! as every run ends: brakes first. So Ctrl-C, at whatever step, leaves the arm as it leaves any run.

mod person;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

use commissioning::{
    Eyes, Finding, Moment, Progress, Stage, Step, Verdict, Watch, fingerprint, small_sine, watch,
};
use motion::Trajectory;
use robot::Robot;
use rt_loop::report::{LOOP_REPORT_FILE, LoopReport};
use serde::Serialize;
use shm_types::bus::Reader;
use shm_types::control_options::{ControlOptions, Task};
use shm_types::instance::{ControlMode, RunConfig};
use shm_types::messages::SensorSample;
use tempfile::NamedTempFile;

use super::{Plan, StopFiles, new_session, recording_path, stop_on_signals};
use crate::cli::RunArguments;
use crate::drivers;
use crate::error::CliError;
use crate::output::{print, write_json};
use crate::supervisor::{Supervisor, SupervisorError, WATCH_INTERVAL};
use person::{Answer, Person};

/// Walks the steps, or one of them.
///
/// # Errors
/// [`CliError::Input`] before anything was started, [`CliError::Negative`] if a step was not passed or the walk was left.
pub fn commission(arguments: &RunArguments, step: &str) -> Result<(), CliError> {
    let only = match step {
        "" => None,
        name => Some(Step::from_name(name).ok_or_else(|| unknown_step(name))?),
    };
    let person = Person::at_terminal().ok_or_else(|| {
        CliError::Input(
            "--commission: standard input is no terminal; each step has to be confirmed by somebody who sees the robot".to_owned(),
        )
    })?;
    let stop = stop_on_signals()?;
    let plan = Plan::new(arguments)?;
    let mut walk = Walk::open(arguments, plan, person, stop)?;
    let ended = walk.go(only);
    walk.person.clear();
    let ended = ended?;
    walk.report(arguments.json.as_deref(), &ended)?;
    walk.verdict(ended)
}

fn unknown_step(name: &str) -> CliError {
    let known: Vec<&str> = Step::ALL.iter().map(|step| step.name()).collect();
    CliError::Input(format!(
        "--commission={name}: no such step; there are {}",
        known.join(", ")
    ))
}

/// How a walk ended.
enum Ended {
    /// Everything that was asked for is passed.
    Done,
    Refused(Stage, Finding),
    /// By somebody's no, or Ctrl-C.
    Left(Stage),
}

/// For programs.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    progress: &'a Progress,
    /// Whether the whole walk is passed.
    complete: bool,
    /// The step that was not passed this time.
    refused: Option<Refused<'a>>,
    /// The step at which somebody left.
    left_at: Option<String>,
}

#[derive(Serialize)]
struct Refused<'a> {
    step: Step,
    joint: Option<&'a str>,
    finding: &'a Finding,
}

struct Walk<'a> {
    arguments: &'a RunArguments,
    plan: Plan,
    file: PathBuf,
    progress: Progress,
    person: Person,
    stop: Arc<AtomicBool>,
}

impl<'a> Walk<'a> {
    /// Takes up what was passed before, if it is of this robot file and driver.
    fn open(
        arguments: &'a RunArguments,
        plan: Plan,
        person: Person,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, CliError> {
        let (text, _) = robot::load_text(&arguments.robot).map_err(CliError::input)?;
        let fingerprint = fingerprint(&text);
        let file = kept_in(arguments);
        let begun = read(&file)?;
        let outdated = begun
            .as_ref()
            .and_then(|progress| progress.outdated(&fingerprint, &arguments.driver));
        if let Some(why) = &outdated {
            person.tell(&format!("{}: {why}; the walk begins again", file.display()));
        }
        let progress = begun
            .filter(|_| outdated.is_none())
            .unwrap_or_else(|| Progress::new(&plan.robot.name, &fingerprint, &arguments.driver));
        let walk = Self {
            arguments,
            plan,
            file,
            progress,
            person,
            stop,
        };
        walk.save()?;
        Ok(walk)
    }

    fn save(&self) -> Result<(), CliError> {
        write_json(&self.progress, &self.file).map_err(|_| {
            CliError::Input(format!(
                "{}: cannot be written; choose a place with --commission-file",
                self.file.display()
            ))
        })
    }

    fn joint_names(&self) -> Vec<&str> {
        self.plan.robot.joint_names()
    }

    fn go(&mut self, only: Option<Step>) -> Result<Ended, CliError> {
        if let Some(step) = only {
            self.begin_with(step)?;
        }
        while let Some(stage) = self.next(only) {
            if let Some(ended) = self.step(stage)? {
                return Ok(ended);
            }
        }
        Ok(Ended::Done)
    }

    /// A step that is tried again counts for nothing until it is passed anew.
    fn begin_with(&mut self, step: Step) -> Result<(), CliError> {
        let names = self.plan.robot.joint_names();
        self.progress.may_begin(step, &names).map_err(|missing| {
            CliError::Input(format!(
                "--commission={}: {} has not been passed; walk on with --commission",
                step.name(),
                missing.stage.name(&names)
            ))
        })?;
        for stage in Stage::of(step, names.len()) {
            self.progress.forget(stage, &names);
        }
        self.save()
    }

    fn next(&self, only: Option<Step>) -> Option<Stage> {
        let names = self.joint_names();
        match only {
            None => self.progress.next(&names),
            Some(step) => {
                Stage::of(step, names.len()).find(|stage| !self.progress.has(*stage, &names))
            }
        }
    }

    /// Tries a stage, and those of its step that share its run; `None` once they are passed.
    fn step(&mut self, first: Stage) -> Result<Option<Ended>, CliError> {
        let names = self.joint_names();
        let stages: Vec<Stage> = match first.step.shares_a_run() {
            true => Stage::of(first.step, names.len())
                .filter(|stage| !self.progress.has(*stage, &names))
                .collect(),
            false => vec![first],
        };
        let number = Step::ALL
            .iter()
            .take_while(|step| **step < first.step)
            .count()
            + 1;
        let title = match first.step.shares_a_run() {
            true => first.step.name().to_owned(),
            false => first.name(&names),
        };
        self.person
            .tell(&format!("\n{number}/{} {title}", Step::ALL.len()));
        if first.step == Step::EmergencyStop && drivers::is_emulated(&self.arguments.driver) {
            let told = "emulated drives have no switch to press";
            return self
                .pass(first, Finding::new(0.0, 0.0, "", told))
                .map(|()| None);
        }
        self.person.tell(first.step.warning());
        if self.person.ask("Begin?", &self.stop) != Answer::Yes {
            return Ok(Some(Ended::Left(first)));
        }
        match self.run(&stages)? {
            RunEnd::Passed => (),
            RunEnd::Refused(stage, finding) => return Ok(Some(Ended::Refused(stage, finding))),
            RunEnd::Left(stage) => return Ok(Some(Ended::Left(stage))),
        }
        Ok(None)
    }

    /// The run of these stages.
    fn run(&mut self, stages: &[Stage]) -> Result<RunEnd, CliError> {
        let first = stages[0];
        let joint = first.joint.unwrap_or_default();
        let sine = match first.step {
            Step::Sine => match self.sine(first, joint)? {
                Ok(sine) => Some(sine),
                Err(end) => return Ok(end),
            },
            _ => None,
        };
        let config = self.config(first, sine.as_ref())?;
        let mut session = Session::start(&self.plan, config)?;
        let end = self.look(&mut session, stages, sine.map(|sine| sine.trajectory));
        let ended = session.end();
        // Why it ended is worth more than how.
        let end = end?;
        let fault = ended?;
        match end {
            LookEnd::Passed => Ok(RunEnd::Passed),
            LookEnd::Followed(stage, finding) => self.confirm_sine(stage, finding),
            LookEnd::Refused(stage, finding) => Ok(RunEnd::Refused(stage, finding)),
            LookEnd::Left(stage) => Ok(RunEnd::Left(stage)),
            LookEnd::Stopped(stage) => {
                let why = fault.unwrap_or_else(|| "it has not said why".to_owned());
                let told = format!("the loop stopped for safety: {why}");
                Ok(RunEnd::Refused(stage, Finding::new(0.0, 0.0, "", told)))
            }
        }
    }

    /// A sine about where the joints stand now, which a run without command tells.
    fn sine(&mut self, stage: Stage, joint: usize) -> Result<Result<Sine, RunEnd>, CliError> {
        let scan = Stage {
            step: Step::Scan,
            joint: None,
        };
        let config = self.config(scan, None)?;
        let mut session = Session::start(&self.plan, config)?;
        let mut scanned = watch(scan, &self.plan.robot, None);
        let end = self.until_judged(&mut session, scanned.as_mut());
        let positions_rad = session.positions_rad(&self.plan);
        let ended = session.end();
        let end = end?;
        ended?;
        match end {
            Judged::Verdict(Verdict::Passed(_)) => (),
            Judged::Verdict(Verdict::Refused(finding)) => {
                return Ok(Err(RunEnd::Refused(stage, finding)));
            }
            Judged::Verdict(Verdict::Stopped | Verdict::Waiting) => {
                let told = "the loop stopped for safety before the sine";
                let finding = Finding::new(0.0, 0.0, "", told);
                return Ok(Err(RunEnd::Refused(stage, finding)));
            }
            Judged::Left => return Ok(Err(RunEnd::Left(stage))),
        }
        let file = small_sine(&self.plan.robot, joint, &positions_rad);
        let trajectory = match file.build("the small sine", &self.plan.robot) {
            Ok(trajectory) => trajectory,
            Err(error) => {
                let told = format!("{error}; move the joints away from the ends of their ranges");
                let finding = Finding::new(0.0, 0.0, "", told);
                return Ok(Err(RunEnd::Refused(stage, finding)));
            }
        };
        let text = file.to_toml().map_err(CliError::input)?;
        let mut written = tempfile::Builder::new()
            .prefix("small-sine")
            .suffix(".toml")
            .tempfile()
            .map_err(CliError::input)?;
        written
            .write_all(text.as_bytes())
            .map_err(CliError::input)?;
        Ok(Ok(Sine {
            file: written,
            trajectory,
        }))
    }

    /// What a number does not tell.
    fn confirm_sine(&mut self, stage: Stage, finding: Finding) -> Result<RunEnd, CliError> {
        self.person.clear();
        self.person.tell(&format!("  {}", finding.told));
        match self.person.ask("Did it look and sound right?", &self.stop) {
            Answer::Yes => self.pass(stage, finding).map(|()| RunEnd::Passed),
            Answer::Gone => Ok(RunEnd::Left(stage)),
            Answer::No => {
                let told = format!("{}, but it did not look or sound right", finding.told);
                Ok(RunEnd::Refused(stage, Finding { told, ..finding }))
            }
        }
    }

    /// What the run of a stage is asked for.
    fn config(&self, stage: Stage, sine: Option<&Sine>) -> Result<RunConfig, CliError> {
        let base = &self.plan.config;
        let names = self.joint_names();
        let task = stage.step.task(stage.joint.unwrap_or_default());
        let title = format!("commission-{}", stage.name(&names).replace(" of ", "-"));
        Ok(RunConfig {
            session: new_session(),
            trajectory: sine.map_or(base.trajectory.clone(), |sine| {
                sine.file.path().display().to_string()
            }),
            // No torque is a torque: velocity drives would hold.
            control: match task {
                Task::Follow => base.control,
                _ => ControlMode::Torque,
            },
            options: ControlOptions {
                task,
                ..base.options
            },
            cycles: 0,
            record: Some(recording_path(
                self.arguments,
                &self.plan.robot.name,
                &title,
            )?),
            ..base.clone()
        })
    }

    /// One stage after the other.
    fn look(
        &mut self,
        session: &mut Session,
        stages: &[Stage],
        trajectory: Option<Trajectory>,
    ) -> Result<LookEnd, CliError> {
        for &stage in stages {
            let mut judge = watch(stage, &self.plan.robot, trajectory.clone());
            let name = stage
                .joint
                .map_or("", |joint| self.joint_names()[joint])
                .to_owned();
            if let Some(request) = stage.step.request(&name) {
                self.person
                    .tell(&format!("  {request} (n: it does not work)"));
            }
            let finding = match self.until_judged(session, judge.as_mut())? {
                Judged::Left => return Ok(LookEnd::Left(stage)),
                Judged::Verdict(Verdict::Passed(finding)) => finding,
                Judged::Verdict(Verdict::Refused(finding)) => {
                    return Ok(LookEnd::Refused(stage, finding));
                }
                Judged::Verdict(Verdict::Stopped | Verdict::Waiting) => {
                    return Ok(LookEnd::Stopped(stage));
                }
            };
            if stage.step == Step::Sine {
                return Ok(LookEnd::Followed(stage, finding));
            }
            self.pass(stage, finding)?;
        }
        Ok(LookEnd::Passed)
    }

    /// Shows a judge what happens until it has judged, somebody objects, or the run ends.
    fn until_judged(
        &self,
        session: &mut Session,
        judge: &mut dyn Watch,
    ) -> Result<Judged, CliError> {
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(Judged::Left);
            }
            let looked = session.look(judge);
            if self.stop.load(Ordering::Relaxed) {
                // The terminal's Ctrl-C reaches every process; whatever ended first, that is why.
                return Ok(Judged::Left);
            }
            match looked? {
                Verdict::Waiting => (),
                verdict => return Ok(Judged::Verdict(verdict)),
            }
            self.person.show(judge.hint());
            match self.person.objects() {
                Some(Answer::No) => return Ok(Judged::Verdict(Verdict::Refused(judge.give_up()))),
                Some(Answer::Gone) => return Ok(Judged::Left),
                Some(Answer::Yes) | None => (),
            }
            std::thread::sleep(WATCH_INTERVAL);
        }
    }

    fn pass(&mut self, stage: Stage, finding: Finding) -> Result<(), CliError> {
        self.person.clear();
        self.person.tell(&format!("  passed: {}", finding.told));
        let at = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
        let names = self.plan.robot.joint_names();
        self.progress.pass(stage, &names, at, finding);
        self.save()
    }

    fn report(&self, json: Option<&Path>, ended: &Ended) -> Result<(), CliError> {
        let names = self.joint_names();
        let Some(path) = json else { return Ok(()) };
        let refused = match ended {
            Ended::Refused(stage, finding) => Some(Refused {
                step: stage.step,
                joint: stage.joint.map(|joint| names[joint]),
                finding,
            }),
            _ => None,
        };
        let left_at = match ended {
            Ended::Left(stage) => Some(stage.name(&names)),
            _ => None,
        };
        let report = Report {
            progress: &self.progress,
            complete: self.progress.next(&names).is_none(),
            refused,
            left_at,
        };
        write_json(&report, path)
    }

    fn verdict(&self, ended: Ended) -> Result<(), CliError> {
        let names = self.joint_names();
        let kept = self.file.display();
        match ended {
            Ended::Done if self.arguments.json.as_deref() == Some(Path::new("-")) => Ok(()),
            Ended::Done => match self.progress.next(&names) {
                None => print(&format!("Every step is passed; kept in {kept}.\n")),
                Some(stage) => print(&format!(
                    "Passed; {} is next; kept in {kept}.\n",
                    stage.name(&names)
                )),
            },
            Ended::Refused(stage, finding) => Err(CliError::Negative(format!(
                "{} is not passed: {}; what was passed before is kept in {kept}",
                stage.name(&names),
                finding.told
            ))),
            Ended::Left(stage) => Err(CliError::Negative(format!(
                "the walk was left at {}; what was passed is kept in {kept}, and the same command goes on there",
                stage.name(&names)
            ))),
        }
    }
}

/// Where a walk is kept.
fn kept_in(arguments: &RunArguments) -> PathBuf {
    match &arguments.commission_file {
        Some(path) => path.clone(),
        None => Path::new(&arguments.robot).with_extension("commission.json"),
    }
}

/// What a run on drives should know whose walk is not complete: one line, with the command that walks on. `None` where it is.
///
/// # Errors
/// [`CliError::Input`] if the robot file cannot be read.
pub fn not_walked(arguments: &RunArguments, robot: &Robot) -> Result<Option<String>, CliError> {
    let (text, _) = robot::load_text(&arguments.robot).map_err(CliError::input)?;
    let fingerprint = fingerprint(&text);
    let why = match read(&kept_in(arguments)) {
        Err(error) => error.to_string(),
        Ok(None) => "nothing has been tried".to_owned(),
        Ok(Some(progress)) => match progress.outdated(&fingerprint, &arguments.driver) {
            Some(why) => why,
            None => match progress.next(&robot.joint_names()) {
                Some(stage) => format!("{} is next", stage.name(&robot.joint_names())),
                None => return Ok(None),
            },
        },
    };
    Ok(Some(format!(
        "the drives of {robot} have not been walked to the end: {why}; flexspline run --commission --driver {driver} --robot {robot}",
        robot = arguments.robot,
        driver = arguments.driver
    )))
}

/// What was passed before; `None` where nothing was begun.
fn read(path: &Path) -> Result<Option<Progress>, CliError> {
    let text = match std::fs::read(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        text => text.map_err(|error| CliError::Input(format!("{}: {error}", path.display())))?,
    };
    serde_json::from_slice(&text).map(Some).map_err(|error| {
        CliError::Input(format!(
            "{}: no file of --commission: {error}; remove it, or name another with --commission-file",
            path.display()
        ))
    })
}

/// A small sine, as its run reads it and as its judge knows it.
struct Sine {
    file: NamedTempFile,
    trajectory: Trajectory,
}

enum RunEnd {
    Passed,
    Refused(Stage, Finding),
    Left(Stage),
}

enum LookEnd {
    Passed,
    /// A sine, which somebody has to find right too.
    Followed(Stage, Finding),
    Refused(Stage, Finding),
    Left(Stage),
    Stopped(Stage),
}

enum Judged {
    Verdict(Verdict),
    Left,
}

/// A run that is looked at.
struct Session {
    supervisor: Supervisor,
    samples: Reader<SensorSample>,
    eyes: Eyes,
    newest: Option<SensorSample>,
    stops: StopFiles,
    instance: shm_types::instance::Instance,
}

impl Session {
    fn start(plan: &Plan, config: RunConfig) -> Result<Self, CliError> {
        let mut supervisor = Supervisor::start(&plan.instance, &config).map_err(CliError::input)?;
        let samples = supervisor.samples().map_err(CliError::input);
        let started = samples.and_then(|samples| {
            supervisor.start_loop().map_err(ended_badly)?;
            Ok(samples)
        });
        match started {
            Ok(samples) => Ok(Self {
                supervisor,
                samples,
                eyes: Eyes::default(),
                newest: None,
                stops: StopFiles {
                    config,
                    robot: plan.robot.clone(),
                    written: Vec::new(),
                },
                instance: plan.instance.clone(),
            }),
            Err(error) => {
                // Why it did not start is worth more than how it stopped.
                let _ = supervisor.stop();
                supervisor.leave();
                Err(error)
            }
        }
    }

    /// Looks after the processes and shows the judge what came.
    fn look(&mut self, judge: &mut dyn Watch) -> Result<Verdict, CliError> {
        if !self.supervisor.watch().map_err(ended_badly)? {
            return Err(CliError::Negative("the loop ended by itself".to_owned()));
        }
        self.stops.write(&mut self.supervisor);
        // Statuses first: the sample of each is out before it.
        let mut statuses = Vec::new();
        while let Some(status) = self.supervisor.next_status() {
            statuses.push(status);
        }
        while let Some(sample) = self.samples.take() {
            self.newest = Some(sample);
            self.eyes.take_sample(sample);
        }
        let moments: Vec<Moment> = statuses
            .iter()
            .filter_map(|status| self.eyes.take_status(status))
            .collect();
        for moment in &moments {
            match judge.see(moment) {
                Verdict::Waiting => (),
                verdict => return Ok(verdict),
            }
            if judge.wants_stop() {
                self.supervisor.emergency_stop();
            }
        }
        Ok(Verdict::Waiting)
    }

    /// Where the joints stand, joint side.
    fn positions_rad(&self, plan: &Plan) -> Vec<f64> {
        let newest = self.newest.unwrap_or_default();
        let joints = plan.robot.joints.iter().enumerate();
        joints
            .map(|(joint, facts)| newest.readings.motor_position_rad[joint] / facts.gear_ratio)
            .collect()
    }

    /// Brakes, then the services; the loop's last fault, if it had one.
    fn end(self) -> Result<Option<String>, CliError> {
        let Self {
            mut supervisor,
            samples,
            mut stops,
            instance,
            ..
        } = self;
        let stopped = supervisor.stop();
        stops.write(&mut supervisor);
        let report = instance.read_report::<LoopReport>(LOOP_REPORT_FILE).ok();
        drop(samples);
        supervisor.leave();
        stopped.map_err(ended_badly)?;
        Ok(report.and_then(|report| report.last_fault))
    }
}

fn ended_badly(error: SupervisorError) -> CliError {
    match error {
        SupervisorError::Refused => CliError::input(error),
        other => CliError::Negative(other.to_string()),
    }
}
