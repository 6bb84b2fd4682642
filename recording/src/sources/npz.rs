//! NumPy's `.npz`: a ZIP file of arrays, a vector for each column or a table with a column for each joint.
//!
//! Format: NumPy Enhancement Proposal 1.

use super::arrays::{Shape, frame_of, values_max};
use super::{Log, Source};
use crate::ReadProblem;
use crate::frame::{Array, Frame, Values};
use crate::guard::without_panic;
use crate::mapping::Mapping;
use npyz::{NpyFile, Order};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use zip::ZipArchive;

const MAGIC: &[u8] = b"PK\x03\x04";
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
    let mut values_left = values_max(path)?;
    let file = BufReader::new(File::open(path)?);
    let mut archive = ZipArchive::new(file).map_err(|error| ReadProblem::Npz(error.to_string()))?;
    let mut arrays = Vec::new();
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
        if let Some(array) = read_array(&name, member, values_left)? {
            values_left -= array.values();
            arrays.push(array);
        }
    }
    frame_of(arrays)
}

/// An array of numbers with one or two axes; others say nothing about joints.
fn read_array(
    name: &str,
    file: impl Read,
    values_left: usize,
) -> Result<Option<Array>, ReadProblem> {
    let wrong = |error: std::io::Error| ReadProblem::Npz(format!("array `{name}`: {error}"));
    let file = with_short_head(file).map_err(wrong)?;
    let npy = NpyFile::new(file).map_err(wrong)?;
    let header = npy.header();
    let by_columns = header.order() == Order::Fortran;
    let Some(shape) = Shape::of(header.shape(), by_columns, values_left)? else {
        return Ok(None);
    };
    let Some(values) = numbers(npy).map_err(wrong)? else {
        return Ok(None);
    };
    if values.len() != shape.values() {
        let what = format!("array `{name}` ends before its last row");
        return Err(ReadProblem::Npz(what));
    }
    Ok(Some(shape.table(name.to_owned(), &values)))
}

/// The same file, if the text that describes its array is as short as one is: the parser reserves what its length says, and
/// packed zeros may go on for gigabytes.
fn with_short_head(mut file: impl Read) -> std::io::Result<impl Read> {
    // Magic bytes, version, and the length in two bytes or, from version 2 on, in four.
    const LENGTH_AT: usize = 8;
    const HEAD_BYTES_MAX: u32 = 1 << 16;
    let mut start = Vec::new();
    (&mut file)
        .take(LENGTH_AT as u64 + 4)
        .read_to_end(&mut start)?;
    if let (Some(2..), Some(length)) = (
        start.get(6),
        start[LENGTH_AT.min(start.len())..].first_chunk(),
    ) && u32::from_le_bytes(*length) > HEAD_BYTES_MAX
    {
        let text = "its description is longer than 65536 bytes";
        return Err(std::io::Error::other(text));
    }
    Ok(std::io::Cursor::new(start).chain(file))
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
