//! `flexspline gap watch`: says when a gap appears at a running robot, along a recording, or on the emulator in virtual time.

mod live;

use gap_diagnosis::DiagnoseError;
use gap_diagnosis::watch::{Event, Settings, Watch};
use gap_report::Candidate;
pub use live::Feed;
use recording::{JointCycle, Recording, Signal};
use report::number;
use robot::Robot;
use services::relay::{CycleMessages, record_row};
use shm_types::messages::LoopState;
use twin::Robots;

use std::fmt::Write;
use std::path::Path;

use super::emulated::Course;
use crate::cli::GapWatchArguments;
use crate::error::CliError;
use crate::output::{print, write_json};
use crate::run::PERIOD_NS;

/// Watches whatever was named until it ends.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if nothing comes from an instance.
pub fn watch(arguments: &GapWatchArguments) -> Result<(), CliError> {
    let mut told = Told {
        quiet: arguments.json.as_deref() == Some(Path::new("-")),
        events: Vec::new(),
    };
    match (&arguments.recording, arguments.emulate) {
        (Some(path), _) => along_recording(arguments, path, &mut told)?,
        (None, Some(_)) => on_emulator(arguments, &mut told)?,
        (None, None) => live::along_instance(arguments, &mut told)?,
    }
    match &arguments.json {
        Some(path) => write_json(&told.events, path),
        None => Ok(()),
    }
}

fn settings(arguments: &GapWatchArguments) -> Settings {
    Settings {
        window_s: arguments.window.as_secs_f64(),
        between_false_s: arguments.between_false.as_secs_f64(),
    }
}

fn robot(arguments: &GapWatchArguments) -> Result<Robot, CliError> {
    let name = arguments.robot.as_ref().ok_or_else(|| {
        CliError::Input("--robot is missing: give the robot file to watch against".to_owned())
    })?;
    robot::load(name).map_err(CliError::input)
}

/// What has been told so far.
struct Told {
    /// Nothing is printed as it comes.
    quiet: bool,
    events: Vec<Event>,
}

impl Told {
    fn tell(&mut self, events: Result<Vec<Event>, DiagnoseError>) -> Result<(), CliError> {
        for event in events.map_err(CliError::input)? {
            if !self.quiet {
                print(&line(&event))?;
            }
            self.events.push(event);
        }
        Ok(())
    }
}

fn line(event: &Event) -> String {
    let mut text = String::new();
    let _ = match event {
        Event::Watching {
            joint,
            at_s,
            already,
        } if already.is_empty() => writeln!(text, "{at_s:.1} s: {joint}: watching"),
        Event::Watching {
            joint,
            at_s,
            already,
        } => writeln!(
            text,
            "{at_s:.1} s: {joint}: watching; already there: {}",
            already.join(", ")
        ),
        Event::Blind {
            joint,
            at_s,
            reason,
        } => writeln!(text, "{at_s:.1} s: {joint}: cannot be watched: {reason}"),
        Event::Dismissed {
            joint,
            at_s,
            appeared_s,
        } => writeln!(
            text,
            "{at_s:.1} s: {joint}: what grew at {appeared_s:.1} s is no change: within noise and tolerance, or there before"
        ),
        Event::Gap(alarm) => writeln!(
            text,
            "{:.1} s: a gap appeared at {} at {:.1} s, most likely {}{}",
            alarm.at_s,
            alarm.joint,
            alarm.appeared_s,
            likely(&alarm.candidates),
            if alarm.again { ", with more data" } else { "" }
        ),
    };
    text
}

/// The most probable, and what else may be.
fn likely(candidates: &[Candidate]) -> String {
    let told = candidates
        .iter()
        .enumerate()
        .filter(|(rank, candidate)| *rank == 0 || candidate.probability >= 0.05);
    let each = told.map(|(_, c)| format!("{} ({})", c.effect, number(c.probability, 2)));
    each.collect::<Vec<_>>().join(", else ")
}

fn along_recording(
    arguments: &GapWatchArguments,
    path: &Path,
    told: &mut Told,
) -> Result<(), CliError> {
    let robot = robot(arguments)?;
    let recording = recording::read(path).map_err(CliError::input)?;
    let rows = Rows::of(&recording, &robot)?;
    let mut watch = Watch::new(robot, recording.sample_rate_hz, settings(arguments));
    let mut row = Vec::new();
    for (index, time_s) in recording.time_s.iter().enumerate() {
        rows.read(index, &mut row);
        told.tell(watch.push(*time_s, &row))?;
    }
    Ok(())
}

/// A recording's columns in the robot's order.
struct Rows<'a> {
    joints: Vec<Vec<(Signal, &'a [f64])>>,
}

impl<'a> Rows<'a> {
    fn of(recording: &'a Recording, robot: &Robot) -> Result<Self, CliError> {
        let columns = robot.joints.iter().map(|joint| {
            let columns = recording.joint(&joint.name).map_err(CliError::input)?;
            let signals = columns.signals.iter();
            Ok(signals
                .map(|(signal, values)| (*signal, values.as_slice()))
                .collect())
        });
        Ok(Self {
            joints: columns.collect::<Result<_, CliError>>()?,
        })
    }

    fn read(&self, index: usize, row: &mut Vec<JointCycle>) {
        row.clear();
        row.extend(self.joints.iter().map(|columns| {
            let mut cell = JointCycle::default();
            for (signal, values) in columns {
                cell.set(*signal, Some(values[index]));
            }
            cell
        }));
    }
}

/// The emulated plant and the loop in virtual time.
fn on_emulator(arguments: &GapWatchArguments, told: &mut Told) -> Result<(), CliError> {
    let robot = robot(arguments)?;
    let injections = match &arguments.inject {
        Some(path) => robot::load_injection(path, &robot).map_err(CliError::input)?,
        None => Vec::new(),
    };
    let trajectory = match &arguments.trajectory {
        Some(name) => name,
        None => motion::default_name(&robot),
    };
    let course = Course {
        trajectory: motion::load(trajectory, &robot).map_err(CliError::input)?,
        duration_s: arguments.emulate.unwrap_or_default().as_secs_f64(),
        seed: arguments.seed,
    };
    let mut watched = Watched::new(robot.clone(), PERIOD_NS, arguments);
    let mut ended = Ok(());
    course.each(Robots::same(&robot), &injections, |messages| {
        ended = watched.take(messages, told);
        ended.is_ok()
    })?;
    ended
}

/// A watch that takes cycles as the loop's messages tell them.
struct Watched {
    period_ns: u64,
    watch: Watch,
    joints: usize,
    row: Vec<JointCycle>,
    truth: Vec<recording::JointTruth>,
}

impl Watched {
    fn new(robot: Robot, period_ns: u64, arguments: &GapWatchArguments) -> Self {
        Self {
            period_ns,
            joints: robot.joints.len(),
            watch: Watch::new(robot, 1e9 / period_ns as f64, settings(arguments)),
            row: Vec::new(),
            truth: Vec::new(),
        }
    }

    /// A cycle in which the loop was not running is a hole.
    fn take(&mut self, messages: &CycleMessages, told: &mut Told) -> Result<(), CliError> {
        let running = LoopState::Running as u32;
        let is_running = messages
            .status
            .is_some_and(|status| status.state == running);
        let row = record_row(messages, self.joints, &mut self.row, &mut self.truth);
        if row.is_none() || !is_running {
            return Ok(());
        }
        let time_s = (messages.cycle * self.period_ns) as f64 * 1e-9;
        told.tell(self.watch.push(time_s, &self.row))
    }
}
