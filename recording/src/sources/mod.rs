//! The formats of logs, one file each.
//!
//! A new format is a new file with a [`Source`], and a line in [`SOURCES`].

mod arrays;
mod csv;
mod csv_text;
mod hdf5;
mod lerobot;
mod lists;
mod mat;
mod mcap;
mod npz;
mod parquet;
mod pickle;
mod pickled;
mod ros1;
mod rosbag2;
mod sqlite;
mod unpacked;

use crate::frame::Frame;
use crate::mapping::{Mapping, MappingFile, mapping_beside};
use crate::{Guess, GuessJoint, ReadProblem, Recording};
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

    /// The table of a log without a mapping file, with a guess of what its columns hold where nothing tells it.
    ///
    /// # Errors
    /// What keeps it from being read, or what is doubtful.
    fn read_guessing(
        &self,
        path: &Path,
        joints: &[GuessJoint],
    ) -> Result<(Recording, Option<Guess>), ReadProblem> {
        let frame = self.frame(path, &Mapping::default())?;
        frame.into_guessed_table(&mapping_beside(path), joints)
    }
}

/// In the order in which they are asked: what a file begins with goes before what it is called.
const SOURCES: [&dyn Source; 13] = [
    &mcap::Mcap,
    &ros1::Ros1,
    &parquet::Parquet,
    &sqlite::Sqlite,
    &npz::Npz,
    &pickled::Torch,
    &pickled::Pickled,
    &mat::Mat,
    &hdf5::Hdf5,
    &unpacked::Zstd,
    &rosbag2::Folder,
    &lerobot::Folder,
    &csv::Csv,
];

/// What Git has in the place of a large file that was not fetched.
const LFS_POINTER: &[u8] = b"version https://git-lfs";

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
        // As long as the longest head by which a format is known, of MATLAB.
        const START: u64 = 128;
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
    // It has the name of what it stands for.
    if log.start.starts_with(LFS_POINTER) {
        return Err(ReadProblem::LfsPointer);
    }
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
    let text = log.start.trim_ascii_start();
    match log.extension.as_str() {
        _ if log.start.is_empty() => "; it is empty",
        _ if starts(b"#ROSBAG") => {
            "; it is a ROS bag of before version 2.0, which `rosbag migrate` converts"
        }
        _ if starts(b"\x93NUMPY") => {
            "; it is one NumPy array without a time, so put it into an .npz with `numpy.savez`"
        }
        _ if starts(b"\x1f\x8b") => "; it is packed with gzip, so unpack it with `gunzip`",
        _ if starts(b"BZh") => "; it is packed with bzip2, so unpack it with `bunzip2`",
        _ if starts(b"\xfd7zXZ") => "; it is packed with xz, so unpack it with `unxz`",
        _ if starts(b"PK") && matches!(log.extension.as_str(), "xlsx" | "xlsm" | "ods") => {
            "; it is a spreadsheet, so save it as CSV"
        }
        _ if starts(b"PK") => {
            "; it is a ZIP file, so unpack it; one of NumPy's arrays must be named .npz"
        }
        _ if starts(b"\xd0\xcf\x11\xe0") => "; it is an old spreadsheet, so save it as CSV",
        _ if starts(b"ARROW1") || starts(b"FEA1") => {
            "; it is a Feather file, which pandas' `to_parquet` converts"
        }
        _ if starts(b"TDSm") => {
            "; it is a TDMS file of LabVIEW, so write it as CSV, with Python's npTDMS: \
             `TdmsFile.read(OLD).as_dataframe().to_csv(NEW)`, or as .mat"
        }
        _ if starts(b"ULog") => "; it is a PX4 log, which `ulog2csv` converts",
        "pkl" | "pickle" => {
            "; it is a Python pickle of protocol 0 or 1, so save it again with protocol 4"
        }
        "mat" => "; if MATLAB reads it, it is of version 4, so save it again with '-v7'",
        "yaml" | "yml" => {
            "; it is a YAML file; of a rosbag2 give the folder, or its .mcap or .db3 file"
        }
        "toml" => "; it is a TOML file, as robots and mappings are",
        "urdf" | "xacro" | "xml" | "sdf" => "; it is a model of a robot, which --robot takes",
        _ if matches!(text.first(), Some(b'{' | b'[')) => {
            "; it is JSON, so write a line for each row and name it .csv"
        }
        _ if is_text(&log.start) => "; it is text, so name it .csv if it is a table",
        _ => "",
    }
}

fn is_text(bytes: &[u8]) -> bool {
    let printed = |byte: &u8| matches!(byte, b'\t' | b'\n' | b'\r' | b' '..=b'~' | 0x80..);
    bytes.iter().all(printed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_read_is_told_by_its_beginning() {
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes, expected) in [
            ("log.gz", &b"\x1f\x8b\x08"[..], "gunzip"),
            ("log.xlsx", b"PK\x03\x04", "spreadsheet"),
            ("log.tdms", b"TDSm\x0e\0\0\0", "npTDMS"),
            ("log.zip", b"PK\x03\x04", "ZIP"),
            ("log.json", b" {\"q\": 1}", "JSON"),
            ("log.pkl", b"(dp0\n", "protocol 4"),
            ("log", b"t q\n0 1\n", "name it .csv"),
            (
                "log.bag",
                b"version https://git-lfs.github.com/spec/v1\n",
                "git lfs pull",
            ),
            (
                "log.csv",
                b"version https://git-lfs.github.com/spec/v1\n",
                "git lfs pull",
            ),
            (
                "metadata.yaml",
                b"rosbag2_bagfile_information:\n",
                "give the folder",
            ),
            ("noise", b"\x00\x01\x02", "(.csv, .tsv, .txt, .dat)"),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let refusal = source(&path).err().unwrap().to_string();
            assert!(refusal.contains(expected), "{name}: {refusal}");
        }
    }
}
