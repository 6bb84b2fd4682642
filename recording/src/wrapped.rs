//! Positions of encoders that begin anew after each turn: a row on which a joint would have leapt by a turn.

use std::borrow::Cow;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

use crate::grid::runs;
use crate::statistics;
use crate::{Finding, FindingKind, JointColumns, Recording, Signal};

/// Whose values may begin anew.
const POSITIONS: [Signal; 3] = [
    Signal::MotorPositionRad,
    Signal::LinkPositionRad,
    Signal::ReferencePositionRad,
];

/// The way from one value to the next that is there, with the row of the next.
fn ways(values: &[f64], run: Range<usize>) -> impl Iterator<Item = (usize, f64)> {
    let mut before = f64::NAN;
    run.filter(|row| values[*row].is_finite())
        .filter_map(move |row| {
            let way = values[row] - before;
            before = values[row];
            way.is_finite().then_some((row, way))
        })
}

/// Rows on which a signal begins anew, with the turns that it goes back there. A leap of more than half a turn is one if, less its whole
/// turns, it is no longer than the longest way from row to row anywhere else; and if it goes from end to end, for what counts within so
/// many turns is never beyond them.
fn rows(values: &[f64], runs: &[Range<usize>]) -> Vec<(usize, f64)> {
    let all = || runs.iter().flat_map(|run| ways(values, run.clone()));
    let longest = all()
        .filter(|(_, way)| way.abs() <= PI)
        .fold(0.0, |longest: f64, (_, way)| longest.max(way.abs()));
    let found: Vec<(usize, f64, f64)> = all()
        .filter(|(_, way)| way.abs() > PI)
        .map(|(row, way)| (row, way, (way / TAU).round()))
        .collect();
    let counted_rad = statistics::span(values);
    let is_turn = |(_, way, turns): &(usize, f64, f64)| {
        (way - turns * TAU).abs() <= longest && counted_rad <= turns.abs() * TAU + longest
    };
    if found.iter().all(is_turn) {
        found.iter().map(|(row, _, turns)| (*row, *turns)).collect()
    } else {
        Vec::new()
    }
}

/// What begins anew of a joint, signal by signal.
fn of_joint<'a>(
    joint: &'a JointColumns,
    runs: &'a [Range<usize>],
) -> impl Iterator<Item = (Signal, Vec<(usize, f64)>)> + 'a {
    POSITIONS.into_iter().filter_map(|signal| {
        let rows = rows(joint.signals.get(&signal)?, runs);
        (!rows.is_empty()).then_some((signal, rows))
    })
}

/// The recording with positions that go on where they began anew.
pub(crate) fn without_wraps(recording: &Recording) -> Cow<'_, Recording> {
    let mut whole = Cow::Borrowed(recording);
    let runs = runs(recording);
    for (index, joint) in recording.joints.iter().enumerate() {
        for (signal, rows) in of_joint(joint, &runs) {
            let Some(values) = whole.to_mut().joints[index].signals.get_mut(&signal) else {
                continue;
            };
            for run in &runs {
                let mut turns = 0.0;
                for row in run.clone() {
                    if let Ok(found) = rows.binary_search_by_key(&row, |(row, _)| *row) {
                        turns += rows[found].1;
                    }
                    values[row] -= turns * TAU;
                }
            }
        }
    }
    whole
}

/// What began anew.
pub(crate) fn check(recording: &Recording) -> Vec<Finding> {
    let runs = runs(recording);
    let all = recording.joints.iter();
    let found = all.flat_map(|joint| of_joint(joint, &runs).map(move |of| (joint, of)));
    let told = found.map(|(joint, (signal, rows))| {
        let first = rows[0].0;
        let many = match rows.len() {
            1 => String::new(),
            count => format!(", and {} times more", count - 1),
        };
        let what = format!(
            "begins anew after a turn, first in row {} at {:.3} s{many}; the diagnosis lets it go on",
            first + 1,
            recording.time_s[first] - recording.time_s[0],
        );
        Finding::warning(FindingKind::Wrapped, what)
            .at(joint)
            .of(signal)
            .decided_by(rows.len() as f64)
    });
    told.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Goes on from 1 rad with this speed, as an encoder of one turn shows it.
    fn turning(speed_rad_s: f64, count: u32) -> Vec<f64> {
        let at = |row: u32| 1.0 + speed_rad_s * 1e-3 * f64::from(row);
        (0..count).map(|row| at(row).rem_euclid(TAU)).collect()
    }

    fn recording(position_rad: Vec<f64>, segment: Option<Vec<i64>>) -> Recording {
        Recording {
            time_s: (0..position_rad.len())
                .map(|row| 1e-3 * row as f64)
                .collect(),
            segment,
            joints: vec![JointColumns {
                name: "joint1".to_owned(),
                signals: BTreeMap::from([(Signal::LinkPositionRad, position_rad)]),
            }],
            sample_rate_hz: 1000.0,
            metadata: BTreeMap::new(),
            truncated: false,
        }
    }

    #[test]
    fn a_position_goes_on_where_its_encoder_begins_anew() {
        for speed_rad_s in [3.0, -3.0] {
            let mut shown = turning(speed_rad_s, 6000);
            shown[4000] = f64::NAN;
            let recording = recording(shown, None);
            let found = check(&recording);
            assert!(
                found.len() == 1 && found[0].what.contains("more"),
                "{found:?}"
            );
            let whole = without_wraps(&recording);
            let position_rad = &whole.joints[0].signals[&Signal::LinkPositionRad];
            let moved_rad = position_rad[5999] - position_rad[0];
            assert!(
                (moved_rad - 5.999 * speed_rad_s).abs() < 1e-9,
                "{moved_rad}"
            );
            assert!(check(&whole).is_empty());
        }
    }

    #[test]
    fn a_motor_that_turns_far_from_row_to_row_does_not_begin_anew() {
        // up to two turns a row
        let fast = (0..600).map(|row| 114.0 * (0.1 * f64::from(row)).sin());
        assert!(check(&recording(fast.collect(), None)).is_empty());
    }

    #[test]
    fn leaps_that_are_no_turns_and_new_trajectories_are_none() {
        // a misread row
        let mut shown: Vec<f64> = (0..600).map(|row| 1e-3 * f64::from(row)).collect();
        shown[300] = -3.1;
        assert!(check(&recording(shown.clone(), None)).is_empty());
        // another trajectory begins a turn away
        shown[300] = 0.3;
        let segment = (0..600).map(|row| i64::from(row >= 300)).collect();
        let away = shown
            .iter()
            .enumerate()
            .map(|(row, rad)| if row < 300 { *rad } else { rad - TAU });
        assert!(check(&recording(away.collect(), Some(segment))).is_empty());
    }
}
