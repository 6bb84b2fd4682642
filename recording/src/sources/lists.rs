//! CSV logs whose cells are lists, as Python writes a column of arrays: `"[0.1, 0.2, 0.3]"` is one row of a table with a column for
//! each joint.

use super::arrays::{frame_of, values_max};
use super::csv::{Lines, line_problem, open};
use crate::frame::{Array, Frame, Values};
use crate::{JOINTS_MAX, ReadProblem};
use csv::ByteRecord;
use std::path::Path;

/// The log, if cells of its first row are lists; what is no number there is not there.
pub(super) fn frame(path: &Path) -> Result<Option<Frame>, ReadProblem> {
    let (mut lines, header) = open(path)?;
    let mut record = ByteRecord::new();
    if !next(&mut lines, &mut record)? {
        return Ok(None);
    }
    let is_list = |cell: &[u8]| cell.starts_with(b"[") && cell.ends_with(b"]");
    if !record.iter().any(is_list) {
        return Ok(None);
    }
    let mut tables: Vec<Vec<Vec<f64>>> = record
        .iter()
        .map(|cell| vec![Vec::new(); numbers(cell).len()])
        .collect();
    let width: usize = tables.iter().map(Vec::len).sum();
    let rows_max = values_max(path)? / width.max(1);
    let mut rows = 0;
    loop {
        if rows == rows_max {
            return Err(ReadProblem::TooLarge {
                rows: i64::try_from(rows).unwrap_or(i64::MAX),
                columns: width,
            });
        }
        rows += 1;
        for (cell, columns) in record.iter().zip(&mut tables) {
            let values = numbers(cell);
            // a list of another length is of something else
            let is_whole = values.len() == columns.len();
            for (index, column) in columns.iter_mut().enumerate() {
                column.push(if is_whole { values[index] } else { f64::NAN });
            }
        }
        if !next(&mut lines, &mut record)? {
            break;
        }
    }
    let arrays = header.into_iter().zip(tables);
    let arrays = arrays.filter(|(_, columns)| (1..=JOINTS_MAX).contains(&columns.len()));
    let arrays = arrays.map(|(name, columns)| Array {
        name,
        columns: columns.into_iter().map(Values::Numbers).collect(),
    });
    frame_of(arrays.collect()).map(Some)
}

fn next(lines: &mut Lines, record: &mut ByteRecord) -> Result<bool, ReadProblem> {
    lines.read_byte_record(record).map_err(line_problem)
}

/// The numbers of a list, parted by commas or, as NumPy prints it, by blanks; of a cell without brackets the only one.
fn numbers(cell: &[u8]) -> Vec<f64> {
    let text = String::from_utf8_lossy(cell);
    let inside = text.trim_matches(['[', ']']);
    let parts = inside.split([',', ' ', '\n', '\t']);
    let parts = parts.filter(|part| !part.is_empty());
    parts.map(|part| part.parse().unwrap_or(f64::NAN)).collect()
}
