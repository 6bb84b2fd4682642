//! A diagnosis, and what becomes of it.

use std::collections::BTreeMap;

use flexspline::library::{self, nothing_to_say, recorded_joints_of};
use gap_diagnosis::{Engine, Options};
use gap_report::Report;
use pyo3::prelude::*;

use crate::errors::{input, raised};
use crate::recording::Recording;
use crate::robot::Robot;
use crate::work::detached;

/// A report, and what its pictures need.
#[pyclass(frozen, module = "flexspline._native")]
pub struct Diagnosis {
    robot: robot::Robot,
    inner: gap_diagnosis::Diagnosis,
}

/// Diagnoses a robot from recordings.
#[pyfunction]
#[pyo3(signature = (robot, recordings, engine, materiality, threads, progress))]
pub fn diagnose(
    py: Python<'_>,
    robot: &Robot,
    recordings: Vec<PyRef<'_, Recording>>,
    engine: Option<&str>,
    materiality: f64,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagnosis> {
    let options = Options {
        engine: engine.map(engine_of).transpose()?,
        materiality,
    };
    let recordings: Vec<(String, recording::Recording)> = recordings
        .iter()
        .map(|recording| (recording.name.clone(), (*recording.table).clone()))
        .collect();
    let robot = recorded_joints_of(&robot.built, &recordings).map_err(raised)?;
    let diagnosed = detached(py, threads, progress.as_ref(), |waiting| {
        gap_diagnosis::diagnose(&robot, &recordings, &options, &|progress| {
            waiting.tell(progress.done, progress.of);
        })
    })?;
    let inner = diagnosed.map_err(input)?;
    match nothing_to_say(&inner.report) {
        Some(why) => Err(input(why)),
        None => Ok(Diagnosis { robot, inner }),
    }
}

fn engine_of(name: &str) -> PyResult<Engine> {
    match name {
        "motion" => Ok(Engine::Motion),
        "closed-loop" => Ok(Engine::ClosedLoop),
        _ => Err(input(format!(
            "engine `{name}`: there are `motion` and `closed-loop`; leave it out to have it chosen by the robot file"
        ))),
    }
}

#[pymethods]
impl Diagnosis {
    /// The report as `report.json` has it.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string_pretty(&self.inner.report).map_err(input)
    }

    /// In a sentence.
    fn headline(&self) -> String {
        library::sentence(&self.inner.report)
    }

    /// As the command prints it.
    fn text(&self) -> String {
        library::summary(&self.inner.report, "", None)
    }

    /// As `report.html` has it.
    fn html(&self) -> String {
        library::page(&self.robot, &self.inner, None).to_html()
    }

    /// What one looks at first.
    fn short_html(&self) -> String {
        library::short_page(&self.robot, &self.inner.report).to_html()
    }

    /// The torques of a joint over time; none of a joint that could not be diagnosed.
    fn traces(&self, joint: &str) -> Option<BTreeMap<&'static str, Vec<f64>>> {
        let all = &self.inner.traces;
        let traces = all.iter().find(|traces| traces.joint == joint)?;
        Some(BTreeMap::from([
            ("time_s", traces.time_s.clone()),
            ("measured_nm", traces.measured_nm.clone()),
            ("nominal_nm", traces.nominal_nm.clone()),
            ("augmented_nm", traces.augmented_nm.clone()),
        ]))
    }
}

/// The robot with a report's effects; what was changed as joint, effect and words; and what no table holds.
pub type Mended = (
    Robot,
    Vec<(Option<String>, &'static str, String)>,
    Vec<String>,
);

/// Adds the effects of a report, as JSON, to a robot.
#[pyfunction]
pub fn mended(robot: &Robot, report: &str, remaining: bool) -> PyResult<Mended> {
    let report = Report::from_json(report).map_err(input)?;
    let mended =
        library::mended(&robot.as_text(), report, "report", remaining, None).map_err(raised)?;
    let changes = mended.changes.into_iter();
    let changes = changes.map(|change| (change.joint, change.effect, change.done));
    let robot = Robot::of(mended.text, robot.source.clone(), robot.given.clone())?;
    Ok((robot, changes.collect(), mended.left_out))
}

/// An effect as people read it.
#[pyfunction]
pub fn words(effect: &str) -> String {
    library::words(effect)
}
