//! Recordings: MCAP files written and read, foreign CSV logs read.
//!
//! [`Writer`] appends one row per control cycle to an MCAP file that common viewers and libraries open: the
//! schemas travel in the file. [`read`] turns a recording, or a CSV log with a mapping file beside it, into
//! the columns of a [`Recording`]; [`read_cycles`] hands over an MCAP file's rows with what the table leaves
//! out (loop timing, live estimates, what an emulated plant really did).
//!
//! SI units. `motor_` names the side before the gear, `link_` or `joint_` the side after it; positive about the
//! joint's axis on both sides.
//!
//! ```
//! use recording::{CycleRow, Header, JointCycle, Signal, Writer, read};
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("run.mcap");
//! let header = Header {
//!     joint_names: vec!["elbow".to_owned()],
//!     sample_rate_hz: 1500.0,
//!     metadata: [("robot".to_owned(), "bench".to_owned())].into(),
//! };
//! let mut writer = Writer::create(&path, &header)?;
//! let elbow = JointCycle { motor_torque_nm: Some(0.2), ..Default::default() };
//! let row = CycleRow { cycle: 0, time_ns: 0, loop_cycle: None, joints: &[elbow], truth: None };
//! writer.write_cycle(&row)?;
//! writer.finish()?;
//! assert_eq!(read(&path)?.signal("elbow", Signal::MotorTorqueNm)?, [0.2]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may"))]

mod builder;
mod csv_log;
mod csv_table;
mod error;
mod mapping;
mod mcap_file;
mod message;
mod signal;
mod table;
mod writer;

pub use csv_table::write_csv;
pub use error::{MappingProblem, Place, ReadError, ReadProblem, WriteError};
pub use mcap_file::{McapContents, read_cycles, write_mcap};
pub use message::{CycleRow, JointCycle, JointTruth, LoopCycle};
pub use signal::Signal;
pub use table::{JointColumns, MissingSignal, Recording};
pub use writer::{Header, Writer};

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The most joints a file may hold, so that a damaged one cannot ask for a table of any width.
pub const JOINTS_MAX: usize = 256;

/// Reads a recording: an MCAP file, known by its first bytes, or a CSV log (`.csv`, `.tsv`, `.txt`), whose
/// columns are named as [`Signal`] names them or by a mapping file beside it (`NAME.toml` for `NAME.csv`).
///
/// # Errors
/// What keeps the file from being read, with the place in it and what to change.
pub fn read(path: &Path) -> Result<Recording, ReadError> {
    read_by_format(path).map_err(|problem| ReadError {
        path: path.to_owned(),
        problem,
    })
}

fn read_by_format(path: &Path) -> Result<Recording, ReadProblem> {
    if begins_as_mcap(path)? {
        return mcap_file::read_table(path);
    }
    let extension = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    match extension.as_str() {
        "csv" | "tsv" | "txt" => csv_log::read_table(path),
        "mcap" => Err(ReadProblem::NotMcap),
        _ => Err(ReadProblem::UnknownFormat),
    }
}

fn begins_as_mcap(path: &Path) -> Result<bool, ReadProblem> {
    let mut start = Vec::with_capacity(mcap::MAGIC.len());
    File::open(path)?
        .take(mcap::MAGIC.len() as u64)
        .read_to_end(&mut start)?;
    Ok(start == mcap::MAGIC)
}
