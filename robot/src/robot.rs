//! Robots: from a shipped name or a file to a chain with drives.

use std::fs;
use std::path::{Path, PathBuf};

use joint_model::JOINTS_MAX;
use joint_model::rigid_body::Chain;

use crate::description::Description;
use crate::error::{Place, RobotError, nearest};
use crate::file::{RobotFile, RobotJoint};
use crate::{Control, Effect, Tolerance};

/// The robots that come with the program, by name.
const SHIPPED: [(&str, &str); 2] = [
    ("pa10", include_str!("../../robots/pa10.toml")),
    ("shd17", include_str!("../../robots/shd17.toml")),
];

/// Where a robot's description came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// Part of the program.
    Shipped(&'static str),
    /// Read from this path.
    File(PathBuf),
}

/// A robot: rigid bodies, drives, and the controller that ran on it. The nominal model, the "sim" of every comparison.
#[derive(Clone, Debug)]
pub struct Robot {
    /// What the robot is called.
    pub name: String,
    /// Rigid bodies; [`Chain::links`] gives the links to rebuild a changed chain from.
    pub chain: Chain,
    /// Drives and sensors, in the chain's order.
    pub joints: Vec<RobotJoint>,
    /// Effects of the whole arm (payload, base tilt, bus timing), wherever the file wrote them.
    pub shared_effects: Vec<Effect>,
    /// What ran on the robot while it was recorded, where the file says anything of it; gains in the chain's order.
    pub control: Option<Control>,
    /// What the driver of the hardware needs to know; its keys are the driver's.
    pub drive: Option<toml::Table>,
    /// How well the values are known.
    pub tolerance: Tolerance,
    /// Where the description came from.
    pub source: Source,
    /// What was assumed, held or not read, each in one line; for people to read.
    pub notes: Vec<String>,
}

impl Robot {
    /// Index of the joint in the chain.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Whether the loop, the plant and the estimators have room for its joints; a diagnosis has for more.
    ///
    /// # Errors
    /// [`RobotError`] that says how many are too many.
    pub fn check_fits_loop(&self) -> Result<(), RobotError> {
        let count = self.joints.len();
        if count <= JOINTS_MAX {
            return Ok(());
        }
        Err(Place::new(&self.name, "").invalid(format!(
            "the robot has {count} joints, the loop takes at most {JOINTS_MAX}; list those that are meant in [[joint]] tables, the others are held"
        )))
    }

    /// Whether a joint slides: its rad and Nm are m and N.
    pub fn slides(&self, joint: usize) -> bool {
        self.chain.links()[joint].kind == joint_model::rigid_body::JointKind::Prismatic
    }

    /// The joints' names, in the chain's order.
    pub fn joint_names(&self) -> Vec<&str> {
        self.joints
            .iter()
            .map(|joint| joint.name.as_str())
            .collect()
    }
}

/// Names of the robots that come with the program.
pub fn shipped() -> impl Iterator<Item = &'static str> {
    SHIPPED.iter().map(|(name, _)| *name)
}

/// Loads a shipped robot by name, or by path a robot file, a URDF or a MuJoCo model.
///
/// Of a URDF or a MuJoCo model every joint that moves by itself is a joint of the robot, in the description's order;
/// [`Robot::moving_only`] then holds those that are not wanted.
///
/// # Errors
/// [`RobotError`]: one line with file, place, and what to change.
pub fn load(name_or_path: &str) -> Result<Robot, RobotError> {
    let (file, source) = load_file(name_or_path)?;
    file.build(source)
}

/// Reads what [`load`] reads without making the robot: to change values and write the file again. Of a URDF or a MuJoCo
/// model it is the robot file beside it that says the same.
///
/// # Errors
/// [`RobotError`]: one line with file, place, and what to change.
pub fn load_file(name_or_path: &str) -> Result<(RobotFile, Source), RobotError> {
    let (text, source) = load_raw(name_or_path)?;
    let file = match Description::of(&text, name_or_path)? {
        None => RobotFile::parse(&text, name_or_path)?,
        Some(description) => description.robot_file(&text, Path::new(name_or_path))?,
    };
    Ok((file, source))
}

/// Reads the text of what [`load`] reads: to change it and keep the rest as it was written. Of a URDF or a MuJoCo model it is
/// the text of the robot file beside it that says the same.
///
/// # Errors
/// [`RobotError`] if there is no such file, or it is a URDF or a MuJoCo model that cannot be read.
pub fn load_text(name_or_path: &str) -> Result<(String, Source), RobotError> {
    let (text, source) = load_raw(name_or_path)?;
    let Some(description) = Description::of(&text, name_or_path)? else {
        return Ok((text, source));
    };
    let file = description.robot_file(&text, Path::new(name_or_path))?;
    let text = file.to_toml().map_err(|error| {
        Place::new(name_or_path, "").invalid(format!("cannot be written as a robot file: {error}"))
    })?;
    Ok((text, source))
}

/// The very text, of whatever kind.
pub(crate) fn load_raw(name_or_path: &str) -> Result<(String, Source), RobotError> {
    if let Some((name, text)) = SHIPPED.iter().find(|(name, _)| *name == name_or_path) {
        return Ok(((*text).to_owned(), Source::Shipped(name)));
    }
    let text = fs::read_to_string(name_or_path).map_err(|error| RobotError::Read {
        file: name_or_path.to_owned(),
        reason: error.to_string(),
        hint: shipped_hint(name_or_path),
    })?;
    Ok((text, Source::File(PathBuf::from(name_or_path))))
}

fn shipped_hint(name: &str) -> String {
    let names: Vec<String> = shipped().map(str::to_owned).collect();
    match nearest(name, &names) {
        Some(near) => format!("; did you mean the shipped robot `{near}`?"),
        None => format!(
            "; give a robot file, or one of the shipped robots {}",
            names.join(", ")
        ),
    }
}
