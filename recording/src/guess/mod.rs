//! Guesses what the columns of a foreign log hold: by their names, by the robot's joints, and by physics.
//!
//! [`names`] tells joints and units, [`numbers`] which numbers are joints', [`velocities`] what a position's difference says, and this what becomes of it.

mod names;
mod numbers;
mod velocities;

use crate::clock::UnitsPerSecond;
use crate::error::one_line;
use crate::frame::Frame;
use crate::mapping::Mapping;
use crate::{ReadError, ReadProblem, Signal, sources};
use names::Guesser;
use std::fmt::{self, Write};
use std::path::Path;

/// A joint of the robot that a log is of.
#[derive(Clone, Debug)]
pub struct GuessJoint {
    /// As the robot file names it.
    pub name: String,
    /// Motor angle over link angle; negative if the gear reverses.
    pub gear_ratio: f64,
    /// Whether the robot file states a range of positions, so that it cannot turn round and round.
    pub is_limited: bool,
    /// Whether the robot file states a rotor's inertia, so that its torque is a motor's.
    pub has_rotor: bool,
    /// Whether it slides: its signals are m and N where those of others are rad and Nm.
    pub slides: bool,
}

/// How sure a guess is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sure {
    /// Told by nothing but custom: look at it.
    Doubtful,
    /// By the name or by the numbers.
    Likely,
    /// The name or the format says it.
    Certain,
}

/// What a column was taken for.
#[derive(Clone, Debug)]
pub struct GuessedColumn {
    /// Its name in the log.
    pub column: String,
    /// The robot's joint.
    pub joint: String,
    /// What it holds of that.
    pub signal: Signal,
    /// Signal over column.
    pub scale: f64,
    /// How sure that is.
    pub sure: Sure,
    /// What decided it.
    pub why: String,
}

/// What a log's columns were taken for.
#[derive(Clone, Debug, Default)]
pub struct Guess {
    /// In the order of the robot's joints.
    pub columns: Vec<GuessedColumn>,
    /// Columns that were left out, and why.
    pub left_out: Vec<(String, String)>,
    /// Whether it is known which column is the time.
    pub has_time: bool,
    /// The column of times whose unit velocities told.
    pub(crate) time: Option<GuessedTime>,
}

/// The unit of times that was guessed.
#[derive(Clone, Debug)]
pub(crate) struct GuessedTime {
    column: String,
    unit: UnitsPerSecond,
}

/// Guesses what the columns of a log hold.
///
/// # Errors
/// If the log cannot be read, or is a recording of ours, of which there is nothing to guess.
pub fn guess(path: &Path, joints: &[GuessJoint]) -> Result<Guess, ReadError> {
    let frame = sources::source(path).and_then(|source| source.frame(path, &Mapping::default()));
    let frame = frame.map_err(|problem| ReadError {
        path: path.to_owned(),
        problem,
    })?;
    Ok(guess_frame(&frame, joints))
}

/// Guesses what the columns of a log hold that was read.
pub(crate) fn guess_frame(frame: &Frame, joints: &[GuessJoint]) -> Guess {
    Guesser::new(frame, joints).guess()
}

impl Guess {
    /// What custom alone tells, so that somebody must look at it.
    pub fn doubtful(&self) -> impl Iterator<Item = &GuessedColumn> {
        let doubtful = |found: &&GuessedColumn| found.sure == Sure::Doubtful;
        self.columns.iter().filter(doubtful)
    }

    /// What it says, as a mapping file at that path would.
    ///
    /// # Errors
    /// Names what is doubtful.
    pub(crate) fn mapping(&self, mapping_path: &Path) -> Result<Mapping, ReadProblem> {
        let doubtful: Vec<String> = self.doubtful().map(|found| found.column.clone()).collect();
        if let Some(first) = self.doubtful().next() {
            let why = first.why.clone();
            return Err(ReadProblem::Doubtful {
                columns: doubtful,
                why,
            });
        }
        let mapping = Mapping::parse(&self.to_toml());
        mapping.map_err(|problem| ReadProblem::Mapping {
            mapping: mapping_path.to_owned(),
            problem,
        })
    }

    /// One line for each joint that something was found of.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let mut lines: Vec<(&str, String)> = Vec::new();
        for found in &self.columns {
            let column = one_line(&found.column);
            let told = match found.scale {
                1.0 => format!("{} is `{column}`", found.signal),
                scale => format!("{} is {scale:.6} × `{column}`", found.signal),
            };
            match lines.last_mut().filter(|(joint, _)| *joint == found.joint) {
                Some((_, line)) => *line += &format!(", {told}"),
                None => lines.push((&found.joint, told)),
            }
        }
        let lines = lines.into_iter();
        lines
            .map(|(joint, told)| format!("{joint}: {told}"))
            .collect()
    }

    /// The mapping file that says the same.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut text =
            String::from("# Guessed by `flexspline recording map`. Value = scale·x + offset.\n");
        if !self.has_time {
            text.push_str(NO_TIME);
        }
        if let Some(GuessedTime { column, unit }) = &self.time {
            let (column, scale) = (quoted(column), unit.seconds());
            let unit = unit.name();
            let _ = writeln!(
                text,
                "\n[columns]\ntime_s = {{ column = {column}, scale = {scale:?} }}   # likely: {unit}, as velocities agree with positions then"
            );
        }
        let mut joint = "";
        for found in &self.columns {
            if found.joint != joint {
                joint = &found.joint;
                let _ = writeln!(text, "\n[joint.{}]", quoted(joint));
            }
            let column = quoted(&found.column);
            let value = match found.scale {
                1.0 => column,
                scale => format!("{{ column = {column}, scale = {scale:?} }}"),
            };
            let _ = writeln!(
                text,
                "{} = {value}   # {}: {}",
                found.signal, found.sure, found.why
            );
        }
        text
    }
}

/// What a mapping file must be told before the log can be read.
const NO_TIME: &str = "
# Which column is the time is not known: take the # off one of these.
# sample_rate_hz = 500.0
# [columns]
# time_s = \"…\"
";

/// As TOML writes a text.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

impl fmt::Display for Sure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Doubtful => "doubtful",
            Self::Likely => "likely",
            Self::Certain => "certain",
        })
    }
}
