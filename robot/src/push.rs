//! Pushes: torques that somebody or something outside exerts on a link for a while, as in a collision.
//!
//! They are no property of the robot, so they are no effect; they stand in injection files as `[[push]]` tables beside the
//! effects: `joint`, `torque_nm`, `start_s`, `duration_s`.

use std::path::Path;

use serde::Deserialize;

use crate::check::{self, Must};
use crate::error::{Place, RobotError};
use crate::injection::{InjectionFile, read_file};
use crate::parse::parse;
use crate::{Robot, RobotJoint};

/// A torque about a joint's axis, from a given time on and for a given time, at its full size at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// The joint about whose axis it turns the links behind it.
    pub joint: usize,
    /// Joint side, positive about the joint's axis.
    pub torque_nm: f64,
    /// From the start of the run.
    pub start_s: f64,
    /// Until it is over.
    pub duration_s: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PushEntry {
    joint: String,
    torque_nm: f64,
    start_s: f64,
    duration_s: f64,
}

/// Reads the pushes of an injection file.
///
/// # Errors
/// [`RobotError`]: one line with file, entry, and what to change.
pub fn load_pushes(path: impl AsRef<Path>, robot: &Robot) -> Result<Vec<Push>, RobotError> {
    let (file, text) = read_file(path.as_ref())?;
    parse_pushes(&text, &file, robot)
}

fn parse_pushes(text: &str, file: &str, robot: &Robot) -> Result<Vec<Push>, RobotError> {
    let entries = parse::<InjectionFile>(text, file)?.pushes;
    let each = entries.into_iter().enumerate();
    each.map(|(index, entry)| {
        push(
            &Place::new(file, format!("push {}", index + 1)),
            entry,
            robot,
        )
    })
    .collect()
}

fn push(place: &Place, entry: PushEntry, robot: &Robot) -> Result<Push, RobotError> {
    let joint = robot.joint_index(&entry.joint).ok_or_else(|| {
        let name = |joint: &RobotJoint| joint.name.clone();
        let known: Vec<String> = robot.joints.iter().map(name).collect();
        place.unknown("joint", &entry.joint, &known)
    })?;
    check::number(place, "torque_nm", entry.torque_nm, Must::BeFinite)?;
    check::number(place, "start_s", entry.start_s, Must::NotBeNegative)?;
    check::number(place, "duration_s", entry.duration_s, Must::BePositive)?;
    Ok(Push {
        joint,
        torque_nm: entry.torque_nm,
        start_s: entry.start_s,
        duration_s: entry.duration_s,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use std::fs;

    use super::*;

    fn read(text: &str) -> Result<Vec<Push>, RobotError> {
        let robot = crate::load("shd17").unwrap();
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        crate::load_injection(file.path(), &robot)?;
        load_pushes(file.path(), &robot)
    }

    #[test]
    fn a_push_is_read_and_each_slip_is_named() {
        let text = "[[push]]\njoint = \"joint1\"\ntorque_nm = -3\nstart_s = 2\nduration_s = 0.2\n";
        let push = Push {
            joint: 0,
            torque_nm: -3.0,
            start_s: 2.0,
            duration_s: 0.2,
        };
        assert_eq!(read(text).unwrap(), [push]);
        for (slip, told) in [
            (text.replace("joint1", "joint2"), "joint2"),
            (text.replace("0.2", "0"), "duration_s"),
            (text.replace("start_s = 2\n", ""), "start_s"),
            (text.replace("-3", "nan"), "torque_nm"),
        ] {
            let said = read(&slip).unwrap_err().to_string();
            assert!(said.contains(told) && said.lines().count() == 1, "{said}");
        }
    }
}
