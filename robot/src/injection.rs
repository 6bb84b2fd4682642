//! Injection files: effects put into a plant on purpose, each from a given time on.

use std::fs;
use std::path::Path;

use serde::Deserialize;

use crate::check::{self, Must};
use crate::drive_fault::DriveFaultEntry;
use crate::error::{Place, RobotError};
use crate::parse::{explain, parse};
use crate::push::PushEntry;
use crate::{Effect, Robot};

/// An effect that the plant has and the robot file has not.
///
/// Its parameters are changes against the robot file, except where the file has no such effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Injection {
    /// The joint; `None` for payload and base tilt, and for timing that acts on all joints.
    pub joint: Option<usize>,
    /// What happens.
    pub effect: Effect,
    /// When it begins, from the start of the run.
    pub start_s: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct InjectionFile {
    #[serde(default, rename = "effect")]
    effects: Vec<toml::Table>,
    #[serde(default, rename = "push")]
    pub pushes: Vec<PushEntry>,
    #[serde(default, rename = "drive_fault")]
    pub drive_faults: Vec<DriveFaultEntry>,
}

/// Reads the effects of an injection file: `[[effect]]` tables with `joint`, `effect`, its parameters, and `start_s`
/// (default 0).
///
/// # Errors
/// [`RobotError`]: one line with file, entry, and what to change.
pub fn load_injection(path: impl AsRef<Path>, robot: &Robot) -> Result<Vec<Injection>, RobotError> {
    let (file, text) = read_file(path.as_ref())?;
    parse_injection(&text, &file, robot)
}

/// The file's name, as errors call it, and its text.
pub(crate) fn read_file(path: &Path) -> Result<(String, String), RobotError> {
    let file = path.display().to_string();
    match fs::read_to_string(path) {
        Ok(text) => Ok((file, text)),
        Err(error) => Err(RobotError::Read {
            file,
            reason: error.to_string(),
            hint: String::new(),
        }),
    }
}

/// The same from text; `file` is what errors call it.
///
/// # Errors
/// [`RobotError`]: one line with file, entry, and what to change.
pub fn parse_injection(
    text: &str,
    file: &str,
    robot: &Robot,
) -> Result<Vec<Injection>, RobotError> {
    let InjectionFile {
        effects,
        pushes,
        drive_faults,
    } = parse(text, file)?;
    if effects.is_empty() && pushes.is_empty() && drive_faults.is_empty() {
        return Err(Place::new(file, "top level").invalid("no [[effect]] table found, add one"));
    }
    effects
        .into_iter()
        .enumerate()
        .map(|(index, entry)| injection(file, index, entry, robot))
        .collect()
}

fn injection(
    file: &str,
    index: usize,
    mut entry: toml::Table,
    robot: &Robot,
) -> Result<Injection, RobotError> {
    let label = entry
        .get("effect")
        .and_then(toml::Value::as_str)
        .unwrap_or_default();
    let place = Place::new(file, format!("effect {} `{label}`", index + 1));
    let joint = entry
        .remove("joint")
        .map(|name| joint_index(&place, &name, robot))
        .transpose()?;
    let start_s = entry
        .remove("start_s")
        .map_or(Ok(0.0), |start| start_time(&place, &start))?;
    let effect: Effect = entry.try_into().map_err(|error: toml::de::Error| {
        let own_keys: &[&str] = if error.message().starts_with("unknown field") {
            &["joint", "start_s"]
        } else {
            &[]
        };
        explain(error.message(), &place, own_keys)
    })?;
    check_with_nominal(&place, joint, effect, robot)?;
    if joint.is_none() && !effect.may_be_shared() {
        let names: Vec<&str> = robot
            .joints
            .iter()
            .map(|joint| joint.name.as_str())
            .collect();
        return Err(place.invalid(format!("joint is missing, add one of {}", names.join(", "))));
    }
    // A payload hangs on the last link and a tilt acts on the base, whatever joint an entry names.
    Ok(Injection {
        joint: joint.filter(|_| !effect.is_whole_arm()),
        effect,
        start_s,
    })
}

fn joint_index(place: &Place, name: &toml::Value, robot: &Robot) -> Result<usize, RobotError> {
    let name = name
        .as_str()
        .ok_or_else(|| place.invalid("joint must be a joint's name in quotes"))?;
    let known = || -> Vec<String> {
        robot
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .collect()
    };
    robot
        .joint_index(name)
        .ok_or_else(|| place.unknown("joint", name, &known()))
}

fn start_time(place: &Place, start: &toml::Value) -> Result<f64, RobotError> {
    let start_s = start
        .as_float()
        .or_else(|| start.as_integer().map(|whole| whole as f64));
    let start_s = start_s
        .ok_or_else(|| place.invalid(format!("start_s = {start} must be a number of seconds")))?;
    check::number(place, "start_s", start_s, Must::NotBeNegative)?;
    Ok(start_s)
}

/// What the plant then has, nominal plus injected, must be possible.
fn check_with_nominal(
    place: &Place,
    joint: Option<usize>,
    effect: Effect,
    robot: &Robot,
) -> Result<(), RobotError> {
    let nominal = match joint {
        Some(joint) => &robot.joints[joint].effects,
        None => &robot.shared_effects,
    };
    let mut both: Vec<Effect> = nominal
        .iter()
        .copied()
        .filter(|held| held.name() == effect.name())
        .collect();
    both.push(effect);
    check::effects(place, &both)
}
