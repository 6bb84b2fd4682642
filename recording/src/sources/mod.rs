//! The formats of logs, one file each.
//!
//! A new format is a new file with a [`Source`], and a line in [`SOURCES`].

mod csv;
mod csv_text;
mod lerobot;
mod mcap;
mod npz;
mod parquet;
mod rosbag2;
mod sqlite;
mod unpacked;

use crate::frame::Frame;
use crate::mapping::{Mapping, MappingFile};
use crate::{ReadProblem, Recording};
use std::fs::File;
use std::io::Read;
use std::path::Path;

pub(crate) use parquet::KEY_PREFIX as PARQUET_KEY_PREFIX;

/// A format that logs are in.
pub(crate) trait Source: Sync {
    /// Whether a log is in this format.
    fn matches(&self, log: &Log<'_>) -> bool;

    /// All that a log holds. The mapping may name what the format leaves without a name.
    ///
    /// # Errors
    /// What keeps it from being read.
    fn frame(&self, path: &Path, mapping: &Mapping) -> Result<Frame, ReadProblem>;

    /// The table of a log.
    ///
    /// # Errors
    /// What keeps it from being read, or from being understood with that mapping.
    fn read(&self, path: &Path, mapping: &MappingFile<'_>) -> Result<Recording, ReadProblem> {
        let (mapping, mapping_path) = mapping.load()?;
        self.frame(path, &mapping)?
            .into_table(&mapping, &mapping_path)
    }
}

/// In the order in which they are asked: what a file begins with goes before what it is called.
const SOURCES: [&dyn Source; 8] = [
    &mcap::Mcap,
    &parquet::Parquet,
    &sqlite::Sqlite,
    &npz::Npz,
    &unpacked::Zstd,
    &rosbag2::Folder,
    &lerobot::Folder,
    &csv::Csv,
];

/// What tells a log's format.
pub(crate) struct Log<'a> {
    pub(crate) path: &'a Path,
    pub(crate) is_folder: bool,
    /// Its first bytes; none of a folder.
    pub(crate) start: Vec<u8>,
    /// In small letters.
    pub(crate) extension: String,
}

impl<'a> Log<'a> {
    /// Looks at a file or a folder.
    fn open(path: &'a Path) -> std::io::Result<Self> {
        const START: u64 = 16;
        let is_folder = path.is_dir();
        let mut start = Vec::new();
        if !is_folder {
            File::open(path)?.take(START).read_to_end(&mut start)?;
        }
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        Ok(Self {
            path,
            is_folder,
            start,
            extension: extension.to_lowercase(),
        })
    }
}

/// The format of that log.
///
/// # Errors
/// Says what the file seems to be and what would be read.
pub(crate) fn source(path: &Path) -> Result<&'static dyn Source, ReadProblem> {
    let log = Log::open(path)?;
    let source = SOURCES.into_iter().find(|source| source.matches(&log));
    source.ok_or_else(|| match log.extension.as_str() {
        _ if log.is_folder => ReadProblem::UnknownFolder,
        "mcap" => ReadProblem::NotMcap,
        "parquet" => ReadProblem::NotParquet,
        _ => ReadProblem::UnknownFormat { seems: seems(&log) },
    })
}

/// What a file that is not read looks like, in words that follow `is neither …`.
fn seems(log: &Log<'_>) -> &'static str {
    let starts = |magic: &[u8]| log.start.starts_with(magic);
    match log.extension.as_str() {
        _ if starts(b"#ROSBAG V1") => {
            "; it is a ROS bag of before version 2.0, which `rosbag migrate` converts"
        }
        _ if starts(b"#ROSBAG") => {
            "; it is a ROS 1 bag, which `rosbags-convert` turns into a rosbag2"
        }
        _ if starts(b"\x89HDF\r\n") => {
            "; it is an HDF5 file, whose arrays `numpy.savez` writes as .npz"
        }
        _ if starts(b"MATLAB") => {
            "; it is a MATLAB file, whose arrays `numpy.savez` writes as .npz"
        }
        _ if starts(b"\x93NUMPY") => {
            "; it is one NumPy array without a time, so put it into an .npz with `numpy.savez`"
        }
        "toml" => "; it is a TOML file, as robots and mappings are",
        _ => "",
    }
}
