//! What the columns of a foreign log hold, told by their names or by a mapping file.

use crate::builder::TableBuilder;
use crate::clock::{Instant, UnitsPerSecond, only_time_column};
use crate::error::{Place, nearest};
use crate::mapping::{Mapping, Source};
use crate::{ReadProblem, Signal};
use std::path::Path;

/// The column of the measurement's time.
pub(crate) const TIME: &str = "time_s";
/// The column of the trajectory's number.
pub(crate) const SEGMENT: &str = "segment";
/// The same in datasets that robots learn from.
const EPISODE: &str = "episode_index";

/// One row's fields.
pub(crate) trait Cells {
    /// Where in the file.
    fn place(&self) -> Place;
    /// NaN where the field is empty.
    fn number(&self, field: usize) -> Result<f64, ReadProblem>;
    /// A number of that unit, or a date; `None` where the field is empty or infinite.
    fn instant(&self, field: usize, unit: UnitsPerSecond) -> Result<Option<Instant>, ReadProblem>;
    /// `None` where the field is empty. Takes `3.0` too: some tools know floating-point columns only.
    fn integer(&self, field: usize) -> Result<Option<i64>, ReadProblem>;
}

/// The integer that a floating-point number is, if it is one.
pub(crate) fn whole(value: f64) -> Option<i64> {
    (value.fract() == 0.0 && value.abs() < 1e15).then_some(value as i64)
}

/// A column whose signal the file's format tells.
pub(crate) struct Known {
    pub(crate) column: usize,
    pub(crate) joint: String,
    pub(crate) signal: Signal,
}

/// Which field of a row becomes what.
pub(crate) struct Plan {
    columns: Vec<String>,
    time: Time,
    segment: Option<usize>,
    joints: Vec<(String, Vec<(Signal, Scaled)>)>,
}

enum Time {
    /// Scaled by anything else than a unit.
    Column(Scaled),
    /// A clock's; of an unknown unit if there is none.
    Clock(usize, Option<UnitsPerSecond>),
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
    /// For a file with these columns and the mapping at that path.
    pub(crate) fn new(
        columns: Vec<String>,
        known: &[Known],
        mapping: &Mapping,
        mapping_path: &Path,
    ) -> Result<Self, ReadProblem> {
        let header = Columns(&columns);
        let time = match (
            header.mapped_or_named(mapping.time.as_ref(), TIME)?,
            mapping.sample_rate_hz,
        ) {
            (Some(column), _) => Time::of(column),
            (None, Some(rate_hz)) => Time::Rate(rate_hz),
            (None, None) => header
                .named_as_time()
                .ok_or_else(|| ReadProblem::NoTimeColumn {
                    mapping: mapping_path.to_owned(),
                    columns: columns.clone(),
                })?,
        };
        let segment = header
            .mapped_or_named(mapping.segment.as_ref(), SEGMENT)?
            .map_or_else(
                || header.mapped_or_named(None, EPISODE),
                |column| Ok(Some(column)),
            )?
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
        // A column that the mapping has a use for is not used twice.
        let mapped = mapping.joints.iter().flat_map(|(_, signals)| signals);
        let used: Vec<&str> = mapped.map(|(_, source)| source.column.as_str()).collect();
        for known in known {
            if !used.contains(&columns[known.column].as_str()) {
                let column = Scaled::as_it_is(known.column);
                add_column(&mut joints, &known.joint, known.signal, column);
            }
        }
        if joints.is_empty() {
            let mapping = mapping_path.to_owned();
            return Err(ReadProblem::NoSignals { mapping, columns });
        }
        Ok(Self {
            columns,
            time,
            segment,
            joints,
        })
    }

    /// Adds the joints, in the order of the mapping file, then of the columns, and says what is known of the times.
    pub(crate) fn prepare(&self, table: &mut TableBuilder) {
        if let Time::Clock(_, None) = self.time {
            table.guess_unit_of_time();
        }
        for (name, _) in &self.joints {
            table.joint(name);
        }
    }

    /// How many joints.
    pub(crate) fn joints(&self) -> usize {
        self.joints.len()
    }

    /// The fields that are read at all.
    pub(crate) fn fields(&self) -> impl Iterator<Item = usize> {
        let time = match &self.time {
            Time::Column(Scaled { field, .. }) | Time::Clock(field, _) => Some(*field),
            Time::Rate(_) => None,
        };
        let signals = self.joints.iter().flat_map(|(_, signals)| signals);
        time.into_iter()
            .chain(self.segment)
            .chain(signals.map(|(_, column)| column.field))
    }

    /// Adds one row of a file with these columns.
    pub(crate) fn add_row(
        &self,
        table: &mut TableBuilder,
        cells: &impl Cells,
    ) -> Result<(), ReadProblem> {
        let place = cells.place();
        let segment = self
            .segment
            .map(|field| cells.integer(field))
            .transpose()?
            .flatten();
        let time = match &self.time {
            Time::Rate(rate_hz) => Instant::from_s(table.rows() as f64 / rate_hz),
            Time::Column(column) => Instant::from_s(self.time_s(column, cells)?),
            Time::Clock(field, unit) => {
                let unit = unit.unwrap_or(UnitsPerSecond::SECONDS);
                match cells.instant(*field, unit)? {
                    Some(time) => time,
                    // In the words for what else may be there.
                    None => Instant::from_s(self.time_s(&Scaled::as_it_is(*field), cells)?),
                }
            }
        };
        table.begin_row(place, time, segment)?;
        for (name, signals) in &self.joints {
            let joint = table.joint(name);
            for (signal, column) in signals {
                table.set(place, joint, *signal, column.value(cells)?)?;
            }
        }
        Ok(())
    }

    fn time_s(&self, column: &Scaled, cells: &impl Cells) -> Result<f64, ReadProblem> {
        let (place, value) = (cells.place(), column.value(cells)?);
        let column = || self.columns[column.field].clone();
        match value {
            time_s if time_s.is_finite() => Ok(time_s),
            nothing if nothing.is_nan() => Err(ReadProblem::NoTime {
                place,
                column: column(),
            }),
            value => Err(ReadProblem::NotFinite {
                place,
                column: column(),
                value,
            }),
        }
    }
}

impl Time {
    fn of(column: Scaled) -> Self {
        match UnitsPerSecond::of_scale(column.scale) {
            Some(unit) if column.offset == 0.0 => Self::Clock(column.field, Some(unit)),
            _ => Self::Column(column),
        }
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

pub(crate) fn joint_and_signal(column: &str) -> Option<(&str, Signal)> {
    let (joint, signal) = column.rsplit_once('.')?;
    Some((joint, Signal::from_name(signal)?)).filter(|_| !joint.is_empty())
}

/// The columns' names.
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

    /// The column whose name says that it holds the time.
    fn named_as_time(self) -> Option<Time> {
        let (field, unit) = only_time_column(self.0.iter().map(String::as_str))?;
        Some(Time::Clock(field, unit))
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

    fn value(&self, cells: &impl Cells) -> Result<f64, ReadProblem> {
        Ok(self.scale * cells.number(self.field)? + self.offset)
    }
}
