//! MCAP recordings read back, whole or as far as a killed recorder came, and tables written as MCAP.

mod bag;
mod records;
mod rows;

pub(crate) use bag::{is_bag, read_bag};

use crate::builder::TableBuilder;
use crate::clock::{Instant, UnitsPerSecond};
use crate::error::Place;
use crate::writer::{METADATA, METADATA_JOINTS, told_rate_hz};
use crate::{
    CycleRow, Header, JointCycle, ReadError, ReadProblem, Recording, Signal, WriteError, Writer,
};
use mcap::records::{Record, op};
use records::{Next, Records, damaged};
use rows::Rows;
use std::collections::BTreeMap;
use std::path::Path;

/// What an MCAP recording says beside its rows.
#[derive(Clone, Debug)]
pub struct McapContents {
    /// The order of [`CycleRow::joints`] and [`CycleRow::truth`].
    pub joint_names: Vec<String>,
    /// The planned rate, if the recorder wrote it.
    pub sample_rate_hz: Option<f64>,
    /// What the recorder wrote about the run.
    pub metadata: BTreeMap<String, String>,
    /// The recorder was stopped before it finished the file: the last rows may be missing.
    pub truncated: bool,
}

/// Hands over an MCAP recording row by row, with all that was recorded. A joint that sent nothing in a cycle has
/// an empty [`JointCycle`] there. Needs the memory of one chunk.
///
/// # Errors
/// What keeps the file from being read, and where in it. The rows before the place were handed over.
pub fn read_cycles(
    path: &Path,
    mut each: impl FnMut(&CycleRow<'_>),
) -> Result<McapContents, ReadError> {
    let mut each = |row: &CycleRow<'_>, _: &[String]| {
        each(row);
        Ok(())
    };
    read_rows(path, &mut each).map_err(|problem| ReadError {
        path: path.to_owned(),
        problem,
    })
}

/// Writes a table as an MCAP recording. Times are kept to the nanosecond.
///
/// # Errors
/// If the table's columns differ in length, a time is negative, a joint's name cannot be a topic or the file
/// cannot be written.
pub fn write_mcap(recording: &Recording, path: &Path) -> Result<(), WriteError> {
    recording.check_lengths()?;
    let mut writer = Writer::create(path, &header(recording))?;
    let mut joints = vec![JointCycle::default(); recording.joints.len()];
    for row in 0..recording.rows() {
        let segment = recording.segment.as_ref().map(|segment| segment[row]);
        for (joint, columns) in joints.iter_mut().zip(&recording.joints) {
            joint.segment = segment;
            for (signal, values) in &columns.signals {
                joint.set(*signal, Some(values[row]).filter(|value| !value.is_nan()));
            }
        }
        let time_ns = time_ns(row, recording.time_s[row])?;
        writer.write_cycle(&CycleRow {
            cycle: row as u64,
            time_ns,
            loop_cycle: None,
            joints: &joints,
            truth: None,
        })?;
    }
    writer.finish()
}

/// What a recording of this table says before its first row.
pub(crate) fn header(recording: &Recording) -> Header {
    Header {
        joint_names: recording.joint_names().map(str::to_owned).collect(),
        sample_rate_hz: recording.sample_rate_hz,
        metadata: recording.metadata.clone(),
    }
}

fn time_ns(row: usize, time_s: f64) -> Result<u64, WriteError> {
    let time_ns = (time_s * 1e9).round();
    if (0.0..u64::MAX as f64).contains(&time_ns) {
        Ok(time_ns as u64)
    } else {
        Err(WriteError::TimeOutOfRange { row, time_s })
    }
}

/// The table of an MCAP recording.
pub(crate) fn read_table(path: &Path) -> Result<Recording, ReadProblem> {
    let mut table = TableBuilder::default();
    let contents = read_rows(path, &mut |row, joint_names| {
        add_row(&mut table, row, joint_names)
    })?;
    for name in &contents.joint_names {
        table.joint(name);
    }
    let mut recording = table.finish(contents.sample_rate_hz, || path.to_owned())?;
    // What the recorder wrote goes before what is found here.
    recording.metadata.extend(contents.metadata);
    recording.truncated = contents.truncated;
    Ok(recording)
}

fn add_row(
    table: &mut TableBuilder,
    row: &CycleRow<'_>,
    joint_names: &[String],
) -> Result<(), ReadProblem> {
    let place = Place::Cycle(row.cycle);
    let segment = row.joints.iter().find_map(|joint| joint.segment);
    let time_ns = i64::try_from(row.time_ns).unwrap_or(i64::MAX);
    table.begin_row(
        place,
        Instant::from_integer(time_ns, UnitsPerSecond::NANOSECONDS),
        segment,
    )?;
    for (name, joint) in joint_names.iter().zip(row.joints) {
        let column = table.joint(name);
        for signal in Signal::ALL {
            if let Some(value) = joint.get(signal) {
                table.set(place, column, signal, value)?;
            }
        }
    }
    Ok(())
}

type EachRow<'a> = dyn FnMut(&CycleRow<'_>, &[String]) -> Result<(), ReadProblem> + 'a;

fn read_rows(path: &Path, each: &mut EachRow<'_>) -> Result<McapContents, ReadProblem> {
    let mut records = Records::open(path)?;
    let mut rows = Rows::default();
    let mut metadata: Option<BTreeMap<String, String>> = None;
    let ended = loop {
        let (offset, record) = match records.next()? {
            Next::End { whole } => break whole,
            Next::Record { offset, record } => (offset, record),
        };
        match record {
            Record::Metadata(run) if run.name == METADATA => {
                rows.expect_joints(run.metadata.get(METADATA_JOINTS).map(String::as_str))?;
                metadata = Some(run.metadata);
            }
            record => rows.take(offset, record, each)?,
        }
    };
    rows.finish(each)?;
    if rows.joint_names().is_empty() && metadata.is_none() {
        let channels = rows.channels();
        return Err(match ended || !channels.is_empty() {
            true => ReadProblem::NoJoints { channels },
            false => ReadProblem::NothingRecorded,
        });
    }
    let metadata = metadata.unwrap_or_default();
    Ok(McapContents {
        joint_names: rows.joint_names().to_vec(),
        sample_rate_hz: told_rate_hz(&metadata),
        metadata,
        truncated: !ended,
    })
}
