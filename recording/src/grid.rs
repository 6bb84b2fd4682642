//! Signals of a recording at a constant rate: where rows follow each other, and instants between
//! them.

use std::ops::Range;

use crate::{JointColumns, Recording};

/// A hole longer than this ends a piece.
const HOLE_MAX_S: f64 = 0.1;
/// Periods from one row to the next beyond which rows are missing between them. Time may be told in coarse digits.
const NEXT_MOST: f64 = 1.75;
/// Rows without a value are bridged over so many; what lies in longer holes does not count.
const BRIDGED_ROWS: usize = 3;

/// Rows without a hole among them, of one trajectory each.
pub fn pieces(recording: &Recording) -> Vec<Range<usize>> {
    let hole_s = HOLE_MAX_S.max(3.0 / recording.sample_rate_hz);
    without_holes(recording, hole_s)
}

/// Rows with none missing between them, of one trajectory each: what is read from one row to the next is read within these.
pub fn runs(recording: &Recording) -> Vec<Range<usize>> {
    without_holes(recording, NEXT_MOST / recording.sample_rate_hz)
}

/// One joint's signals, run by run.
pub fn in_runs(joint: &JointColumns, runs: &[Range<usize>]) -> Vec<JointColumns> {
    let in_run = |rows: &Range<usize>| JointColumns {
        name: joint.name.clone(),
        signals: joint
            .signals
            .iter()
            .map(|(signal, values)| (*signal, values[rows.clone()].to_vec()))
            .collect(),
    };
    runs.iter().map(in_run).collect()
}

fn without_holes(recording: &Recording, hole_s: f64) -> Vec<Range<usize>> {
    let time_s = &recording.time_s;
    let mut pieces = Vec::new();
    for rows in recording.segments() {
        let mut start = rows.start;
        for row in rows.start + 1..rows.end {
            let follows = time_s[row] - time_s[row - 1] <= hole_s;
            if !follows {
                pieces.push(start..row);
                start = row;
            }
        }
        pieces.push(start..rows.end);
    }
    pieces
}

/// Instants at a constant rate, each between two rows.
#[derive(Clone, Debug)]
pub struct Grid {
    start_s: f64,
    period_s: f64,
    /// The row before, and how far it is to the next.
    places: Vec<(usize, f64)>,
    rows: Range<usize>,
}

impl Grid {
    /// Of rows that begin with the first one, at their times: of at least one.
    pub fn new(time_s: &[f64], first_row: usize, rate_hz: f64) -> Self {
        let rows = first_row..first_row + time_s.len();
        let start_s = time_s[0];
        let period_s = 1.0 / rate_hz;
        let uneven_s = (0..time_s.len())
            .map(|k| (time_s[k] - start_s - k as f64 * period_s).abs())
            .fold(0.0, f64::max);
        let places = if uneven_s < 0.2 * period_s {
            rows.clone().map(|row| (row, 0.0)).collect()
        } else {
            between_rows(time_s, first_row, period_s)
        };
        Self {
            start_s,
            period_s,
            places,
            rows,
        }
    }

    /// Between two instants.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Of the first instant.
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// The row that it begins with.
    pub fn first_row(&self) -> usize {
        self.rows.start
    }

    /// How many instants.
    pub fn samples(&self) -> usize {
        self.places.len()
    }

    /// A signal at the grid's instants, with where it was there.
    pub fn sample(&self, values: &[f64], scale: f64) -> (Vec<f64>, Vec<bool>) {
        let (bridged, whole) = bridge(&values[self.rows.clone()]);
        let first = self.rows.start;
        let last = bridged.len() - 1;
        let sampled = self.places.iter().map(|&(row, share)| {
            let (a, b) = (row - first, (row - first + 1).min(last));
            scale * (bridged[a] + share * (bridged[b] - bridged[a]))
        });
        let whole = self.places.iter().map(|&(row, _)| whole[row - first]);
        (sampled.collect(), whole.collect())
    }
}

fn between_rows(time_s: &[f64], first_row: usize, period_s: f64) -> Vec<(usize, f64)> {
    let end_s = time_s[time_s.len() - 1] - time_s[0];
    let count = (end_s / period_s) as usize + 1;
    let mut row = 0;
    (0..count)
        .map(|k| {
            let at_s = time_s[0] + k as f64 * period_s;
            while row + 2 < time_s.len() && time_s[row + 1] <= at_s {
                row += 1;
            }
            let step_s = time_s[row + 1] - time_s[row];
            let share = if step_s > 0.0 {
                ((at_s - time_s[row]) / step_s).clamp(0.0, 1.0)
            } else {
                0.0
            };
            (first_row + row, share)
        })
        .collect()
}

/// Fills holes by straight lines, and tells which rows do not lie in long ones.
fn bridge(values: &[f64]) -> (Vec<f64>, Vec<bool>) {
    let mut bridged = values.to_vec();
    let mut whole = vec![true; values.len()];
    let mut row = 0;
    while row < values.len() {
        if values[row].is_finite() {
            row += 1;
            continue;
        }
        let end = (row..values.len())
            .find(|k| values[*k].is_finite())
            .unwrap_or(values.len());
        let before = row.checked_sub(1).map(|k| bridged[k]);
        let after = values.get(end).copied();
        let (from, to) = match (before, after) {
            (Some(from), Some(to)) => (from, to),
            (Some(only), None) | (None, Some(only)) => (only, only),
            (None, None) => (0.0, 0.0),
        };
        let steps = (end - row + 1) as f64;
        for k in row..end {
            bridged[k] = from + (to - from) * (k - row + 1) as f64 / steps;
            whole[k] = end - row <= BRIDGED_ROWS;
        }
        row = end;
    }
    (bridged, whole)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn a_missing_row_a_hole_and_a_new_trajectory_end_what_follows() {
        let mut recording = Recording {
            time_s: vec![0.0, 0.01, 0.02, 0.04, 0.05, 1.06],
            segment: None,
            sample_rate_hz: 100.0,
            joints: Vec::new(),
            metadata: std::collections::BTreeMap::new(),
            truncated: false,
        };
        assert_eq!(runs(&recording), [0..3, 3..5, 5..6]);
        assert_eq!(pieces(&recording), [0..5, 5..6]);
        recording.segment = Some(vec![0, 0, 0, 0, 1, 1]);
        assert_eq!(runs(&recording), [0..3, 3..4, 4..5, 5..6]);
        assert_eq!(pieces(&recording), [0..4, 4..5, 5..6]);
        // milliseconds at 1500 Hz
        recording.time_s = vec![0.0, 0.001, 0.001, 0.002, 0.003, 0.003];
        recording.sample_rate_hz = 1500.0;
        recording.segment = None;
        assert_eq!(runs(&recording), vec![0..6; 1]);
    }

    #[test]
    fn holes_are_bridged_and_long_ones_do_not_count() {
        let nan = f64::NAN;
        let (values, whole) = bridge(&[nan, 1.0, nan, 3.0, nan, nan, nan, nan, 8.0, nan]);
        assert_eq!(values, [1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 8.0]);
        let missing: Vec<usize> = (0..whole.len()).filter(|k| !whole[*k]).collect();
        assert_eq!(missing, [4, 5, 6, 7]);
    }

    #[test]
    fn an_uneven_clock_is_brought_to_a_constant_rate() {
        let time_s = [0.0, 0.9, 2.2, 3.0, 4.0];
        let grid = Grid::new(&time_s, 0, 1.0);
        let (values, _) = grid.sample(&time_s, 2.0);
        for (k, value) in values.iter().enumerate() {
            assert!((value - 2.0 * k as f64).abs() < 1e-12);
        }
    }
}
