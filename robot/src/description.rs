//! Descriptions of robots that others' programs read: told from robot files by what is in them, and made into robot files.

use std::collections::BTreeMap;
use std::path::Path;

use crate::error::{Place, RobotError};
use crate::file::{RobotFile, down};
use crate::model::Model;
use crate::{Tolerance, urdf, xml};

/// A kind of description.
#[derive(Clone, Copy)]
pub enum Description {
    Urdf,
}

impl Description {
    /// What this text is, if it is no robot file; by its first element, or by the file's name where it has none.
    pub fn of(text: &str, path: &str) -> Result<Option<Self>, RobotError> {
        let lower = path.to_lowercase();
        match xml::root_name(text) {
            Some("robot") => Ok(Some(Self::Urdf)),
            Some(other) => Err(Place::new(path, "").invalid(format!(
                "the first element is <{other}>; a URDF begins with <robot>"
            ))),
            None if lower.ends_with(".urdf") || lower.ends_with(".xacro") => Ok(Some(Self::Urdf)),
            None => Ok(None),
        }
    }

    /// The key by which a robot file names one.
    pub fn key(self) -> &'static str {
        match self {
            Self::Urdf => "urdf",
        }
    }

    pub fn read(self, text: &str, path: &Path) -> Result<Model, RobotError> {
        let file = path.display().to_string();
        match self {
            Self::Urdf => urdf::read(text, &file),
        }
    }

    /// The robot file beside the description that says the same.
    pub fn robot_file(self, text: &str, path: &Path) -> Result<RobotFile, RobotError> {
        let model = self.read(text, path)?;
        let file_name = path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let named = |kind: Self| file_name.clone().filter(|_| kind.key() == self.key());
        Ok(RobotFile {
            name: model.name.clone(),
            gravity_m_s2: model.gravity_m_s2.unwrap_or(down()),
            parameter_tolerance: Tolerance::default(),
            urdf: named(Self::Urdf),
            held: BTreeMap::new(),
            tool_origin_m: [0.0; 3],
            tool_origin_rpy_rad: [0.0; 3],
            shared_effects: Vec::new(),
            joints: model
                .free_joints()
                .map(|joint| joint.drive.clone())
                .collect(),
            control: model.control,
            links: Vec::new(),
        })
    }
}
