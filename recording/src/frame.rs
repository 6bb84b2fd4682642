//! Columns in memory, under the names that their file has for them.

use crate::builder::TableBuilder;
use crate::clock::{Clock, Instant, UnitsPerSecond, spread};
use crate::columns::{Cells, Known, Plan, joint_and_signal, whole};
use crate::error::Place;
use crate::guess::{Guess, GuessJoint, guess_frame};
use crate::mapping::Mapping;
use crate::names::array_signal;
use crate::ticks;
use crate::{JOINTS_MAX, ReadError, ReadProblem, Recording, Signal};
use std::collections::BTreeMap;
use std::path::Path;

/// Where the metadata tell what of a log was not read, and why.
pub(crate) const NOT_READ: &str = "not_read";

/// A column's values, one per row.
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) values: Values,
}

/// What a column holds.
pub(crate) enum Values {
    /// NaN where there is none.
    Numbers(Vec<f64>),
    Integers(Vec<Option<i64>>),
    /// Since 1970, in that unit.
    Instants(Vec<Option<i64>>, UnitsPerSecond),
}

impl Values {
    /// Adds the rows that follow, which are of the same kind.
    pub(crate) fn append(&mut self, rest: Self) {
        match (self, rest) {
            (Self::Numbers(values), Self::Numbers(rest)) => values.extend(rest),
            (Self::Integers(values), Self::Integers(rest))
            | (Self::Instants(values, _), Self::Instants(rest, _)) => values.extend(rest),
            _ => {}
        }
    }

    /// The values of these rows.
    pub(crate) fn picked(&self, rows: &[usize]) -> Self {
        match self {
            Self::Numbers(values) => Self::Numbers(rows.iter().map(|row| values[*row]).collect()),
            Self::Integers(values) => Self::Integers(rows.iter().map(|row| values[*row]).collect()),
            Self::Instants(values, unit) => {
                Self::Instants(rows.iter().map(|row| values[*row]).collect(), *unit)
            }
        }
    }

    /// As floating-point numbers, NaN where there is none.
    pub(crate) fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Numbers(values) => values.clone(),
            Self::Integers(values) | Self::Instants(values, _) => values
                .iter()
                .map(|value| value.map_or(f64::NAN, |value| value as f64))
                .collect(),
        }
    }

    /// How many rows.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Integers(values) | Self::Instants(values, _) => values.len(),
        }
    }
}

/// A column of times in seconds, as a table would have them; `None` if one is missing.
pub(crate) fn clock_of(values: &Values, unit: Option<UnitsPerSecond>) -> Option<Clock> {
    let assumed = unit.unwrap_or(UnitsPerSecond::SECONDS);
    let instants: Option<Vec<Instant>> = match values {
        Values::Numbers(values) => values
            .iter()
            .map(|value| Instant::from_number(*value, assumed))
            .collect(),
        Values::Integers(values) => values
            .iter()
            .map(|value| value.map(|value| Instant::from_integer(value, assumed)))
            .collect(),
        Values::Instants(values, own) => values
            .iter()
            .map(|value| value.map(|value| Instant::from_integer(value, *own)))
            .collect(),
    };
    let is_told = unit.is_some() || matches!(values, Values::Instants(..));
    let mut clock = Clock::new(instants?, is_told);
    if spread(&mut clock.time_s, None).is_none() {
        // rows that were written twice are half a step apart then, which a comparison over many rows does not see
        ticks::even_out(&mut clock.time_s, |_| true);
    }
    Some(clock)
}

/// The recording of a table in memory: its columns by name, a value for each row, NaN where there is none. Which column is which
/// signal is told by its name, `time_s` and `JOINT.SIGNAL`, or else guessed as [`guess`](crate::guess()) does it; then the guess is in
/// the metadata too, as `columns_guessed`. `name` is what errors call the table.
///
/// # Errors
/// As [`read_guessing`](crate::read_guessing).
pub fn from_columns(
    name: &Path,
    columns: Vec<(String, Vec<f64>)>,
    joints: &[GuessJoint],
) -> Result<(Recording, Option<Guess>), ReadError> {
    let columns = columns.into_iter().map(|(name, values)| Column {
        name,
        values: Values::Numbers(values),
    });
    let frame = Frame {
        columns: columns.collect(),
        ..Frame::default()
    };
    let table = frame
        .check_lengths()
        .and_then(|()| frame.into_guessed_table(name, joints));
    table.map(with_guess_told).map_err(|problem| ReadError {
        path: name.to_owned(),
        problem,
    })
}

/// Writes down what was guessed.
pub(crate) fn with_guess_told(
    (mut recording, guess): (Recording, Option<Guess>),
) -> (Recording, Option<Guess>) {
    if let Some(guess) = &guess {
        let lines = guess.lines().join("; ");
        let key = "columns_guessed".to_owned();
        recording.metadata.insert(key, lines);
    }
    (recording, guess)
}

/// A table with a column for each joint, whose names it does not have.
pub(crate) struct Array {
    pub(crate) name: String,
    /// Of one length.
    pub(crate) columns: Vec<Values>,
}

impl Array {
    /// How many in each column.
    pub(crate) fn rows(&self) -> usize {
        self.columns.first().map_or(0, Values::len)
    }

    /// How many in all columns.
    pub(crate) fn values(&self) -> usize {
        self.columns.iter().map(Values::len).sum()
    }
}

/// Where an [`Array`] is among the columns of a [`Frame`].
pub(crate) struct Joints {
    array: String,
    signal: Signal,
    columns: std::ops::Range<usize>,
}

/// A log that was read whole, and what its format tells about it.
#[derive(Default)]
pub(crate) struct Frame {
    /// All of one length.
    pub(crate) columns: Vec<Column>,
    /// Columns that the format says the signal of.
    pub(crate) known: Vec<Known>,
    /// The joints of its arrays, where the format tells them.
    pub(crate) joint_names: Vec<String>,
    /// Those whose name tells the signal.
    pub(crate) arrays: Vec<Joints>,
    /// Arrays that were left out as they have another length, and theirs.
    pub(crate) other_lengths: Vec<(String, usize)>,
    /// About the run, and how the file was understood.
    pub(crate) notes: BTreeMap<String, String>,
    pub(crate) truncated: bool,
}

impl Frame {
    /// Adds an array: the column `NAME` if it is one, else `NAME[0]` and so on.
    pub(crate) fn add_array(&mut self, array: Array) {
        let first = self.columns.len();
        let width = array.columns.len();
        for (index, values) in array.columns.into_iter().enumerate() {
            let name = match width {
                1 => array.name.clone(),
                _ => format!("{}[{index}]", array.name),
            };
            self.columns.push(Column { name, values });
        }
        self.arrays
            .extend(array_signal(&array.name).map(|signal| Joints {
                array: array.name,
                signal,
                columns: first..first + width,
            }));
    }

    /// Adds the rows of another file with the same columns.
    pub(crate) fn append(&mut self, mut rest: Self) -> Result<(), ReadProblem> {
        if self.columns.is_empty() {
            *self = rest;
            return Ok(());
        }
        for column in &mut self.columns {
            let of_the_name = |more: &&mut Column| more.name == column.name;
            let Some(more) = rest.columns.iter_mut().find(of_the_name) else {
                let column = column.name.clone();
                return Err(ReadProblem::MissingInPart { column });
            };
            let more = std::mem::replace(&mut more.values, Values::Numbers(Vec::new()));
            column.values.append(more);
        }
        self.check_lengths()
    }

    /// That all columns have as many rows.
    pub(crate) fn check_lengths(&self) -> Result<(), ReadProblem> {
        let Some(first) = self.columns.first() else {
            return Ok(());
        };
        let other = self
            .columns
            .iter()
            .find(|column| column.values.len() != first.values.len());
        match other {
            Some(column) => Err(ReadProblem::ColumnLengths {
                column: column.name.clone(),
                rows: column.values.len(),
                other: first.name.clone(),
                other_rows: first.values.len(),
            }),
            None => Ok(()),
        }
    }

    /// The joint and the signal of an array's column, where the format tells the joints' names.
    pub(crate) fn named_by_format(&self, column: usize) -> Option<(&str, Signal)> {
        let array = self
            .arrays
            .iter()
            .find(|array| array.columns.contains(&column))?;
        let name = self.joint_names.get(column - array.columns.start)?;
        Some((name, array.signal))
    }

    /// How many columns the array of a column has, if it is in one whose name tells the signal.
    pub(crate) fn width_of(&self, column: usize) -> Option<usize> {
        let mut arrays = self.arrays.iter();
        let array = arrays.find(|array| array.columns.contains(&column))?;
        Some(array.columns.len())
    }

    /// Whether its format or its columns' names say what it holds, in which unit and on which side of the gear.
    fn tells_itself(&self) -> bool {
        let is_signal = |column: &Column| joint_and_signal(&column.name).is_some();
        !self.known.is_empty() || self.columns.iter().any(is_signal)
    }

    /// The table of these columns, with a guess of what they hold where nothing tells it.
    pub(crate) fn into_guessed_table(
        self,
        mapping_path: &Path,
        joints: &[GuessJoint],
    ) -> Result<(Recording, Option<Guess>), ReadProblem> {
        if self.tells_itself() {
            let table = self.into_table(&Mapping::default(), mapping_path)?;
            return Ok((table, None));
        }
        let guess = guess_frame(&self, joints);
        if guess.columns.is_empty() {
            let table = self.into_table(&Mapping::default(), mapping_path)?;
            return Ok((table, None));
        }
        let mapping = guess.mapping(mapping_path)?;
        let table = self.into_table(&mapping, mapping_path)?;
        Ok((table, Some(guess)))
    }

    /// Gives the columns of arrays to the joints, where these have names.
    fn name_joints(&mut self, mapping: &Mapping, mapping_path: &Path) -> Result<(), ReadProblem> {
        let told = &mapping.joint_names;
        let names = if told.is_empty() {
            &self.joint_names
        } else {
            told
        };
        let needed = self.known.is_empty() && mapping.joints.is_empty();
        for Joints {
            array,
            signal,
            columns,
        } in &self.arrays
        {
            if columns.len() == names.len() {
                let known = names
                    .iter()
                    .zip(columns.clone())
                    .map(|(joint, column)| Known {
                        column,
                        joint: joint.clone(),
                        signal: *signal,
                    });
                self.known.extend(known);
            } else if needed {
                return Err(ReadProblem::UnnamedJoints {
                    array: array.clone(),
                    columns: columns.len(),
                    names: names.len(),
                    mapping: mapping_path.to_owned(),
                });
            }
        }
        Ok(())
    }

    /// How many rows its columns have.
    pub(crate) fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }

    /// What was sought is likely in what was not read, or is an array that was left out.
    fn with_what_was_not_read(&self, problem: ReadProblem) -> ReadProblem {
        if let ReadProblem::NoColumn { key, column, .. } = &problem {
            let is_of = |name: &str| {
                let index = column.strip_prefix(name);
                index.is_some_and(|index| index.is_empty() || index.starts_with('['))
            };
            let mut others = self.other_lengths.iter();
            if let Some((_, length)) = others.find(|(name, _)| is_of(name)) {
                return ReadProblem::OtherLength {
                    key: key.clone(),
                    column: column.clone(),
                    length: *length,
                    rows: self.rows(),
                };
            }
        }
        match self.notes.get(NOT_READ) {
            Some(not_read) => ReadProblem::NotAllRead {
                problem: Box::new(problem),
                not_read: not_read.clone(),
            },
            None => problem,
        }
    }

    /// The table of these columns. What the mapping says goes before what the format does.
    pub(crate) fn into_table(
        mut self,
        mapping: &Mapping,
        mapping_path: &Path,
    ) -> Result<Recording, ReadProblem> {
        self.name_joints(mapping, mapping_path)?;
        let names = self.columns.iter().map(|column| column.name.clone());
        let plan = Plan::new(names.collect(), &self.known, mapping, mapping_path);
        let plan = plan.map_err(|problem| self.with_what_was_not_read(problem))?;
        if plan.joints() > JOINTS_MAX {
            return Err(ReadProblem::TooManyJoints {
                joints: plan.joints(),
            });
        }
        let columns: Vec<Option<Column>> = self.columns.into_iter().map(Some).collect();
        let mut table = TableBuilder::default();
        plan.prepare(&mut table);
        let lengths = columns.iter().flatten().map(|column| column.values.len());
        for row in 0..lengths.min().unwrap_or(0) {
            let cells = Row {
                columns: &columns,
                row,
                place: Place::Row(row as u64 + 1),
            };
            plan.add_row(&mut table, &cells)?;
        }
        drop(columns);
        let mut recording = table.finish(mapping.sample_rate_hz, || mapping_path.to_owned())?;
        recording.metadata.extend(self.notes);
        recording.truncated = self.truncated;
        Ok(recording)
    }
}

/// One row of columns that are all in memory.
pub(crate) struct Row<'a> {
    /// Those that are read.
    pub(crate) columns: &'a [Option<Column>],
    pub(crate) row: usize,
    pub(crate) place: Place,
}

impl Cells for Row<'_> {
    fn place(&self) -> Place {
        self.place
    }

    fn number(&self, field: usize) -> Result<f64, ReadProblem> {
        Ok(
            match self.columns[field].as_ref().map(|column| &column.values) {
                Some(Values::Numbers(numbers)) => numbers[self.row],
                Some(Values::Integers(integers)) => {
                    integers[self.row].map_or(f64::NAN, |value| value as f64)
                }
                Some(Values::Instants(ticks, unit)) => ticks[self.row].map_or(f64::NAN, |ticks| {
                    Instant::from_integer(ticks, *unit).seconds()
                }),
                None => f64::NAN,
            },
        )
    }

    fn instant(&self, field: usize, unit: UnitsPerSecond) -> Result<Option<Instant>, ReadProblem> {
        Ok(
            match self.columns[field].as_ref().map(|column| &column.values) {
                // A column that says its unit itself needs no other.
                Some(Values::Instants(ticks, own)) => {
                    ticks[self.row].map(|ticks| Instant::from_integer(ticks, *own))
                }
                Some(Values::Integers(integers)) => {
                    integers[self.row].map(|value| Instant::from_integer(value, unit))
                }
                Some(Values::Numbers(numbers)) => Instant::from_number(numbers[self.row], unit),
                None => None,
            },
        )
    }

    fn integer(&self, field: usize) -> Result<Option<i64>, ReadProblem> {
        let Some(column) = &self.columns[field] else {
            return Ok(None);
        };
        match &column.values {
            Values::Integers(integers) | Values::Instants(integers, _) => Ok(integers[self.row]),
            Values::Numbers(numbers) if numbers[self.row].is_nan() => Ok(None),
            Values::Numbers(numbers) => {
                let value = numbers[self.row];
                let problem = || ReadProblem::NotAnInteger {
                    place: self.place,
                    column: column.name.clone(),
                    cell: value.to_string(),
                };
                whole(value).ok_or_else(problem).map(Some)
            }
        }
    }
}
