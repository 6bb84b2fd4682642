//! CSV logs, with the columns' names or a mapping file saying what they hold.

use crate::builder::TableBuilder;
use crate::columns::{Cells, Plan, whole};
use crate::error::Place;
use crate::mapping::Mapping;
use crate::{ReadProblem, Recording};
use csv::ByteRecord;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// What may stand between two fields; the first line shows which does.
const DELIMITERS: [u8; 3] = [b',', b';', b'\t'];

/// The table of a CSV log.
pub(crate) fn read_table(
    path: &Path,
    mapping: &Mapping,
    mapping_path: &Path,
) -> Result<Recording, ReadProblem> {
    let mut lines = open(path)?;
    let header = read_header(&mut lines)?;
    let plan = Plan::new(header.clone(), mapping, mapping_path)?;
    let mut table = TableBuilder::default();
    plan.name_joints(&mut table);
    let mut record = ByteRecord::new();
    while lines.read_byte_record(&mut record).map_err(line_problem)? {
        plan.add_row(
            &mut table,
            &Line {
                header: &header,
                record: &record,
            },
        )?;
    }
    table.finish(mapping.sample_rate_hz, || mapping_path.to_owned())
}

fn open(path: &Path) -> std::io::Result<csv::Reader<BufReader<File>>> {
    let mut file = BufReader::new(File::open(path)?);
    let start = file.fill_buf()?;
    let first_line = start
        .split(|byte| *byte == b'\n')
        .next()
        .unwrap_or_default();
    let count = |delimiter: &u8| first_line.iter().filter(|byte| *byte == delimiter).count();
    // `max_by_key` takes the last of equals, so a line without any delimiter counts as comma-separated.
    let delimiter = DELIMITERS
        .into_iter()
        .rev()
        .max_by_key(count)
        .unwrap_or(b',');
    Ok(csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .trim(csv::Trim::All)
        .from_reader(file))
}

fn read_header(lines: &mut csv::Reader<BufReader<File>>) -> Result<Vec<String>, ReadProblem> {
    let header = lines.byte_headers().map_err(line_problem)?;
    // A header in another encoding than UTF-8 is legible but for its special letters.
    let names: Vec<String> = header
        .iter()
        .map(|name| String::from_utf8_lossy(name).into_owned())
        .collect();
    if names.is_empty() {
        return Err(ReadProblem::NoHeader);
    }
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err(ReadProblem::HeaderOfNumbers);
    }
    Ok(names)
}

fn line_problem(error: csv::Error) -> ReadProblem {
    let text = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(error) => ReadProblem::Io(error),
        csv::ErrorKind::UnequalLengths {
            pos,
            expected_len,
            len,
        } => ReadProblem::RowLength {
            line: pos.map_or(0, |pos| pos.line()),
            fields: len,
            columns: expected_len,
        },
        _ => ReadProblem::Io(std::io::Error::other(text)),
    }
}

/// One line's fields.
struct Line<'a> {
    header: &'a [String],
    record: &'a ByteRecord,
}

impl Cells for Line<'_> {
    fn place(&self) -> Place {
        Place::Line(self.record.position().map_or(0, csv::Position::line))
    }

    fn number(&self, field: usize) -> Result<f64, ReadProblem> {
        let cell = &self.record[field];
        if cell.is_empty() {
            return Ok(f64::NAN);
        }
        let value: Option<f64> = std::str::from_utf8(cell)
            .ok()
            .and_then(|cell| cell.parse().ok());
        value.ok_or_else(|| {
            let (place, (column, cell)) = (self.place(), self.describe(field));
            ReadProblem::NotANumber {
                place,
                column,
                cell,
            }
        })
    }

    fn integer(&self, field: usize) -> Result<Option<i64>, ReadProblem> {
        let cell = String::from_utf8_lossy(&self.record[field]);
        if cell.is_empty() {
            return Ok(None);
        }
        let as_float = || cell.parse().ok().and_then(whole);
        let problem = || {
            let (place, (column, cell)) = (self.place(), self.describe(field));
            ReadProblem::NotAnInteger {
                place,
                column,
                cell,
            }
        };
        let integer = cell.parse().ok().or_else(as_float);
        integer.ok_or_else(problem).map(Some)
    }
}

impl Line<'_> {
    fn describe(&self, field: usize) -> (String, String) {
        const SHOWN: usize = 40;
        let cell = String::from_utf8_lossy(&self.record[field]);
        (
            self.header[field].clone(),
            cell.chars().take(SHOWN).collect(),
        )
    }
}
