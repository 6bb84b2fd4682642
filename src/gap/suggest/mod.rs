//! `flexspline gap suggest`: the next experiment, a trajectory that would tell apart what the data could not.
//!
//! Every experiment of the [`menu`] is run on the nominal plant under the robot file's controller, and the twin says how far
//! the effects of each pair would be apart along it ([`gap_diagnosis::separate`]).

mod advice;
mod menu;
mod questions;
mod room;

use std::fmt::Write;
use std::path::Path;

use comfy_table::{Table, presets};
use gap_diagnosis::separate::{Pair, Separation, separations};
use gap_report::{Regime, Report};
use indicatif::{ProgressBar, ProgressStyle};
use motion::{JointEntry, SampledReference, Trajectory, TrajectoryFile, WaypointsEntry};
use recording::{Recording, Signal};
use report::number;
use robot::Robot;
use serde::Serialize;

use super::emulated::Course;
use crate::cli::GapSuggestArguments;
use crate::error::CliError;
use crate::output::{print, write_json, write_text};
use advice::advice;
use menu::{Experiment, STEP_S, Seat};
use questions::{Question, of_report, questions};
use room::room;

/// Two effects nearer than this cannot be told apart.
const DISTANCE_MIN: f64 = 9.0;
/// An experiment may take this part of the motors' largest torque.
const TORQUE_PART: f64 = 0.9;
/// One that takes more is made slower, so often at most, and then left out.
const SLOWER: [f64; 4] = [1.0, 0.7, 0.5, 0.35];
/// Of the sensors' noise along an experiment.
const SEED: u64 = 1;

/// What came of one experiment.
struct Tried {
    experiment: Experiment,
    reference: SampledReference,
    /// Of every question, the lesser of both directions.
    separations: Vec<Separation>,
}

/// For programs.
#[derive(Serialize)]
struct Suggestion<'a> {
    schema: u32,
    trajectory: Option<&'a Path>,
    experiment: Option<&'static str>,
    pairs: Vec<ToldPair>,
    menu: Vec<ToldExperiment>,
}

#[derive(Clone, Serialize)]
struct ToldPair {
    joint: String,
    effects: [String; 2],
    /// Of the report.
    distance_now: Option<f64>,
    /// Of the trajectory that was written; the largest of the menu where none tells the pair apart.
    distance_expected: f64,
    /// What to do instead where no motion helps.
    #[serde(skip_serializing_if = "Option::is_none")]
    advice: Option<&'static str>,
}

#[derive(Serialize)]
struct ToldExperiment {
    experiment: &'static str,
    /// Of every pair.
    distances: Vec<f64>,
}

/// Reads what is not told apart, tries the menu, writes the best trajectory.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if no motion tells any pair apart.
pub fn suggest(arguments: &GapSuggestArguments) -> Result<(), CliError> {
    if arguments.out.extension().is_some_and(|end| end == "csv") {
        return Err(CliError::Input(format!(
            "--out {}: the trajectory is written as TOML, and `run` would read a .csv as a table; name it .toml",
            arguments.out.display()
        )));
    }
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    let questions = questions(arguments, &robot)?;
    let bar = progress_bar();
    let weighed = weighed(
        &robot,
        &questions,
        arguments.duration.as_secs_f64(),
        &mut |done, _| {
            bar.set_position(done as u64);
        },
    );
    bar.finish_and_clear();
    let weighed = weighed?;
    if let Some(best) = weighed.best() {
        let file = trajectory_file(&robot, &weighed.seats, &best.reference)?;
        write_text(&arguments.out, &file)?;
    }
    tell(arguments, &weighed)?;
    match weighed.best() {
        Some(_) => Ok(()),
        None => Err(CliError::Negative(format!(
            "no motion on the menu tells them apart, so {} was not written; {}",
            arguments.out.display(),
            weighed.first_advice()
        ))),
    }
}

/// A suggested experiment.
#[derive(Clone, Debug)]
pub struct Suggested {
    /// The trajectory file.
    pub trajectory: String,
    /// The choice as the command writes it with `--json`.
    pub json: String,
}

/// The experiment that would best tell apart what a report could not; `each` hears how many of the menu's experiments were tried, and of
/// how many.
///
/// # Errors
/// [`CliError::Input`] if the report does not fit the robot, [`CliError::Negative`] if nothing is confused or no motion helps.
pub fn suggested(
    robot: &Robot,
    report: &Report,
    duration_s: f64,
    each: &mut dyn FnMut(usize, usize),
) -> Result<Suggested, CliError> {
    let questions = of_report(report, "report", robot)?;
    let weighed = weighed(robot, &questions, duration_s, each)?;
    let best = weighed.best().ok_or_else(|| {
        CliError::Negative(format!(
            "no motion on the menu tells them apart; {}",
            weighed.first_advice()
        ))
    })?;
    let suggestion = weighed.suggestion(None);
    Ok(Suggested {
        trajectory: trajectory_file(robot, &weighed.seats, &best.reference)?,
        json: serde_json::to_string(&suggestion).map_err(CliError::input)?,
    })
}

/// What the menu came to.
struct Weighed {
    seats: Vec<Seat>,
    tried: Vec<Tried>,
    pairs: Vec<ToldPair>,
    best: Option<usize>,
}

impl Weighed {
    fn best(&self) -> Option<&Tried> {
        Some(&self.tried[self.best?])
    }

    fn first_advice(&self) -> &'static str {
        let first = self.pairs.first();
        first.and_then(|pair| pair.advice).unwrap_or_default()
    }

    /// `trajectory`: where it was written.
    fn suggestion<'a>(&self, trajectory: Option<&'a Path>) -> Suggestion<'a> {
        let menu = self.tried.iter().map(|one| ToldExperiment {
            experiment: one.experiment.name(),
            distances: one.separations.iter().map(|s| s.distance).collect(),
        });
        let best = self.best();
        Suggestion {
            schema: 1,
            trajectory: trajectory.filter(|_| best.is_some()),
            experiment: best.map(|best| best.experiment.name()),
            pairs: self.pairs.clone(),
            menu: menu.collect(),
        }
    }
}

/// Tries the menu and chooses.
fn weighed(
    robot: &Robot,
    questions: &[Question],
    duration_s: f64,
    each: &mut dyn FnMut(usize, usize),
) -> Result<Weighed, CliError> {
    let seats = seats(robot, questions)?;
    let tried = try_all(robot, questions, &seats, duration_s, each)?;
    let told = |k: usize| tried.iter().map(move |one| one.separations[k].distance);
    let separable: Vec<usize> = (0..questions.len())
        .filter(|k| told(*k).any(|distance| distance >= DISTANCE_MIN))
        .collect();
    let smallest = |one: &Tried| {
        let distances = separable.iter().map(|k| one.separations[*k].distance);
        distances.fold(f64::INFINITY, f64::min)
    };
    let best = (0..tried.len())
        .max_by(|a, b| smallest(&tried[*a]).total_cmp(&smallest(&tried[*b])))
        .filter(|_| !separable.is_empty());
    let pairs = questions.iter().enumerate().map(|(k, question)| {
        let written = best.map(|one| tried[one].separations[k].distance);
        let expected = written.filter(|_| separable.contains(&k));
        ToldPair {
            joint: robot.joints[question.joint].name.clone(),
            effects: question.effects.clone(),
            distance_now: question.distance_now,
            distance_expected: expected.unwrap_or_else(|| told(k).fold(0.0, f64::max)),
            advice: (!separable.contains(&k)).then(|| advice(&question.effects)),
        }
    });
    let pairs = pairs.collect();
    Ok(Weighed {
        seats,
        pairs,
        best,
        tried,
    })
}

/// The joints asked about move, the others hold.
fn seats(robot: &Robot, questions: &[Question]) -> Result<Vec<Seat>, CliError> {
    let seat = |joint: usize| {
        if questions.iter().any(|question| question.joint == joint) {
            room(robot, joint).map(Seat::Moves)
        } else {
            Ok(Seat::Holds(motion::home_rad(&robot.joints[joint])))
        }
    };
    (0..robot.joints.len()).map(seat).collect()
}

/// In experiments.
fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::new(Experiment::ALL.len() as u64);
    let template = "{bar:32} {pos} of {len} experiments, {eta} left";
    let style = ProgressStyle::with_template(template);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

fn try_all(
    robot: &Robot,
    questions: &[Question],
    seats: &[Seat],
    duration_s: f64,
    each: &mut dyn FnMut(usize, usize),
) -> Result<Vec<Tried>, CliError> {
    let pairs: Vec<Pair> = questions.iter().flat_map(Question::pairs).collect();
    let mut tried = Vec::new();
    for (done, experiment) in Experiment::ALL.into_iter().enumerate() {
        if let Some((reference, recording)) = rehearsed(robot, experiment, seats, duration_s)? {
            let found = separations(robot, &recording, &pairs).map_err(CliError::input)?;
            tried.push(Tried {
                experiment,
                reference,
                separations: of_questions(questions, found),
            });
        }
        each(done + 1, Experiment::ALL.len());
    }
    if tried.is_empty() {
        return Err(CliError::Negative(
            "the robot file's controller follows none of the experiments within the limits; check its gains and torque_limit_nm"
                .to_owned(),
        ));
    }
    Ok(tried)
}

/// Of both directions of a question the one that is harder to tell.
fn of_questions(questions: &[Question], found: Vec<Separation>) -> Vec<Separation> {
    let mut found = found.into_iter();
    let each = questions.iter().map(|question| {
        let own = found.by_ref().take(question.pairs().count());
        let least = own.min_by(|a, b| a.distance.total_cmp(&b.distance));
        least.unwrap_or(Separation {
            distance: 0.0,
            shows: None,
        })
    });
    each.collect()
}

/// An experiment on the nominal plant, slowed down until the motors have the torque for it; none if they never have.
fn rehearsed(
    robot: &Robot,
    experiment: Experiment,
    seats: &[Seat],
    duration_s: f64,
) -> Result<Option<(SampledReference, Recording)>, CliError> {
    for factor in SLOWER {
        let seats: Vec<Seat> = seats
            .iter()
            .map(|seat| match seat {
                Seat::Moves(room) => Seat::Moves(room.slower(factor)),
                holds => *holds,
            })
            .collect();
        let reference = experiment.reference(&seats, duration_s);
        // beyond a limit between two waypoints, which a slower one keeps
        let Ok(trajectory) = Trajectory::sampled(reference.clone(), robot) else {
            continue;
        };
        let course = Course {
            trajectory,
            duration_s,
            seed: SEED,
        };
        match course.run_nominal(robot, &|| true) {
            Ok(run) if has_torque_for(robot, &run.recording) => {
                return Ok(Some((reference, run.recording)));
            }
            // too hard, or so hard that the loop stopped
            Ok(_) | Err(CliError::Negative(_)) => {}
            Err(input) => return Err(input),
        }
    }
    Ok(None)
}

fn has_torque_for(robot: &Robot, recording: &Recording) -> bool {
    robot.joints.iter().all(|joint| {
        let limit_nm = joint.torque_limit_nm.unwrap_or(f64::INFINITY);
        let command_nm = recording.signal(&joint.name, Signal::CommandTorqueNm);
        command_nm.is_ok_and(|column| column.iter().all(|nm| nm.abs() < TORQUE_PART * limit_nm))
    })
}

/// The joints that move; the others hold their home by themselves.
fn trajectory_file(
    robot: &Robot,
    seats: &[Seat],
    reference: &SampledReference,
) -> Result<String, CliError> {
    let moving = (0..seats.len()).filter(|joint| matches!(seats[*joint], Seat::Moves(_)));
    let entry = |joint: usize| {
        JointEntry::Waypoints(WaypointsEntry {
            name: robot.joints[joint].name.clone(),
            step_s: STEP_S,
            positions_rad: rounded(&reference.joints[joint].positions_rad),
        })
    };
    let file = TrajectoryFile {
        joints: moving.map(entry).collect(),
        ..TrajectoryFile::default()
    };
    file.to_toml().map_err(CliError::input)
}

/// A tenth of a microradian is less than any encoder shows.
fn rounded(positions_rad: &[f64]) -> Vec<f64> {
    positions_rad
        .iter()
        .map(|position_rad| (position_rad * 1e7).round() / 1e7)
        .collect()
}

fn tell(arguments: &GapSuggestArguments, weighed: &Weighed) -> Result<(), CliError> {
    if let Some(path) = &arguments.json {
        write_json(&weighed.suggestion(Some(&arguments.out)), path)?;
    }
    let (pairs, tried, best) = (&weighed.pairs, &weighed.tried, weighed.best());
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    let mut text = format!("{}\n", menu_table(pairs, tried));
    for (k, pair) in pairs.iter().enumerate() {
        let [one, other] = &pair.effects;
        let now = pair
            .distance_now
            .map_or_else(String::new, |now| format!("{} now, ", number(now, 3)));
        let _ = write!(
            text,
            "{}: {one} or {other}: d² {now}{} expected",
            pair.joint,
            number(pair.distance_expected, 3)
        );
        let shows = best.and_then(|best| best.separations[k].shows.as_ref());
        match (pair.advice, shows) {
            (Some(advice), _) => {
                let _ = writeln!(text, "; below {DISTANCE_MIN} on every motion: {advice}");
            }
            (None, Some(shows)) => {
                let _ = writeln!(text, "; {}", reason(shows));
            }
            (None, None) => text.push('\n'),
        }
    }
    if let Some(best) = best {
        let _ = writeln!(text, "best: {}", best.experiment.name());
        let _ = writeln!(text, "trajectory: {}", arguments.out.display());
    }
    print(&text)
}

fn reason(shows: &Regime) -> String {
    format!(
        "{} of what tells them apart lies at {} {} to {}",
        number(shows.share, 2),
        shows.variable,
        number(shows.from, 3),
        number(shows.to, 3)
    )
}

fn menu_table(pairs: &[ToldPair], tried: &[Tried]) -> Table {
    let mut rows = Table::new();
    let headings = pairs.iter().map(|pair| {
        let [one, other] = &pair.effects;
        format!("{}: d² of {one} and {other}", pair.joint)
    });
    rows.load_preset(presets::UTF8_HORIZONTAL_ONLY)
        .set_header(std::iter::once("experiment".to_owned()).chain(headings));
    for one in tried {
        let distances = one.separations.iter().map(|s| number(s.distance, 3));
        rows.add_row(std::iter::once(one.experiment.name().to_owned()).chain(distances));
    }
    rows
}
