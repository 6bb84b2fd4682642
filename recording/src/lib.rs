//! Recordings: MCAP, Parquet and CSV files, read and written; bags of ROS and files of arrays, read.
//!
//! [`Writer`] appends one row per control cycle to an MCAP file that common viewers and libraries open: the
//! schemas travel in the file. [`read`] turns a recording, or a foreign log with a mapping file beside it, into the
//! columns of a [`Recording`], and [`read_guessing`] does without the mapping file where it can; [`read_cycles`] hands
//! over an MCAP file's rows with what the table leaves out (loop timing, live estimates, what an emulated plant really did).
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
mod check;
mod clock;
mod columns;
mod csv_table;
mod error;
mod frame;
pub mod grid;
mod guard;
mod guess;
mod held;
mod info;
mod mapping;
mod mcap_file;
mod message;
mod misread;
mod names;
mod parquet_table;
pub mod repeats;
mod ros;
mod signal;
mod sources;
mod statistics;
mod table;
mod ticks;
mod window;
mod wrapped;
mod writer;

pub use check::{CheckJoint, CheckRobot, Finding, FindingKind, STILL_RAD, Severity, check};
pub use csv_table::write_csv;
pub use error::{MappingProblem, Place, ReadError, ReadProblem, WriteError};
pub use frame::from_columns;
pub use guess::{Guess, GuessJoint, GuessedColumn, Sure, guess};
pub use info::{JointInfo, RecordingInfo, SignalInfo, Timing, describe};
pub use mapping::mapping_beside;
pub use mcap_file::{McapContents, read_cycles, write_mcap};
pub use message::{CycleRow, JointCycle, JointTruth, LoopCycle};
pub use parquet_table::write_parquet;
pub use signal::Signal;
pub use statistics::{noise_std, step};
pub use table::{JointColumns, MissingSignal, Recording};
pub use window::Window;
pub use writer::{Header, Writer};

use mapping::MappingFile;
use std::borrow::Cow;
use std::path::Path;

/// The most joints a file may hold, so that a damaged one cannot ask for a table of any width.
pub const JOINTS_MAX: usize = 256;
/// The most values of a Parquet file that are read: a few bytes of it may stand for any number of equal ones.
pub const VALUES_MAX: usize = 1 << 29;

/// The recording as it was measured: with positions that go on where an encoder begins anew, without misread values, and with straight lines
/// where values were repeated until the next one came.
#[must_use]
pub fn as_measured(recording: &Recording) -> Cow<'_, Recording> {
    let steps: [fn(&Recording) -> Cow<'_, Recording>; 3] = [
        wrapped::without_wraps,
        misread::without_misread,
        held::without_held,
    ];
    let mut whole = Cow::Borrowed(recording);
    for step in steps {
        if let Cow::Owned(changed) = step(&whole) {
            whole = Cow::Owned(changed);
        }
    }
    whole
}

/// Reads a recording or a log, with the mapping file beside it if there is one: `NAME.mapping.toml` for `NAME.csv`, or
/// `NAME.toml` unless that is a robot file. What it is is told by its first bytes, then by its name: MCAP (ours, or of
/// ROS), ROS 1 bag, Parquet, SQLite or folder of rosbag2, NumPy `.npz`, PyTorch `.pt`, Python's pickles, MATLAB `.mat`, HDF5, a LeRobot dataset's folder, any
/// of them compressed with Zstandard, or CSV (`.csv`, `.tsv`, `.txt`, `.dat`). Columns have the names of [`Signal`]s, or the mapping file names them;
/// messages of ROS say themselves what they hold.
///
/// # Errors
/// What keeps the file from being read, with the place in it and what to change.
pub fn read(path: &Path) -> Result<Recording, ReadError> {
    read_with(path, None)
}

/// Reads a log with a mapping file that may lie anywhere.
///
/// # Errors
/// As [`read`]; also if there is no such mapping file, or the log is a recording of ours, which needs none.
pub fn read_mapped(path: &Path, mapping_path: &Path) -> Result<Recording, ReadError> {
    read_with(path, Some(mapping_path))
}

/// Reads a log of a robot with these joints. Where neither a mapping file nor the log itself says what its columns hold, that is
/// guessed as [`guess`] does it and handed over; the guess is in the metadata too, as `columns_guessed`.
///
/// # Errors
/// As [`read`]; also [`ReadProblem::Doubtful`] where the guess needs somebody to look at it.
pub fn read_guessing(
    path: &Path,
    joints: &[GuessJoint],
) -> Result<(Recording, Option<Guess>), ReadError> {
    let mapping = MappingFile {
        log: path,
        given: None,
    };
    if mapping.file().is_some() {
        return Ok((read(path)?, None));
    }
    let read = sources::source(path).and_then(|source| source.read_guessing(path, joints));
    read.map(frame::with_guess_told)
        .map_err(|problem| ReadError {
            path: path.to_owned(),
            problem,
        })
}

fn read_with(path: &Path, given: Option<&Path>) -> Result<Recording, ReadError> {
    let mapping = MappingFile { log: path, given };
    sources::source(path)
        .and_then(|source| source.read(path, &mapping))
        .map_err(|problem| ReadError {
            path: path.to_owned(),
            problem,
        })
}
