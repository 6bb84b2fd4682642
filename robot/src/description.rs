//! Descriptions of robots that others' programs read: told from robot files by what is in them, and made into robot files.

use std::collections::BTreeMap;
use std::path::Path;

use crate::error::{Place, RobotError};
use crate::file::{RobotFile, down};
use crate::model::Model;
use crate::{RobotJoint, Tolerance, mjcf, urdf, xml};

/// A kind of description.
#[derive(Clone, Copy, PartialEq)]
pub enum Description {
    Urdf,
    Mjcf,
}

impl Description {
    /// What this text is, if it is no robot file; by its first element, or by the file's name where it has none.
    pub fn of(text: &str, path: &str) -> Result<Option<Self>, RobotError> {
        let lower = path.to_lowercase();
        match xml::root_name(text) {
            Some("robot") => Ok(Some(Self::Urdf)),
            Some("mujoco") => Ok(Some(Self::Mjcf)),
            Some(other) => Err(Place::new(path, "").invalid(format!(
                "the first element is <{other}>; a URDF begins with <robot>, a MuJoCo model with <mujoco>"
            ))),
            None if lower.ends_with(".urdf") || lower.ends_with(".xacro") => Ok(Some(Self::Urdf)),
            None if lower.ends_with(".xml") || lower.ends_with(".mjcf") => Ok(Some(Self::Mjcf)),
            None => Ok(None),
        }
    }

    /// The key by which a robot file names one.
    pub fn key(self) -> &'static str {
        match self {
            Self::Urdf => "urdf",
            Self::Mjcf => "mjcf",
        }
    }

    pub fn read(self, text: &str, path: &Path) -> Result<Model, RobotError> {
        let mut model = match self {
            Self::Urdf => urdf::read(text, &path.display().to_string())?,
            Self::Mjcf => mjcf::read(text, path)?,
        };
        model.make_names_usable();
        Ok(model)
    }

    /// The robot file beside the description that says the same.
    pub fn robot_file(self, text: &str, path: &Path) -> Result<RobotFile, RobotError> {
        let model = self.read(text, path)?;
        let joints: Vec<RobotJoint> = model
            .free_joints()
            .map(|joint| joint.drive.clone())
            .collect();
        let file_name = path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let named = |kind: Self| file_name.clone().filter(|_| kind == self);
        Ok(RobotFile {
            name: model.name.clone(),
            gravity_m_s2: model.gravity_m_s2.unwrap_or(down()),
            parameter_tolerance: Tolerance::default(),
            urdf: named(Self::Urdf),
            mjcf: named(Self::Mjcf),
            held: BTreeMap::new(),
            tool_origin_m: [0.0; 3],
            tool_origin_rpy_rad: [0.0; 3],
            shared_effects: Vec::new(),
            control: model.control_of(&joints),
            drive: None,
            joints,
            links: Vec::new(),
        })
    }
}
