//! Tables written as CSV.

use crate::columns::{SEGMENT, TIME};
use crate::{Recording, WriteError};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes a table as CSV: `time_s`, `segment` where there is one, and `JOINT.SIGNAL`; a missing value is empty.
/// Numbers are written so that reading them gives the same bits.
///
/// # Errors
/// If the table's columns differ in length or the file cannot be written.
pub fn write_csv(recording: &Recording, path: &Path) -> Result<(), WriteError> {
    recording.check_lengths()?;
    write_rows(recording, path).map_err(|cause| WriteError::Io {
        path: path.to_owned(),
        cause,
    })
}

fn write_rows(recording: &Recording, path: &Path) -> std::io::Result<()> {
    let mut writer = csv::Writer::from_writer(BufWriter::new(File::create(path)?));
    let mut columns = Vec::new();
    writer.write_field(TIME)?;
    if recording.segment.is_some() {
        writer.write_field(SEGMENT)?;
    }
    for joint in &recording.joints {
        for (signal, values) in &joint.signals {
            writer.write_field(format!("{}.{signal}", joint.name))?;
            columns.push(values);
        }
    }
    writer.write_record(None::<&[u8]>)?;
    let mut cell = Vec::new();
    for row in 0..recording.rows() {
        write_number(&mut writer, &mut cell, recording.time_s[row])?;
        if let Some(segment) = &recording.segment {
            writer.write_field(segment[row].to_string())?;
        }
        for values in &columns {
            write_number(&mut writer, &mut cell, values[row])?;
        }
        writer.write_record(None::<&[u8]>)?;
    }
    writer.flush()
}

fn write_number<W: Write>(
    writer: &mut csv::Writer<W>,
    cell: &mut Vec<u8>,
    value: f64,
) -> std::io::Result<()> {
    cell.clear();
    if !value.is_nan() {
        // Not `{}`, which spells 1e-300 out with 300 zeros.
        write!(cell, "{value:?}")?;
    }
    Ok(writer.write_field(&*cell)?)
}
