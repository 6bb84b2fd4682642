//! Folders of rosbag2: one or more MCAP or SQLite files, compressed or not.

use super::unpacked::unpack_file;
use super::{Log, Source, sqlite};
use crate::frame::Frame;
use crate::mapping::Mapping;
use crate::ros::Bag;
use crate::{ReadProblem, mcap_file};
use std::path::{Path, PathBuf};

/// What the files of a bag end with.
const PARTS: [&str; 2] = [".mcap", ".db3"];
const PACKED: [&str; 2] = [".zstd", ".zst"];

pub(crate) struct Folder;

impl Source for Folder {
    fn matches(&self, log: &Log<'_>) -> bool {
        log.is_folder && parts(log.path).is_ok_and(|parts| !parts.is_empty())
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        let mut bag = Bag::default();
        for part in parts(path)? {
            let read = read_part(&part, &mut bag);
            read.map_err(|problem| ReadProblem::Part {
                part,
                problem: Box::new(problem),
            })?;
        }
        bag.into_frame()
    }
}

fn read_part(part: &Path, bag: &mut Bag) -> Result<(), ReadProblem> {
    let name = part
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let unpacked = match PACKED.iter().any(|end| name.ends_with(end)) {
        true => Some(unpack_file(part)?),
        false => None,
    };
    let path = unpacked.as_ref().map_or(part, |unpacked| unpacked.path());
    match name.contains(PARTS[1]) {
        true => sqlite::read_bag(path, bag),
        false => mcap_file::read_bag(path, bag),
    }
}

/// The files of a bag, in the order in which they were written.
fn parts(folder: &Path) -> Result<Vec<PathBuf>, ReadProblem> {
    let mut parts = Vec::new();
    for entry in folder.read_dir()? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let name = PACKED
            .iter()
            .fold(&*name, |name, end| name.strip_suffix(end).unwrap_or(name));
        if let Some(stem) = PARTS.iter().find_map(|end| name.strip_suffix(end)) {
            parts.push((number_at_the_end(stem), path));
        }
    }
    parts.sort();
    Ok(parts.into_iter().map(|(_, path)| path).collect())
}

/// `NAME_10` comes after `NAME_9`.
fn number_at_the_end(stem: &str) -> Option<u64> {
    stem.rsplit_once('_')?.1.parse().ok()
}
