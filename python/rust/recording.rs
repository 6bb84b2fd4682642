//! A recording: columns in, views of them out.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use numpy::ndarray::ArrayView1;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use recording::{GuessJoint, ReadError, ReadProblem, Signal, from_columns};

use crate::errors::{input, raised};
use crate::robot::Robot;

/// A recording in memory, which nobody changes any more.
#[pyclass(frozen, module = "flexspline._native")]
pub struct Recording {
    pub name: String,
    pub table: Arc<recording::Recording>,
    /// What its columns were taken for, where nothing said it.
    guessed: Vec<String>,
}

impl Recording {
    pub fn of(name: String, table: recording::Recording) -> Self {
        Self {
            name,
            table: Arc::new(table),
            guessed: Vec::new(),
        }
    }
}

#[pymethods]
impl Recording {
    /// Of arrays by name; they are copied, because whoever has them may change them while the lock is released.
    #[staticmethod]
    fn from_columns(
        py: Python<'_>,
        name: String,
        columns: Vec<(String, PyReadonlyArray1<'_, f64>)>,
        robot: Option<&Robot>,
    ) -> PyResult<Self> {
        let copy = |array: &PyReadonlyArray1<'_, f64>| match array.as_slice() {
            Ok(values) => values.to_vec(),
            Err(_) => array.as_array().to_vec(),
        };
        let columns: Vec<(String, Vec<f64>)> = columns
            .iter()
            .map(|(name, array)| (name.clone(), copy(array)))
            .collect();
        let joints = robot.map_or_else(Vec::new, guess_joints);
        let (table, guess) = py
            .detach(|| from_columns(Path::new(&name), columns, &joints))
            .map_err(|error| input(in_memory(error)))?;
        Ok(Self {
            guessed: guess.map_or_else(Vec::new, |guess| guess.lines()),
            ..Self::of(name, table)
        })
    }

    /// A file of any format that is read, with a mapping file or the one beside it; of a robot also without.
    #[staticmethod]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        robot: Option<&Robot>,
        mapping: Option<PathBuf>,
    ) -> PyResult<Self> {
        let (table, guessed) = py
            .detach(|| match robot {
                Some(robot) => flexspline::library::read_of(
                    &path,
                    mapping.as_deref(),
                    &robot.built,
                    &robot.given,
                ),
                None => flexspline::library::read(&path, mapping.as_deref())
                    .map(|table| (table, String::new())),
            })
            .map_err(raised)?;
        Ok(Self {
            guessed: guessed.lines().map(str::to_owned).collect(),
            ..Self::of(path.display().to_string(), table)
        })
    }

    /// As `.mcap`, `.parquet` or `.csv`.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| flexspline::library::write(&self.table, &path))
            .map_err(raised)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    #[getter]
    fn guessed(&self) -> Vec<String> {
        self.guessed.clone()
    }

    #[getter]
    fn rows(&self) -> usize {
        self.table.rows()
    }

    #[getter]
    fn sample_rate_hz(&self) -> f64 {
        self.table.sample_rate_hz
    }

    #[getter]
    fn metadata(&self) -> BTreeMap<String, String> {
        self.table.metadata.clone()
    }

    #[getter]
    fn joints(&self) -> Vec<&str> {
        self.table.joint_names().collect()
    }

    /// The signals that a joint has.
    fn signals(&self, joint: &str) -> PyResult<Vec<&'static str>> {
        let columns = self.table.joint(joint).map_err(input)?;
        Ok(columns.signals.keys().map(|signal| signal.name()).collect())
    }

    /// One signal of a joint, a value a row.
    fn column<'py>(
        this: &Bound<'py, Self>,
        joint: &str,
        signal: &str,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let known = Signal::from_name(signal).ok_or_else(|| {
            let all: Vec<&str> = Signal::ALL.iter().map(|signal| signal.name()).collect();
            input(format!(
                "`{signal}` is no signal; signals are {}",
                all.join(", ")
            ))
        })?;
        let values = this.get().table.signal(joint, known).map_err(input)?;
        view(this, values)
    }

    /// Times of the rows.
    #[getter]
    fn time_s<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view(this, &this.get().table.time_s)
    }
}

/// An array that shows a recording's own values, which only can be read.
#[allow(
    unsafe_code,
    reason = "the array shows memory of the recording, which it keeps alive"
)]
fn view<'py>(of: &Bound<'py, Recording>, values: &[f64]) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let values = ArrayView1::from(values);
    // SAFETY: the values belong to the recording that `of` keeps alive as the array's base; the class is frozen and nothing ever
    // changes them or gives them another place.
    let array = unsafe { PyArray1::borrow_from_array(&values, of.clone().into_any()) };
    array.try_readwrite().map_err(input)?.make_nonwriteable();
    Ok(array)
}

/// What a guess must know of the robot.
fn guess_joints(robot: &Robot) -> Vec<GuessJoint> {
    let joints = robot.built.joints.iter();
    joints
        .enumerate()
        .map(|(index, joint)| GuessJoint {
            name: joint.name.clone(),
            gear_ratio: joint.gear_ratio,
            is_limited: joint.position_limit_rad.is_some(),
            has_rotor: joint.rotor_inertia_kg_m2 > 0.0,
            slides: robot.built.slides(index),
        })
        .collect()
}

/// What to change of a table in memory, which no mapping file belongs to.
fn in_memory(error: ReadError) -> String {
    let name = error.path.display().to_string();
    let columns = match &error.problem {
        ReadProblem::NoSignals { columns, .. } | ReadProblem::NoTimeColumn { columns, .. } => {
            columns.join(", ")
        }
        ReadProblem::Doubtful { columns, why } => format!("{}: {why}", columns.join(", ")),
        ReadProblem::SampleRateUnknown { rows, .. } => {
            return format!(
                "{name}: has {rows} rows, from which no sample rate can be told; give two rows of different times or more"
            );
        }
        _ => return error.to_string(),
    };
    format!(
        "{name}: which column is which signal cannot be told ({columns}); name the columns `time_s` and `JOINT.SIGNAL`, such as \
         `elbow.motor_torque_nm`"
    )
}
