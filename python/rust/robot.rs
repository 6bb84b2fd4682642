//! A robot: the text of its robot file, and what is built of it.

use std::path::{Path, PathBuf};

use flexspline::library::{RobotText, save};
use pyo3::prelude::*;
use robot::{RobotFile, Simulator, SimulatorFile, Source};

use crate::errors::{input, raised};

/// A robot file in memory.
#[pyclass(frozen, module = "flexspline._native")]
pub struct Robot {
    /// Everything as it was written; of a URDF or a MuJoCo model the robot file that says the same.
    pub text: String,
    pub source: Source,
    /// Shipped name or path, as it was given.
    pub given: String,
    pub built: robot::Robot,
}

impl Robot {
    /// Of a text that came from there.
    pub fn of(text: String, source: Source, given: String) -> PyResult<Self> {
        let file = RobotFile::parse(&text, &given).map_err(input)?;
        let built = file.build(source.clone()).map_err(input)?;
        Ok(Self {
            text,
            source,
            given,
            built,
        })
    }

    pub fn as_text(&self) -> RobotText<'_> {
        RobotText {
            text: &self.text,
            source: &self.source,
            name: &self.given,
        }
    }
}

#[pymethods]
impl Robot {
    /// Shipped name, robot file, URDF or MuJoCo model.
    #[new]
    fn new(py: Python<'_>, name_or_path: PathBuf) -> PyResult<Self> {
        let given = name_or_path.display().to_string();
        py.detach(|| {
            let (text, source) = robot::load_text(&given).map_err(input)?;
            Self::of(text, source, given)
        })
    }

    /// Of a text whose file names are relative to `given`.
    #[staticmethod]
    fn from_text(text: String, given: String) -> PyResult<Self> {
        let shipped = robot::shipped().find(|name| *name == given);
        let source = match shipped {
            Some(name) => Source::Shipped(name),
            None => Source::File(PathBuf::from(&given)),
        };
        Self::of(text, source, given)
    }

    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    #[getter]
    fn given(&self) -> &str {
        &self.given
    }

    #[getter]
    fn name(&self) -> &str {
        &self.built.name
    }

    #[getter]
    fn joints(&self) -> Vec<&str> {
        self.built.joint_names()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.built.notes.clone()
    }

    /// Writes the robot file; a URDF or a MuJoCo model that it names is then named from there.
    fn save_robot_file(&self, path: PathBuf) -> PyResult<()> {
        save(&self.text, &self.source, &path).map_err(raised)
    }

    /// In a simulator's format, `mjcf` or `urdf`, with files named from where `out` is; and what the format cannot say.
    fn written(&self, format: &str, out: PathBuf) -> PyResult<(String, Vec<String>)> {
        let simulator = match format {
            "mjcf" => Simulator::Mjcf,
            _ => Simulator::Urdf,
        };
        let out: &Path = &out;
        let file = SimulatorFile::of(&self.built, &self.given, simulator, out).map_err(input)?;
        Ok((file.text().map_err(input)?, file.notes))
    }
}
