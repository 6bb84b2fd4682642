//! Trajectory files: a kind for the whole arm, and a table for each joint that does something else.

use std::fs;
use std::path::Path;

use robot::{Place, Robot, RobotError, nearest, parse_toml};
use serde::{Deserialize, Serialize};

use crate::defaults;
use crate::entry::{JointEntry, Must, number};
use crate::joint_motion::JointMotion;
use crate::lemniscate::Lemniscate;
use crate::trajectory::{Motion, Trajectory};
use crate::waypoints::Waypoints;
use crate::{MotionError, PaTenArm};

/// The trajectories that go by name.
pub const NAMES: [&str; 5] = ["lemniscate", "trapezoid", "sine", "multi_sine", "hold"];

/// Soft start of motions that would otherwise begin abruptly.
const SOFT_START_S: f64 = 2.0;

/// What a whole arm does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrajectoryKind {
    /// The tool path of PA10-05, eq (14); only for arms like the PA-10, and for all joints at once.
    Lemniscate,
    /// One joint moves, the others hold.
    Trapezoid,
    /// All joints swing at one frequency, spread in phase.
    Sine,
    /// All joints swing at many frequencies.
    MultiSine,
    /// All joints hold.
    #[default]
    Hold,
}

/// A trajectory file, key by key. What is left out takes the robot's defaults.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrajectoryFile {
    /// What joints without a table do.
    #[serde(default)]
    pub kind: TrajectoryKind,
    /// Length of the soft start; default 2 s where the motion would begin abruptly, else 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub soft_start_s: Option<f64>,
    /// How long to run; default until the motion is over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration_s: Option<f64>,
    /// Joints that do something of their own.
    #[serde(default, rename = "joint", skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<JointEntry>,
}

impl TrajectoryFile {
    /// The text of a file that says the same.
    ///
    /// # Errors
    /// [`toml::ser::Error`] for a value that TOML does not have.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }
}

/// Loads a trajectory by name, from a TOML file or from a CSV file of waypoints.
///
/// # Errors
/// [`MotionError`]: one line with what is wrong, where, and what to change.
pub fn load(name_or_path: &str, robot: &Robot) -> Result<Trajectory, MotionError> {
    if let Some(kind) = named(name_or_path) {
        return TrajectoryFile {
            kind,
            ..TrajectoryFile::default()
        }
        .build(name_or_path, robot);
    }
    let path = Path::new(name_or_path);
    let extension = path
        .extension()
        .and_then(|extension| extension.to_str())
        .unwrap_or_default();
    if !path.is_file() && !["toml", "csv"].contains(&extension) {
        return Err(unknown(name_or_path));
    }
    let text = fs::read_to_string(path).map_err(|error| RobotError::Read {
        file: name_or_path.to_owned(),
        reason: error.to_string(),
        hint: format!("; give a TOML or CSV file, or one of {}", NAMES.join(", ")),
    })?;
    if extension == "csv" {
        let waypoints = Waypoints::parse(&text, name_or_path, robot)?;
        return Trajectory::new(Motion::Waypoints(waypoints), 0.0, None, robot);
    }
    parse_toml::<TrajectoryFile>(&text, name_or_path)?.build(name_or_path, robot)
}

fn named(name: &str) -> Option<TrajectoryKind> {
    use TrajectoryKind::{Hold, Lemniscate, MultiSine, Sine, Trapezoid};
    let kinds = [Lemniscate, Trapezoid, Sine, MultiSine, Hold];
    NAMES
        .iter()
        .zip(kinds)
        .find(|(known, _)| **known == name)
        .map(|(_, kind)| kind)
}

fn unknown(name: &str) -> MotionError {
    let near =
        nearest(name, &NAMES.map(str::to_owned)).map(|near| format!("; did you mean `{near}`?"));
    MotionError::Unknown {
        name: name.to_owned(),
        hint: near.unwrap_or_default(),
    }
}

impl TrajectoryFile {
    /// Checks the file and makes the trajectory; `file` is what errors call it.
    ///
    /// # Errors
    /// [`MotionError`]: one line with what is wrong, where, and what to change.
    pub fn build(&self, file: &str, robot: &Robot) -> Result<Trajectory, MotionError> {
        let top = Place::new(file, "top level");
        number(&top, "soft_start_s", self.soft_start_s, Must::NotBeNegative)?;
        number(&top, "duration_s", self.duration_s, Must::BePositive)?;
        let motion = if self.kind == TrajectoryKind::Lemniscate {
            if !self.joints.is_empty() {
                let what = "the lemniscate moves the whole arm; remove the [[joint]] tables or choose another kind";
                return Err(top.invalid(what).into());
            }
            Motion::Lemniscate(Box::new(Lemniscate::new(PaTenArm::new(&robot.chain)?)?))
        } else {
            Motion::Joints(self.joint_motions(file, robot)?)
        };
        let usual_s = if motion.starts_at_rest() {
            0.0
        } else {
            SOFT_START_S
        };
        Trajectory::new(
            motion,
            self.soft_start_s.unwrap_or(usual_s),
            self.duration_s,
            robot,
        )
    }

    fn joint_motions(&self, file: &str, robot: &Robot) -> Result<Vec<JointMotion>, RobotError> {
        let mut entries: Vec<Option<&JointEntry>> = vec![None; robot.joints.len()];
        for entry in &self.joints {
            let place = Place::new(file, format!("joint `{}`", entry.name()));
            let known = || -> Vec<String> {
                robot
                    .joints
                    .iter()
                    .map(|joint| joint.name.clone())
                    .collect()
            };
            let index = robot
                .joint_index(entry.name())
                .ok_or_else(|| place.unknown("joint", entry.name(), &known()))?;
            if entries[index].replace(entry).is_some() {
                return Err(place.invalid("the joint has two [[joint]] tables, remove one"));
            }
        }
        let motion = |(index, entry): (usize, Option<&JointEntry>)| match entry {
            Some(entry) => entry.motion(file, index, robot),
            None => defaults::entry(self.kind, index, robot).motion(file, index, robot),
        };
        entries.into_iter().enumerate().map(motion).collect()
    }
}
