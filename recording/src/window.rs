//! The last rows of a run, kept in memory: what a service watches, and runs that nobody needs a file of.

use std::collections::{BTreeMap, VecDeque};

use crate::{JointColumns, JointCycle, Recording, Signal};

/// Rows as they come, oldest first.
#[derive(Clone, Debug)]
pub struct Window {
    joint_names: Vec<String>,
    sample_rate_hz: f64,
    time_s: VecDeque<f64>,
    /// Row by row, joint by joint; what was not measured is NaN.
    cells: VecDeque<[f64; Signal::ALL.len()]>,
}

impl Window {
    /// Without rows; the rate is the planned one.
    #[must_use]
    pub fn new(joint_names: Vec<String>, sample_rate_hz: f64) -> Self {
        Self {
            joint_names,
            sample_rate_hz,
            time_s: VecDeque::new(),
            cells: VecDeque::new(),
        }
    }

    /// Appends a row; a joint that is missing from it has no signal there. A row that does not come after the last is
    /// left out, and `false` returned.
    pub fn push(&mut self, time_s: f64, joints: &[JointCycle]) -> bool {
        // false for NaN too
        let comes_after = self.time_s.back().is_none_or(|last_s| time_s > *last_s);
        if !comes_after || !time_s.is_finite() {
            return false;
        }
        self.time_s.push_back(time_s);
        let row = (0..self.joint_names.len()).map(|joint| {
            Signal::ALL.map(|signal| {
                let value = joints.get(joint).and_then(|cell| cell.get(signal));
                value.filter(|value| value.is_finite()).unwrap_or(f64::NAN)
            })
        });
        self.cells.extend(row);
        true
    }

    /// Lets go of rows before a time.
    pub fn forget_before(&mut self, time_s: f64) {
        let rows = self.time_s.partition_point(|row_s| *row_s < time_s);
        self.time_s.drain(..rows);
        self.cells.drain(..rows * self.joint_names.len());
    }

    /// Time of the oldest and of the newest row.
    #[must_use]
    pub fn span_s(&self) -> Option<[f64; 2]> {
        Some([*self.time_s.front()?, *self.time_s.back()?])
    }

    /// The rows from `from_s` to `to_s`, both included.
    #[must_use]
    pub fn table(&self, from_s: f64, to_s: f64) -> Recording {
        let first = self.time_s.partition_point(|row_s| *row_s < from_s);
        let end = self.time_s.partition_point(|row_s| *row_s <= to_s);
        let rows = first..end.max(first);
        let joints = self.joint_names.iter().enumerate().map(|(joint, name)| {
            let column = |signal: Signal| -> Vec<f64> {
                let cell = |row: usize| self.cells[row * self.joint_names.len() + joint];
                rows.clone().map(|row| cell(row)[signal as usize]).collect()
            };
            let signals: BTreeMap<Signal, Vec<f64>> = Signal::ALL
                .into_iter()
                .map(|signal| (signal, column(signal)))
                .filter(|(_, values)| values.iter().any(|value| !value.is_nan()))
                .collect();
            JointColumns {
                name: name.clone(),
                signals,
            }
        });
        Recording {
            joints: joints.collect(),
            time_s: self.time_s.range(rows).copied().collect(),
            segment: None,
            sample_rate_hz: self.sample_rate_hz,
            metadata: BTreeMap::new(),
            truncated: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window() -> Window {
        let mut window = Window::new(vec!["a".to_owned(), "b".to_owned()], 10.0);
        for row in 0..5 {
            let cell = |value: f64| JointCycle {
                motor_position_rad: Some(value),
                ..JointCycle::default()
            };
            let row = f64::from(row);
            assert!(window.push(0.1 * row, &[cell(row), cell(10.0 + row)]));
        }
        window
    }

    #[test]
    fn a_part_of_the_rows_is_a_recording_of_the_signals_there_were() {
        let table = window().table(0.1, 0.35);
        assert_eq!(table.rows(), 3);
        let signal = |joint| table.signal(joint, Signal::MotorPositionRad).unwrap();
        assert_eq!(signal("a"), [1.0, 2.0, 3.0]);
        assert_eq!(signal("b"), [11.0, 12.0, 13.0]);
        assert_eq!(table.joints[0].signals.len(), 1);
        assert_eq!(window().table(0.5, 0.1).rows(), 0);
    }

    #[test]
    fn what_is_forgotten_is_gone_and_time_only_goes_forward() {
        let mut window = window();
        assert!(!window.push(0.4, &[]));
        assert!(!window.push(f64::NAN, &[]));
        window.forget_before(0.25);
        assert_eq!(window.span_s(), Some([0.1 * 3.0, 0.4]));
        let table = window.table(0.0, 1.0);
        assert_eq!(
            table.signal("b", Signal::MotorPositionRad).unwrap(),
            [13.0, 14.0]
        );
        assert!(window.push(0.5, &[]));
        assert!(window.table(0.5, 0.5).joints[0].signals.is_empty());
    }
}
