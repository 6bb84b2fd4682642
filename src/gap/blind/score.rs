//! `flexspline gap blind score`: opens the seal and scores what was predicted.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use blind::score::{Prediction, Scores, asked_joint, score};
use blind::{CaseKind, Label};
use gap_report::Report;
use serde::{Deserialize, Serialize};

use super::make::progress_bar;
use super::{page, table};
use crate::cli::BlindScoreArguments;
use crate::error::CliError;
use crate::output::{print, write_json, write_text};

/// A prediction's file in its case's folder.
pub const REPORT: &str = "report.json";
/// In its place where there is none.
pub const FAILURE: &str = "failure.json";

/// Why there is no prediction.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// One line.
    pub reason: String,
}

/// One set of predictions with its scores.
#[derive(Debug, Serialize)]
pub struct Scored {
    /// Name of the folder of predictions.
    pub name: String,
    /// Its scores.
    pub scores: Scores,
}

/// For programs.
#[derive(Debug, Serialize)]
struct Results<'a> {
    schema: u32,
    cases: &'a Path,
    predictions: &'a [Scored],
}

/// Scores the predictions, and those of baselines beside them.
///
/// # Errors
/// [`CliError::Input`] if the seal is broken or predictions cannot be read.
pub fn score_all(arguments: &BlindScoreArguments) -> Result<(), CliError> {
    let folders: Vec<&PathBuf> = std::iter::once(&arguments.predictions)
        .chain(&arguments.baseline)
        .collect();
    // read before the seal is opened
    let names = blind::cases(&arguments.cases).map_err(CliError::input)?;
    let predictions = folders
        .iter()
        .map(|folder| read_all(folder, &names))
        .collect::<Result<Vec<_>, _>>()?;
    let labels = blind::unseal(&arguments.cases).map_err(CliError::input)?;
    let oracle = if arguments.oracle {
        oracle(&arguments.cases, &labels)?
    } else {
        BTreeMap::new()
    };
    let scored: Vec<Scored> = folders
        .iter()
        .zip(&predictions)
        .map(|(folder, predictions)| Scored {
            name: name_of(folder),
            scores: score(&labels, predictions, &oracle),
        })
        .collect();
    tell(arguments, &labels, &scored)
}

/// Shrink of each case with one or two effects at one joint, the true names told.
fn oracle(cases: &Path, labels: &[Label]) -> Result<BTreeMap<String, f64>, CliError> {
    let asked: Vec<&Label> = labels
        .iter()
        .filter(|label| matches!(label.kind, CaseKind::OneEffect | CaseKind::TwoEffects))
        .collect();
    let bar = progress_bar(asked.len());
    let mut shrinks = BTreeMap::new();
    for label in asked {
        bar.inc(1);
        let Some(name) = asked_joint(label) else {
            continue;
        };
        let [robot_path, recording_path] =
            blind::CASE_FILES.map(|file| cases.join(&label.case).join(file));
        let robot = robot::load(&robot_path.display().to_string()).map_err(CliError::input)?;
        let recording = recording::read(&recording_path).map_err(CliError::input)?;
        let joint = robot.joints.iter().position(|joint| joint.name == name);
        let names: Vec<&str> = label
            .effects
            .iter()
            .filter(|effect| effect.joint.as_deref() == Some(name))
            .map(|effect| effect.effect.name())
            .collect();
        let recordings = [(blind::CASE_FILES[1].to_owned(), recording)];
        if let Some(joint) = joint
            && let Some(shrink) =
                gap_diagnosis::closed_loop::named::shrink(&robot, &recordings, joint, &names)
                    .map_err(CliError::input)?
        {
            shrinks.insert(label.case.clone(), shrink);
        }
    }
    bar.finish_and_clear();
    Ok(shrinks)
}

fn tell(
    arguments: &BlindScoreArguments,
    labels: &[Label],
    scored: &[Scored],
) -> Result<(), CliError> {
    if let Some(path) = &arguments.report {
        write_text(path, &page::page(labels, scored).to_html())?;
    }
    if let Some(path) = &arguments.json {
        let results = Results {
            schema: 1,
            cases: &arguments.cases,
            predictions: scored,
        };
        write_json(&results, path)?;
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    print(&table::text(scored))
}

fn name_of(folder: &Path) -> String {
    let name = folder.file_name().unwrap_or(folder.as_os_str());
    name.to_string_lossy().into_owned()
}

fn read_all(folder: &Path, names: &[String]) -> Result<BTreeMap<String, Prediction>, CliError> {
    let mut predictions = BTreeMap::new();
    for name in names {
        if let Some(prediction) = read(&folder.join(name))? {
            predictions.insert(name.clone(), prediction);
        }
    }
    if predictions.is_empty() {
        return Err(CliError::Input(format!(
            "{}: holds no prediction for any of the {} cases; run `gap blind run` with --out {0}",
            folder.display(),
            names.len()
        )));
    }
    Ok(predictions)
}

/// None if there is no prediction yet. A report that cannot be read is a failed prediction.
fn read(folder: &Path) -> Result<Option<Prediction>, CliError> {
    let path = folder.join(REPORT);
    if path.is_file() {
        let text = read_text(&path)?;
        let report = Report::from_json(&text);
        return Ok(Some(report.map_err(|error| error.to_string())));
    }
    let path = folder.join(FAILURE);
    if !path.is_file() {
        return Ok(None);
    }
    let failure: Failure = serde_json::from_str(&read_text(&path)?)
        .map_err(|error| CliError::Input(format!("{}: {error}", path.display())))?;
    Ok(Some(Err(failure.reason)))
}

fn read_text(path: &Path) -> Result<String, CliError> {
    fs::read_to_string(path)
        .map_err(|error| CliError::Input(format!("{}: {error}", path.display())))
}
