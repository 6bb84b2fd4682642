//! A recording in memory: one row per control cycle, one column per signal of a joint.

use crate::error::{list, one_line};
use crate::{Signal, WriteError};
use std::collections::BTreeMap;
use std::ops::Range;

/// A recording's rows as columns, all of one length. A value that was not measured is NaN; no value is infinite.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Of the measurement. Never runs backwards inside a segment.
    pub time_s: Vec<f64>,
    /// The trajectory each row belongs to: where the number changes, a new one begins and time may jump.
    pub segment: Option<Vec<i64>>,
    /// In the order of the file.
    pub joints: Vec<JointColumns>,
    /// The planned rate where the file tells it, else what the times show.
    pub sample_rate_hz: f64,
    /// What the recorder wrote about the run.
    pub metadata: BTreeMap<String, String>,
    /// The recorder was stopped before it finished the file: the last rows may be missing.
    pub truncated: bool,
}

/// One joint's columns.
#[derive(Clone, Debug)]
pub struct JointColumns {
    /// The robot file's name of the joint.
    pub name: String,
    /// A signal that was never measured is not in the map.
    pub signals: BTreeMap<Signal, Vec<f64>>,
}

impl JointColumns {
    /// A signal with at least one value.
    #[must_use]
    pub fn measured(&self, signal: Signal) -> Option<&[f64]> {
        let values = self.signals.get(&signal)?;
        let is_there = values.iter().any(|value| value.is_finite());
        is_there.then_some(values)
    }
}

/// A signal that a computation needs is not in the recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MissingSignal {
    /// No joint has that name.
    #[error("the recording has no joint `{}`; its joints are {}", one_line(joint), list(.there))]
    Joint {
        /// The name asked for.
        joint: String,
        /// The names there are.
        there: Vec<String>,
    },
    /// The joint is there and the signal is not.
    #[error("the recording has no {signal} of joint `{}`; it has {}", one_line(joint), list(.there))]
    Signal {
        /// The joint's name.
        joint: String,
        /// The signal asked for.
        signal: Signal,
        /// The signals the joint has.
        there: Vec<String>,
    },
}

impl Recording {
    /// How many rows every column has.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.time_s.len()
    }

    /// The joints' names, in the order of the file.
    pub fn joint_names(&self) -> impl Iterator<Item = &str> {
        self.joints.iter().map(|joint| joint.name.as_str())
    }

    /// One joint's columns.
    ///
    /// # Errors
    /// Names the joint and those that are there.
    pub fn joint(&self, joint: &str) -> Result<&JointColumns, MissingSignal> {
        self.joints
            .iter()
            .find(|columns| columns.name == joint)
            .ok_or_else(|| MissingSignal::Joint {
                joint: joint.to_owned(),
                there: self.joint_names().map(str::to_owned).collect(),
            })
    }

    /// One signal of one joint, a value per row.
    ///
    /// # Errors
    /// Names the joint, the signal and what is there.
    pub fn signal(&self, joint: &str, signal: Signal) -> Result<&[f64], MissingSignal> {
        let columns = self.joint(joint)?;
        columns
            .signals
            .get(&signal)
            .map(Vec::as_slice)
            .ok_or_else(|| MissingSignal::Signal {
                joint: joint.to_owned(),
                signal,
                there: columns.signals.keys().map(ToString::to_string).collect(),
            })
    }

    /// The rows of each trajectory, in order; all rows are one where the recording tells no segments.
    #[must_use]
    pub fn segments(&self) -> Vec<Range<usize>> {
        segments(self.rows(), self.segment.as_deref())
    }

    /// The rows from `from_s` to `to_s`, both included, of these joints; all joints if none is named.
    ///
    /// # Errors
    /// Names the joint that is not there.
    pub fn part(&self, from_s: f64, to_s: f64, joints: &[String]) -> Result<Self, MissingSignal> {
        let rows: Vec<usize> = (0..self.rows())
            .filter(|row| (from_s..=to_s).contains(&self.time_s[*row]))
            .collect();
        let of_rows =
            |column: &Vec<f64>| -> Vec<f64> { rows.iter().map(|row| column[*row]).collect() };
        let cut = |joint: &JointColumns| JointColumns {
            name: joint.name.clone(),
            signals: joint
                .signals
                .iter()
                .map(|(signal, column)| (*signal, of_rows(column)))
                .filter(|(_, column)| column.iter().any(|value| !value.is_nan()))
                .collect(),
        };
        let joints = match joints {
            [] => self.joints.iter().map(cut).collect(),
            named => {
                let cut = |name: &String| self.joint(name).map(cut);
                named.iter().map(cut).collect::<Result<_, _>>()?
            }
        };
        Ok(Self {
            time_s: of_rows(&self.time_s),
            segment: self
                .segment
                .as_ref()
                .map(|segment| rows.iter().map(|row| segment[*row]).collect()),
            joints,
            sample_rate_hz: self.sample_rate_hz,
            metadata: self.metadata.clone(),
            truncated: self.truncated,
        })
    }

    /// The same table for a computation: equal times, segments, joints, values and rate, a value missing in
    /// both counting as equal. What was written about the run may differ.
    #[must_use]
    pub fn same_table(&self, other: &Self) -> bool {
        self.time_s == other.time_s
            && self.segment == other.segment
            && self.sample_rate_hz == other.sample_rate_hz
            && self.joints.len() == other.joints.len()
            && self
                .joints
                .iter()
                .zip(&other.joints)
                .all(|(a, b)| a.same_columns(b))
    }

    /// That all columns are as long as the time column.
    pub(crate) fn check_lengths(&self) -> Result<(), WriteError> {
        let rows = self.rows();
        let signals = self.joints.iter().flat_map(|joint| {
            joint
                .signals
                .iter()
                .map(|(signal, values)| (format!("{}.{signal}", joint.name), values.len()))
        });
        let segment = self
            .segment
            .iter()
            .map(|segment| ("segment".to_owned(), segment.len()));
        match segment.chain(signals).find(|(_, length)| *length != rows) {
            Some((column, length)) => Err(WriteError::ColumnLength {
                column,
                length,
                rows,
            }),
            None => Ok(()),
        }
    }
}

impl JointColumns {
    fn same_columns(&self, other: &Self) -> bool {
        self.name == other.name
            && self.signals.len() == other.signals.len()
            && self
                .signals
                .iter()
                .zip(&other.signals)
                .all(|((a, a_values), (b, b_values))| {
                    a == b && a_values.len() == b_values.len() && same_values(a_values, b_values)
                })
    }
}

fn same_values(a: &[f64], b: &[f64]) -> bool {
    a.iter()
        .zip(b)
        .all(|(a, b)| a == b || (a.is_nan() && b.is_nan()))
}

/// The rows of each trajectory.
pub(crate) fn segments(rows: usize, segment: Option<&[i64]>) -> Vec<Range<usize>> {
    let begins = |row: &usize| {
        *row == 0 || segment.is_some_and(|segment| segment[*row] != segment[*row - 1])
    };
    let starts: Vec<_> = (0..rows).filter(begins).collect();
    let ends = starts.iter().copied().skip(1).chain([rows]);
    starts
        .iter()
        .copied()
        .zip(ends)
        .map(|(start, end)| start..end)
        .collect()
}
