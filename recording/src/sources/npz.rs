//! NumPy's `.npz`: a ZIP file of arrays, a vector for each column or a table with a column for each joint.
//!
//! Format: NumPy Enhancement Proposal 1.

use super::{Log, Source};
use crate::frame::{Array, Frame, Values};
use crate::guard::without_panic;
use crate::mapping::Mapping;
use crate::{JOINTS_MAX, ReadProblem, VALUES_MAX};
use npyz::{NpyFile, Order};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use zip::ZipArchive;

const MAGIC: &[u8] = b"PK\x03\x04";
/// Arrays of measurements shrink to a tenth; of a file that grows by more only so much is read.
const GROWTH_MAX: u64 = 100;
const BYTES_MAX: u64 = 1 << 28;
const END: &str = ".npy";

pub(crate) struct Npz;

impl Source for Npz {
    fn matches(&self, log: &Log<'_>) -> bool {
        log.start.starts_with(MAGIC) && log.extension == "npz"
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        // Two libraries, of which neither was made for damaged files.
        without_panic(|| read_arrays(path)).unwrap_or_else(|what| Err(ReadProblem::Npz(what)))
    }
}

fn read_arrays(path: &Path) -> Result<Frame, ReadProblem> {
    let file = File::open(path)?;
    let bytes_max = BYTES_MAX.max(file.metadata()?.len().saturating_mul(GROWTH_MAX));
    let values_max = VALUES_MAX.min(usize::try_from(bytes_max / 8).unwrap_or(VALUES_MAX));
    let file = BufReader::new(file);
    let mut archive = ZipArchive::new(file).map_err(|error| ReadProblem::Npz(error.to_string()))?;
    let mut frame = Frame::default();
    let mut values = 0_usize;
    for index in 0..archive.len() {
        let member = archive
            .by_index(index)
            .map_err(|error| ReadProblem::Npz(error.to_string()))?;
        let name = member
            .name()
            .map_err(|error| ReadProblem::Npz(error.to_string()))?;
        let Some(name) = name.strip_suffix(END).map(str::to_owned) else {
            continue;
        };
        let left = values_max.saturating_sub(values);
        if let Some(array) = read_array(&name, member, left)? {
            values += array.values();
            frame.add_array(array);
        }
    }
    frame.check_lengths()?;
    Ok(frame)
}

/// An array of numbers with one or two axes; others say nothing about joints.
fn read_array(
    name: &str,
    file: impl Read,
    values_max: usize,
) -> Result<Option<Array>, ReadProblem> {
    let wrong = |error: std::io::Error| ReadProblem::Npz(format!("array `{name}`: {error}"));
    let npy = NpyFile::new(file).map_err(wrong)?;
    let header = npy.header();
    let (rows, width) = match *header.shape() {
        [rows] => (rows, 1),
        [rows, width] => (rows, width),
        _ => return Ok(None),
    };
    let by_columns = header.order() == Order::Fortran;
    let fits = rows
        .checked_mul(width)
        .is_some_and(|values| values <= values_max as u64);
    if !fits {
        let (rows, columns) = (
            i64::try_from(rows).unwrap_or(i64::MAX),
            usize::try_from(width).unwrap_or(0),
        );
        return Err(ReadProblem::TooLarge { rows, columns });
    }
    if width > JOINTS_MAX as u64 || rows * width == 0 {
        return Ok(None);
    }
    let (rows, width) = (rows as usize, width as usize);
    let Some(values) = numbers(npy).map_err(wrong)? else {
        return Ok(None);
    };
    if values.len() != rows * width {
        let what = format!("array `{name}` ends before its last row");
        return Err(ReadProblem::Npz(what));
    }
    let order = |column: usize| -> Vec<usize> {
        match by_columns {
            true => (column * rows..(column + 1) * rows).collect(),
            false => (column..rows * width).step_by(width).collect(),
        }
    };
    let columns = (0..width).map(|column| values.picked(&order(column)));
    Ok(Some(Array {
        name: name.to_owned(),
        columns: columns.collect(),
    }))
}

/// An array's numbers one after the other; `None` of other kinds.
fn numbers<R: Read>(npy: NpyFile<R>) -> std::io::Result<Option<Values>> {
    /// Reads it if it is of that type, else goes on.
    macro_rules! try_type {
        ($npy:ident, $number:ty, $convert:expr, $values:expr) => {
            let $npy = match $npy.try_data::<$number>() {
                Ok(numbers) => {
                    let numbers: Vec<_> = numbers
                        .map(|number| number.map($convert))
                        .collect::<std::io::Result<_>>()?;
                    return Ok(Some($values(numbers)));
                }
                Err(npy) => npy,
            };
        };
    }
    try_type!(npy, f64, |number| number, Values::Numbers);
    try_type!(npy, f32, f64::from, Values::Numbers);
    try_type!(npy, i64, Some, Values::Integers);
    try_type!(npy, i32, |number| Some(i64::from(number)), Values::Integers);
    try_type!(npy, i16, |number| Some(i64::from(number)), Values::Integers);
    try_type!(npy, u32, |number| Some(i64::from(number)), Values::Integers);
    try_type!(
        npy,
        u64,
        |number| i64::try_from(number).ok(),
        Values::Integers
    );
    drop(npy);
    Ok(None)
}
