//! What is done with a robot: simulated, moved on purpose, identified, and its torque computed.

use std::path::PathBuf;

use flexspline::library::{self, Course, Followed};
use gap_report::Report;
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::errors::{input, raised};
use crate::recording::Recording;
use crate::robot::Robot;
use crate::work::detached;

/// Rows between two looks at Ctrl-C: a millisecond or two.
const ROWS_AT_ONCE: usize = 1 << 12;

/// Follows a recording's reference with the nominal model.
#[pyfunction]
pub fn simulate_recording(
    py: Python<'_>,
    robot: &Robot,
    recording: &Recording,
    seed: u64,
) -> PyResult<Recording> {
    let followed = Followed {
        robot: &robot.built,
        robot_name: &robot.given,
        table: &recording.table,
        file: recording.name.as_ref(),
        seed,
    };
    let simulated = detached(py, Some(1), None, |waiting| {
        followed.simulated(&|| waiting.is_there())
    })?;
    let name = format!("simulation of {}", recording.name);
    Ok(Recording::of(name, simulated.map_err(raised)?))
}

/// Follows a trajectory, by its name or file, with the nominal model.
#[pyfunction]
pub fn simulate_trajectory(
    py: Python<'_>,
    robot: &Robot,
    trajectory: PathBuf,
    duration_s: f64,
    seed: u64,
) -> PyResult<Recording> {
    let name = trajectory.display().to_string();
    let course = Course {
        trajectory: motion::load(&name, &robot.built).map_err(input)?,
        duration_s,
        seed,
    };
    let run = detached(py, Some(1), None, |waiting| {
        course.run_nominal(&robot.built, &|| waiting.is_there())
    })?;
    let recording = run.map_err(raised)?.recording;
    Ok(Recording::of(format!("simulation of {name}"), recording))
}

/// The trajectory file of the experiment that tells most, and the choice as JSON.
#[pyfunction]
#[pyo3(signature = (robot, report, duration_s, threads, progress))]
pub fn suggest(
    py: Python<'_>,
    robot: &Robot,
    report: &str,
    duration_s: f64,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String)> {
    let report = Report::from_json(report).map_err(input)?;
    let suggested = detached(py, threads, progress.as_ref(), |waiting| {
        library::suggested(&robot.built, &report, duration_s, &mut |done, of| {
            waiting.tell(done, of);
        })
    })?;
    let suggested = suggested.map_err(raised)?;
    Ok((suggested.trajectory, suggested.json))
}

/// Identifies into a folder.
#[pyfunction]
pub fn identify(
    py: Python<'_>,
    robot: &str,
    what: &str,
    out: PathBuf,
    joints: Vec<String>,
    seed: u64,
) -> PyResult<()> {
    let identified = detached(py, None, None, |_| {
        library::identify_into(&out, what, robot, &joints, seed)
    })?;
    identified.map_err(raised)
}

/// Torque at the joints along a motion, row by row: rigid bodies with what the robot file adds to them, and rotors. The arrays are read
/// where they lie if their rows follow one another.
#[pyfunction]
pub fn inverse_dynamics<'py>(
    py: Python<'py>,
    robot: &Robot,
    position: PyReadonlyArray2<'py, f64>,
    velocity: PyReadonlyArray2<'py, f64>,
    acceleration: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let joints = robot.built.joints.len();
    let rows = position.shape()[0];
    let chain = robot.built.loaded_chain().map_err(input)?;
    let rotors_kg_m2: Vec<f64> = robot
        .built
        .joints
        .iter()
        .map(|joint| joint.rotor_inertia_kg_m2 * joint.gear_ratio.powi(2))
        .collect();
    let torque = PyArray2::<f64>::zeros(py, [rows, joints], false);
    let mut written = torque.try_readwrite().map_err(input)?;
    let torque_nm = written.as_slice_mut().map_err(input)?;
    let motion = [&position, &velocity, &acceleration];
    let motion: Vec<&[f64]> = motion
        .into_iter()
        .map(|array| array.as_slice().map_err(input))
        .collect::<PyResult<_>>()?;
    for row in 0..rows {
        if row % ROWS_AT_ONCE == 0 {
            py.check_signals()?;
        }
        let of = row * joints..(row + 1) * joints;
        let [q, v, a] = [0, 1, 2].map(|k| &motion[k][of.clone()]);
        let at_row = &mut torque_nm[of];
        chain.inverse_dynamics(q, v, a, at_row);
        for ((torque, rotor), a) in at_row.iter_mut().zip(&rotors_kg_m2).zip(a) {
            *torque += rotor * a;
        }
    }
    drop(written);
    Ok(torque)
}
