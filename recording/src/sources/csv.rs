//! CSV logs, with the columns' names or a mapping file saying what they hold.

use super::csv_text::{Uncommented, is_mostly_numbers};
use super::{Log, Source, lists};
use crate::builder::TableBuilder;
use crate::clock::{Instant, UnitsPerSecond};
use crate::columns::{Cells, Known, Plan, whole};
use crate::error::Place;
use crate::frame::{Column, Frame, Values};
use crate::guess::guess_frame;
use crate::mapping::{Mapping, MappingFile, mapping_beside};
use crate::names::with_unit;
use crate::{Guess, GuessJoint, ReadProblem, Recording, Signal};
use csv::ByteRecord;
use std::borrow::Cow;
use std::cell::Cell;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

pub(crate) struct Csv;

impl Source for Csv {
    fn matches(&self, log: &Log<'_>) -> bool {
        matches!(log.extension.as_str(), "csv" | "tsv" | "txt" | "dat")
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        match lists::frame(path)? {
            Some(frame) => Ok(frame),
            None => read_frame(path),
        }
    }

    fn read(&self, path: &Path, mapping: &MappingFile<'_>) -> Result<Recording, ReadProblem> {
        let (mapping, mapping_path) = mapping.load()?;
        match lists::frame(path)? {
            Some(frame) => frame.into_table(&mapping, &mapping_path),
            None => read_table(path, &mapping, &mapping_path),
        }
    }

    fn read_guessing(
        &self,
        path: &Path,
        joints: &[GuessJoint],
    ) -> Result<(Recording, Option<Guess>), ReadProblem> {
        let mapping_path = mapping_beside(path);
        if let Some(frame) = lists::frame(path)? {
            return frame.into_guessed_table(&mapping_path, joints);
        }
        match read_table(path, &Mapping::default(), &mapping_path) {
            Err(ReadProblem::NoSignals { mapping, columns }) => {
                let guess = guess_frame(&read_frame(path)?, joints);
                if guess.columns.is_empty() {
                    return Err(ReadProblem::NoSignals { mapping, columns });
                }
                // Read again as a table: times to the last digit, and errors with their line.
                let mapping = guess.mapping(&mapping_path)?;
                Ok((read_table(path, &mapping, &mapping_path)?, Some(guess)))
            }
            table => Ok((table?, None)),
        }
    }
}

/// All columns; text is not there.
fn read_frame(path: &Path) -> Result<Frame, ReadProblem> {
    let (mut lines, header) = open(path)?;
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); header.len()];
    let in_message = in_message(&header);
    let mut names = vec![BTreeSet::new(); in_message.len()];
    let mut record = ByteRecord::new();
    let decimal_mark = Cell::new(None);
    while lines.read_byte_record(&mut record).map_err(line_problem)? {
        let line = Line {
            header: &header,
            record: &record,
            decimal_mark: &decimal_mark,
        };
        for (field, column) in columns.iter_mut().enumerate() {
            let time = || Some(Instant::from_date(&line.cell(field))?.seconds());
            column.push(line.number(field).ok().or_else(time).unwrap_or(f64::NAN));
        }
        for (listed, names) in in_message.iter().zip(&mut names) {
            names.insert(line.cell(listed.name).into_owned());
        }
    }
    // in messages of several publishers, by turns, the names change
    let known = in_message.iter().zip(names).map(|(listed, names)| Known {
        column: listed.column,
        joint: Vec::from_iter(names).join(" or "),
        signal: listed.signal,
    });
    let known = known.collect();
    let columns = header
        .into_iter()
        .zip(columns)
        .map(|(name, values)| Column {
            name,
            values: Values::Numbers(values),
        });
    Ok(Frame {
        columns: columns.collect(),
        known,
        ..Frame::default()
    })
}

/// A column whose joint is named in another.
struct Listed {
    column: usize,
    name: usize,
    signal: Signal,
}

/// The columns of a message with lists, as `rostopic echo -p` writes states of joints: `field.position3` is of the joint that
/// `field.name3` names.
fn in_message(header: &[String]) -> Vec<Listed> {
    let listed = |column: usize| {
        let (message, list) = header[column].rsplit_once('.')?;
        let word = list.trim_end_matches(|c: char| c.is_ascii_digit());
        let signal = match word {
            "position" => Signal::LinkPositionRad,
            "velocity" => Signal::LinkVelocityRadS,
            "effort" => Signal::JointTorqueNm,
            _ => return None,
        };
        let name = format!("{message}.name{}", &list[word.len()..]);
        let name = header.iter().position(|column| *column == name)?;
        Some(Listed {
            column,
            name,
            signal,
        })
    };
    (0..header.len()).filter_map(listed).collect()
}

pub(super) type Lines = csv::Reader<Uncommented<BufReader<File>>>;

/// The table of a CSV log.
fn read_table(
    path: &Path,
    mapping: &Mapping,
    mapping_path: &Path,
) -> Result<Recording, ReadProblem> {
    let (mut lines, header) = open(path)?;
    let plan = Plan::new(header.clone(), &[], mapping, mapping_path);
    let plan = match plan {
        // whoever mapped the columns has seen that already
        Err(problem @ (ReadProblem::NoSignals { .. } | ReadProblem::NoTimeColumn { .. }))
            if mapping.joints.is_empty() =>
        {
            return Err(without_names(problem, &header, &mut lines, mapping_path));
        }
        plan => plan?,
    };
    let mut table = TableBuilder::default();
    plan.prepare(&mut table);
    let mut record = ByteRecord::new();
    let decimal_mark = Cell::new(None);
    while lines.read_byte_record(&mut record).map_err(line_problem)? {
        plan.add_row(
            &mut table,
            &Line {
                header: &header,
                record: &record,
                decimal_mark: &decimal_mark,
            },
        )?;
    }
    table.finish(mapping.sample_rate_hz, || mapping_path.to_owned())
}

/// The lines after the one that names the columns, and the names.
pub(super) fn open(path: &Path) -> Result<(Lines, Vec<String>), ReadProblem> {
    let (text, start) = Uncommented::open(BufReader::new(File::open(path)?))?;
    let mut reader = csv::ReaderBuilder::new();
    reader.delimiter(start.delimiter).trim(csv::Trim::All);
    let (lines, mut header) = match (start.commented_header, start.unnamed) {
        (Some(names), _) => {
            let header = read_header(&mut reader.from_reader(&names[..]))?;
            (reader.has_headers(false).from_reader(text), header)
        }
        (None, Some(columns)) => {
            let header = (1..=columns).map(|column| column.to_string()).collect();
            (reader.has_headers(false).from_reader(text), header)
        }
        (None, None) => {
            let mut lines = reader.from_reader(text);
            let header = read_header(&mut lines)?;
            (lines, header)
        }
    };
    if let Some(units) = start.units {
        let told = header.into_iter().zip(&units);
        header = told.map(|(name, unit)| with_unit(name, unit)).collect();
    }
    Ok((lines, header))
}

/// So many times more columns than rows no log has whose rows are moments: a diagnosis takes hundreds of rows, and robots have some
/// hundreds of signals.
const COLUMNS_PER_ROW: usize = 10;

/// What is wrong with a file of which no column is known, where its first line holds numbers in the place of names.
fn without_names(
    problem: ReadProblem,
    header: &[String],
    lines: &mut Lines,
    mapping_path: &Path,
) -> ReadProblem {
    let (columns, is_counted) = (header.len(), are_counted(header));
    if !is_mostly_numbers(header) {
        return problem;
    }
    // signals need not be of one length; a first line that is not counted is one of them
    let others = lines.byte_records().take(columns / COLUMNS_PER_ROW + 1);
    let rows = others.count() + usize::from(!is_counted);
    if rows * COLUMNS_PER_ROW < columns {
        ReadProblem::RowsAreSignals { columns, rows }
    } else if is_counted {
        ReadProblem::HeaderOfNumbers {
            columns,
            mapping: mapping_path.to_owned(),
        }
    } else {
        problem
    }
}

/// Whether the columns have no names but their numbers.
fn are_counted(header: &[String]) -> bool {
    let mut numbers = header.iter().zip(1..);
    numbers.all(|(name, number)| *name == number.to_string())
}

fn read_header<R: Read>(lines: &mut csv::Reader<R>) -> Result<Vec<String>, ReadProblem> {
    let header = lines.byte_headers().map_err(line_problem)?;
    // A header in another encoding than UTF-8 is legible but for its special letters.
    let names: Vec<String> = header
        .iter()
        .map(|name| String::from_utf8_lossy(name).into_owned())
        .collect();
    if names.is_empty() {
        return Err(ReadProblem::NoHeader);
    }
    Ok(names)
}

pub(super) fn line_problem(error: csv::Error) -> ReadProblem {
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
    /// Of the file: the first number with one shows which.
    decimal_mark: &'a Cell<Option<char>>,
}

impl Cells for Line<'_> {
    fn place(&self) -> Place {
        Place::Line(self.record.position().map_or(0, csv::Position::line))
    }

    fn number(&self, field: usize) -> Result<f64, ReadProblem> {
        let cell = self.cell(field);
        if cell.is_empty() {
            return Ok(f64::NAN);
        }
        let value = self.with_point(&cell).and_then(|cell| cell.parse().ok());
        value.ok_or_else(|| self.not_a_number(field))
    }

    fn instant(&self, field: usize, unit: UnitsPerSecond) -> Result<Option<Instant>, ReadProblem> {
        let cell = self.cell(field);
        if cell.is_empty() {
            return Ok(None);
        }
        if let Some(date) = Instant::from_date(&cell) {
            return Ok(Some(date));
        }
        if cell.contains(['/', ':']) {
            let (place, (column, cell)) = (self.place(), self.describe(field));
            return Err(ReadProblem::NotADate {
                place,
                column,
                cell,
            });
        }
        match self.with_point(&cell) {
            Some(number) => Ok(Instant::from_decimal(&number, unit)),
            None => Err(self.not_a_number(field)),
        }
    }

    fn integer(&self, field: usize) -> Result<Option<i64>, ReadProblem> {
        let cell = self.cell(field);
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

impl<'a> Line<'a> {
    fn cell(&self, field: usize) -> Cow<'a, str> {
        String::from_utf8_lossy(&self.record[field])
    }

    /// A number with a decimal point, if it is one with the mark that the file's numbers have.
    fn with_point<'c>(&self, cell: &'c str) -> Option<Cow<'c, str>> {
        let Some(mark) = cell.chars().find(|c| matches!(c, '.' | ',')) else {
            return Some(Cow::Borrowed(cell));
        };
        if *self.decimal_mark.get().get_or_insert(mark) != mark {
            return None;
        }
        let number = match mark {
            ',' => Cow::Owned(cell.replacen(',', ".", 1)),
            _ => Cow::Borrowed(cell),
        };
        if number.parse::<f64>().is_ok() {
            self.decimal_mark.set(Some(mark));
        }
        Some(number)
    }

    fn not_a_number(&self, field: usize) -> ReadProblem {
        let (column, cell) = self.describe(field);
        ReadProblem::NotANumber {
            place: self.place(),
            column,
            cell,
        }
    }

    fn describe(&self, field: usize) -> (String, String) {
        const SHOWN: usize = 40;
        let cell = self.cell(field);
        (
            self.header[field].clone(),
            cell.chars().take(SHOWN).collect(),
        )
    }
}
