//! CSV logs, with the columns' names or a mapping file saying what they hold.

use crate::builder::TableBuilder;
use crate::error::{Place, nearest};
use crate::mapping::{Mapping, Source};
use crate::{ReadProblem, Recording, Signal};
use csv::ByteRecord;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// The column of the measurement's time.
pub(crate) const TIME: &str = "time_s";
/// The column of the trajectory's number.
pub(crate) const SEGMENT: &str = "segment";
/// What may stand between two fields; the first line shows which does.
const DELIMITERS: [u8; 3] = [b',', b';', b'\t'];

/// The table of a CSV log.
pub(crate) fn read_table(path: &Path) -> Result<Recording, ReadProblem> {
    let mapping_path = path.with_extension("toml");
    let mapping = Mapping::beside(&mapping_path)?;
    let mut lines = open(path)?;
    let header = read_header(&mut lines)?;
    let plan = Plan::new(&header, &mapping, &mapping_path)?;
    let mut table = TableBuilder::default();
    for (name, _) in &plan.joints {
        table.joint(name);
    }
    let mut record = ByteRecord::new();
    while lines.read_byte_record(&mut record).map_err(line_problem)? {
        plan.add_row(&mut table, &header, &record)?;
    }
    table.finish(mapping.sample_rate_hz, || mapping_path)
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

/// Which field of a line becomes what.
struct Plan {
    time: Time,
    segment: Option<usize>,
    joints: Vec<(String, Vec<(Signal, Scaled)>)>,
}

enum Time {
    Column(Scaled),
    Rate(f64),
}

/// `value = scale·x + offset`
#[derive(Clone, Copy)]
struct Scaled {
    field: usize,
    scale: f64,
    offset: f64,
}

impl Plan {
    fn new(header: &[String], mapping: &Mapping, mapping_path: &Path) -> Result<Self, ReadProblem> {
        let header = Columns(header);
        let time = match (
            header.mapped_or_named(mapping.time.as_ref(), TIME)?,
            mapping.sample_rate_hz,
        ) {
            (Some(column), _) => Time::Column(column),
            (None, Some(rate_hz)) => Time::Rate(rate_hz),
            (None, None) => {
                return Err(ReadProblem::NoTimeColumn {
                    mapping: mapping_path.to_owned(),
                });
            }
        };
        let segment = header
            .mapped_or_named(mapping.segment.as_ref(), SEGMENT)?
            .map(|column| column.field);
        let mut joints = Vec::new();
        for (name, signals) in &mapping.joints {
            for (signal, source) in signals {
                add_column(&mut joints, name, *signal, header.scaled(source)?);
            }
        }
        for column in header.0 {
            if let Some((name, signal)) = joint_and_signal(column) {
                add_column(
                    &mut joints,
                    name,
                    signal,
                    Scaled::as_it_is(header.index(column)?),
                );
            }
        }
        if joints.is_empty() {
            let (mapping, columns) = (mapping_path.to_owned(), header.0.to_vec());
            return Err(ReadProblem::NoSignals { mapping, columns });
        }
        Ok(Self {
            time,
            segment,
            joints,
        })
    }

    fn add_row(
        &self,
        table: &mut TableBuilder,
        header: &[String],
        record: &ByteRecord,
    ) -> Result<(), ReadProblem> {
        let line = record.position().map_or(0, csv::Position::line);
        let cells = Cells {
            header,
            record,
            line,
        };
        let place = Place::Line(line);
        let segment = self
            .segment
            .map(|field| cells.integer(field))
            .transpose()?
            .flatten();
        let time_s = match self.time {
            Time::Rate(rate_hz) => table.rows() as f64 / rate_hz,
            Time::Column(column) => cells.time(column)?,
        };
        table.begin_row(place, time_s, segment)?;
        for (joint, (_, signals)) in self.joints.iter().enumerate() {
            for (signal, column) in signals {
                table.set(place, joint, *signal, cells.number(*column)?)?;
            }
        }
        Ok(())
    }
}

/// Adds a column unless the joint has that signal, from the mapping, already.
fn add_column(
    joints: &mut Vec<(String, Vec<(Signal, Scaled)>)>,
    name: &str,
    signal: Signal,
    column: Scaled,
) {
    let joint = joints
        .iter()
        .position(|(known, _)| known == name)
        .unwrap_or_else(|| {
            joints.push((name.to_owned(), Vec::new()));
            joints.len() - 1
        });
    let signals = &mut joints[joint].1;
    if signals.iter().all(|(known, _)| *known != signal) {
        signals.push((signal, column));
    }
}

fn joint_and_signal(column: &str) -> Option<(&str, Signal)> {
    let (joint, signal) = column.rsplit_once('.')?;
    Some((joint, Signal::from_name(signal)?)).filter(|_| !joint.is_empty())
}

/// The header line's names.
#[derive(Clone, Copy)]
struct Columns<'a>(&'a [String]);

impl Columns<'_> {
    fn mapped_or_named(
        self,
        mapped: Option<&Source>,
        name: &str,
    ) -> Result<Option<Scaled>, ReadProblem> {
        match mapped {
            Some(source) => self.scaled(source).map(Some),
            None if self.0.iter().any(|column| column == name) => {
                Ok(Some(Scaled::as_it_is(self.index(name)?)))
            }
            None => Ok(None),
        }
    }

    fn scaled(self, source: &Source) -> Result<Scaled, ReadProblem> {
        if !self.0.contains(&source.column) {
            let nearest = nearest(&source.column, self.0.iter().map(String::as_str));
            return Err(ReadProblem::NoColumn {
                key: source.key.clone(),
                column: source.column.clone(),
                nearest,
            });
        }
        Ok(Scaled {
            field: self.index(&source.column)?,
            scale: source.scale,
            offset: source.offset,
        })
    }

    /// Of a name that is there.
    fn index(self, name: &str) -> Result<usize, ReadProblem> {
        let mut fields = (0..self.0.len()).filter(|field| self.0[*field] == name);
        match (fields.next(), fields.next()) {
            (Some(field), None) => Ok(field),
            _ => Err(ReadProblem::AmbiguousColumn {
                column: name.to_owned(),
            }),
        }
    }
}

impl Scaled {
    fn as_it_is(field: usize) -> Self {
        Self {
            field,
            scale: 1.0,
            offset: 0.0,
        }
    }
}

/// One line's fields.
struct Cells<'a> {
    header: &'a [String],
    record: &'a ByteRecord,
    line: u64,
}

impl Cells<'_> {
    /// NaN where the field is empty.
    fn number(&self, column: Scaled) -> Result<f64, ReadProblem> {
        let cell = &self.record[column.field];
        if cell.is_empty() {
            return Ok(f64::NAN);
        }
        let value: Option<f64> = std::str::from_utf8(cell)
            .ok()
            .and_then(|cell| cell.parse().ok());
        let value = value.ok_or_else(|| {
            let (column, cell) = self.describe(column.field);
            ReadProblem::NotANumber {
                line: self.line,
                column,
                cell,
            }
        })?;
        Ok(column.scale * value + column.offset)
    }

    fn time(&self, column: Scaled) -> Result<f64, ReadProblem> {
        let time_s = self.number(column)?;
        let name = || self.header[column.field].clone();
        if time_s.is_nan() {
            return Err(ReadProblem::NoTime {
                line: self.line,
                column: name(),
            });
        }
        if time_s.is_infinite() {
            return Err(ReadProblem::NotFinite {
                place: Place::Line(self.line),
                column: name(),
                value: time_s,
            });
        }
        Ok(time_s)
    }

    /// `None` where the field is empty. Takes `3.0` too: some tools know floating-point columns only.
    fn integer(&self, field: usize) -> Result<Option<i64>, ReadProblem> {
        let cell = String::from_utf8_lossy(&self.record[field]);
        if cell.is_empty() {
            return Ok(None);
        }
        let as_float = || {
            cell.parse()
                .ok()
                .filter(|value: &f64| value.fract() == 0.0 && value.abs() < 1e15)
        };
        let integer = cell
            .parse()
            .ok()
            .or_else(|| as_float().map(|value| value as i64));
        let problem = || {
            let (column, cell) = self.describe(field);
            ReadProblem::NotAnInteger {
                line: self.line,
                column,
                cell,
            }
        };
        integer.ok_or_else(problem).map(Some)
    }

    fn describe(&self, field: usize) -> (String, String) {
        const SHOWN: usize = 40;
        let cell = String::from_utf8_lossy(&self.record[field]);
        (
            self.header[field].clone(),
            cell.chars().take(SHOWN).collect(),
        )
    }
}
