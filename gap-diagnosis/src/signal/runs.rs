//! Rows that follow each other without one missing: what is read from one row to the next is read within these.

use std::ops::Range;

use recording::{JointColumns, Recording};

/// Periods from one row to the next beyond which rows are missing between them. Time may be told in coarse digits.
const NEXT_MOST: f64 = 1.75;

/// Of one trajectory each, with no row missing.
pub(crate) fn rows(recording: &Recording) -> Vec<Range<usize>> {
    let most_s = NEXT_MOST / recording.sample_rate_hz;
    let time_s = &recording.time_s;
    let mut runs = Vec::new();
    for segment in recording.segments() {
        let mut start = segment.start;
        for row in segment.start + 1..segment.end {
            let step_s = time_s[row] - time_s[row - 1];
            if !(0.0..=most_s).contains(&step_s) {
                runs.push(start..row);
                start = row;
            }
        }
        runs.push(start..segment.end);
    }
    runs
}

/// One joint's signals, run by run.
pub(crate) fn of_joint(recording: &Recording, joint: &JointColumns) -> Vec<JointColumns> {
    pieces(joint, &rows(recording))
}

/// The same, of runs that are known.
pub(crate) fn pieces(joint: &JointColumns, runs: &[Range<usize>]) -> Vec<JointColumns> {
    let runs = runs.iter().cloned();
    runs.map(|rows| cut(joint, rows)).collect()
}

/// One joint's signals in some rows.
fn cut(joint: &JointColumns, rows: Range<usize>) -> JointColumns {
    JointColumns {
        name: joint.name.clone(),
        signals: joint
            .signals
            .iter()
            .map(|(signal, values)| (*signal, values[rows.clone()].to_vec()))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_row_and_a_new_trajectory_end_a_run() {
        let mut recording = Recording {
            time_s: vec![0.0, 0.01, 0.02, 0.04, 0.05, 0.06],
            segment: None,
            sample_rate_hz: 100.0,
            joints: Vec::new(),
            metadata: std::collections::BTreeMap::new(),
            truncated: false,
        };
        assert_eq!(rows(&recording), [0..3, 3..6]);
        recording.segment = Some(vec![0, 0, 0, 0, 1, 1]);
        assert_eq!(rows(&recording), [0..3, 3..4, 4..6]);
        // milliseconds at 1500 Hz
        recording.time_s = vec![0.0, 0.001, 0.001, 0.002, 0.003, 0.003];
        recording.sample_rate_hz = 1500.0;
        recording.segment = None;
        assert_eq!(rows(&recording), vec![0..6; 1]);
    }
}
