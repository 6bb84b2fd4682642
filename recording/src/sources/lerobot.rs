//! Datasets of LeRobot: a folder of Parquet files, versions 2 and 3, and `meta/info.json` with the names of the joints.

use super::parquet::read_frame;
use super::{Log, Source};
use crate::ReadProblem;
use crate::frame::Frame;
use crate::mapping::Mapping;
use serde_json::Value;
use std::path::{Path, PathBuf};

const INFO: &str = "meta/info.json";
const DATA: &str = "data";
/// `data/chunk-000/episode_000000.parquet` and nothing deeper.
const DEPTH_MAX: usize = 3;
/// Ends of names that say what of the joint is meant, which is always its position.
const POSITION: &str = ".pos";

pub(crate) struct Folder;

impl Source for Folder {
    fn matches(&self, log: &Log<'_>) -> bool {
        log.is_folder && log.path.join(INFO).is_file()
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        let mut files = Vec::new();
        find_parquet(&path.join(DATA), DEPTH_MAX, &mut files)?;
        files.sort();
        let mut whole = Frame::default();
        for part in files {
            let in_part = |problem| ReadProblem::Part {
                part: part.clone(),
                problem: Box::new(problem),
            };
            let frame = read_frame(&part).map_err(in_part)?;
            whole.append(frame).map_err(in_part)?;
        }
        whole.joint_names = joint_names(&path.join(INFO))?;
        Ok(whole)
    }
}

/// The joints' names of the dataset that an episode's file lies in, if it does.
pub(super) fn names_for_episode(file: &Path) -> Result<Vec<String>, ReadProblem> {
    let folder = file.ancestors().nth(DEPTH_MAX);
    match folder.map(|folder| folder.join(INFO)) {
        Some(info) if info.is_file() => joint_names(&info),
        _ => Ok(Vec::new()),
    }
}

fn find_parquet(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<(), ReadProblem> {
    for entry in folder.read_dir()? {
        let path = entry?.path();
        if path.is_dir() && depth > 1 {
            find_parquet(&path, depth - 1, found)?;
        } else if path
            .extension()
            .is_some_and(|extension| extension == "parquet")
        {
            found.push(path);
        }
    }
    Ok(())
}

/// Of the entries of `observation.state`.
fn joint_names(info: &Path) -> Result<Vec<String>, ReadProblem> {
    let wrong = |what: String| ReadProblem::Dataset {
        file: info.to_owned(),
        what,
    };
    let text =
        std::fs::read_to_string(info).map_err(|error| wrong(format!("cannot be read: {error}")))?;
    let info: Value =
        serde_json::from_str(&text).map_err(|error| wrong(format!("is not JSON: {error}")))?;
    let mut names = Vec::new();
    add_texts(&info["features"]["observation.state"]["names"], &mut names);
    let names = names.into_iter();
    Ok(names
        .map(|name| name.strip_suffix(POSITION).unwrap_or(name).to_owned())
        .collect())
}

/// Adds the texts of a list, of lists in it, and of lists by names.
fn add_texts<'a>(value: &'a Value, texts: &mut Vec<&'a str>) {
    match value {
        Value::String(text) => texts.push(text),
        Value::Array(values) => values.iter().for_each(|value| add_texts(value, texts)),
        Value::Object(named) => named.values().for_each(|value| add_texts(value, texts)),
        _ => {}
    }
}
