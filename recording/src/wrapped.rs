//! Positions of encoders that begin anew after each turn: a row on which a joint would have leapt by a turn.

use std::borrow::Cow;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

use crate::statistics;
use crate::{Finding, FindingKind, JointColumns, Recording, Signal};

/// Whose values may begin anew.
const POSITIONS: [Signal; 3] = [
    Signal::MotorPositionRad,
    Signal::LinkPositionRad,
    Signal::ReferencePositionRad,
];

/// How a value goes on to the next that is there.
#[derive(Clone, Copy)]
struct Way {
    /// Row of the next.
    row: usize,
    /// How far.
    rad: f64,
    /// In how many rows' time.
    rows: f64,
}

fn ways(values: &[f64], time_s: &[f64], rate_hz: f64, run: Range<usize>) -> Vec<Way> {
    let mut before: Option<usize> = None;
    let there = run.filter(|row| values[*row].is_finite());
    there
        .filter_map(|row| {
            let from = before.replace(row)?;
            Some(Way {
                row,
                rad: values[row] - values[from],
                rows: ((time_s[row] - time_s[from]) * rate_hz).max(1.0),
            })
        })
        .collect()
}

/// Rows in the middle of a leap, where a potentiometer's wiper or a filter showed neither end: of two ways on, together more than half
/// a turn, each is longer than every way elsewhere.
fn between(runs: &[Vec<Way>]) -> Vec<usize> {
    let per_row = |way: &Way| way.rad.abs() / way.rows;
    // its shorter way, and where the second is
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    let mut pairs_of: Vec<Vec<u8>> = runs.iter().map(|run| vec![0; run.len()]).collect();
    for (run, ways) in runs.iter().enumerate() {
        for (first, two) in ways.windows(2).enumerate() {
            if two[0].rad * two[1].rad > 0.0 && (two[0].rad + two[1].rad).abs() > PI {
                let shorter = per_row(&two[0]).min(per_row(&two[1]));
                pairs.push((shorter, run, first + 1));
                pairs_of[run][first] += 1;
                pairs_of[run][first + 1] += 1;
            }
        }
    }
    let mut longest = 0.0_f64;
    for (way, pairs) in runs.iter().flatten().zip(pairs_of.iter().flatten()) {
        if *pairs == 0 && way.rad.abs() <= PI {
            longest = longest.max(per_row(way));
        }
    }
    // the ways of a pair that is none are elsewhere for the others
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut none = 0;
    while let Some(&(shorter, run, second)) = pairs.get(none)
        && shorter <= longest
    {
        for index in [second - 1, second] {
            let way = &runs[run][index];
            pairs_of[run][index] -= 1;
            if pairs_of[run][index] == 0 && way.rad.abs() <= PI {
                longest = longest.max(per_row(way));
            }
        }
        none += 1;
    }
    let middle = |(_, run, second): &(f64, usize, usize)| runs[*run][second - 1].row;
    pairs[none..].iter().map(middle).collect()
}

/// Rows on which a signal begins anew, with how far it goes back there. A leap of more than half a turn is one if, less its whole
/// turns, it is no longer than so many times the longest way from row to row anywhere else; or, of an encoder, if the joint goes on the
/// other way before and after. And if it goes from end to end, for what counts within so far is never beyond that.
fn rows(signal: Signal, values: &[f64], runs: &[Vec<Way>], times: f64) -> Vec<(usize, f64)> {
    let all = || runs.iter().flatten();
    let each = all().filter(|way| way.rad.abs() <= PI);
    let longest = each.fold(0.0, |longest: f64, way| {
        longest.max(way.rad.abs() / way.rows)
    });
    // after many rows that are missing nobody knows where a joint went
    let is_leap = |way: &&Way| way.rad.abs() > PI && longest * way.rows < PI;
    let leaps: Vec<&Way> = all().filter(is_leap).collect();
    if leaps.is_empty() {
        return Vec::new();
    }
    // who goes half a turn from one row to the next leaps by that too
    if all().any(|way| way.rad.abs() > PI && way.rows < 2.0 && longest * way.rows >= PI) {
        return Vec::new();
    }
    let counted_rad = statistics::span(values);
    let turns = |way: &Way| (way.rad / TAU).round() * TAU;
    let is_turn = |way: &&&Way| {
        (way.rad - turns(way)).abs() <= times * longest * way.rows
            && counted_rad <= turns(way).abs() + longest
    };
    if leaps.iter().filter(is_turn).count() == leaps.len() {
        return leaps.iter().map(|way| (way.row, turns(way))).collect();
    }
    if signal == Signal::ReferencePositionRad {
        return Vec::new();
    }
    let around = runs.iter().flat_map(|run| run.windows(3));
    let around = around.filter(|three| leaps.iter().any(|leap| leap.row == three[1].row));
    // what the leap hides of the way on is as long as the ways beside it
    let whole = around.filter_map(|three| {
        let on = 0.5 * (three[0].rad / three[0].rows + three[2].rad / three[2].rows);
        let goes_on = [three[0].rad, three[2].rad].map(|rad| rad * three[1].rad < 0.0);
        goes_on
            .iter()
            .all(|goes_on| *goes_on)
            .then_some((three[1].rad - on * three[1].rows).abs())
    });
    let whole: Vec<f64> = whole.collect();
    if whole.len() < leaps.len() {
        return Vec::new();
    }
    let period_rad = whole.iter().sum::<f64>() / whole.len() as f64;
    if counted_rad > period_rad + longest {
        return Vec::new();
    }
    leaps
        .iter()
        .map(|way| (way.row, period_rad.copysign(way.rad)))
        .collect()
}

/// What begins anew of a signal.
struct Wraps {
    signal: Signal,
    /// With how far it goes back there.
    rows: Vec<(usize, f64)>,
    /// In the middle of a leap.
    between: Vec<usize>,
}

/// How far a leap with rows between may be from whole turns, in ways from row to row: the joint's own, and as much that a row before it
/// is on the way already without being told from those that are not.
const WAYS_BETWEEN: f64 = 2.0;

/// What begins anew of a joint, signal by signal.
fn of_joint(recording: &Recording, joint: &JointColumns) -> Vec<Wraps> {
    let runs = |values: &[f64]| -> Vec<Vec<Way>> {
        let segments = recording.segments().into_iter();
        let (time_s, rate_hz) = (&recording.time_s, recording.sample_rate_hz);
        segments
            .map(|run| ways(values, time_s, rate_hz, run))
            .collect()
    };
    let found = POSITIONS.into_iter().filter_map(|signal| {
        let values = joint.signals.get(&signal)?;
        let all = runs(values);
        // no sensor shows a reference
        let between = match signal {
            Signal::ReferencePositionRad => Vec::new(),
            _ => between(&all),
        };
        if !between.is_empty() {
            let mut values = values.clone();
            between.iter().for_each(|row| values[*row] = f64::NAN);
            let rows = rows(signal, &values, &runs(&values), WAYS_BETWEEN);
            // a joint that goes a turn in two rows seldom leaps by one
            if rows.len() >= 2 * between.len() {
                return Some(Wraps {
                    signal,
                    rows,
                    between,
                });
            }
        }
        let rows = rows(signal, values, &all, 1.0);
        (!rows.is_empty()).then_some(Wraps {
            signal,
            rows,
            between: Vec::new(),
        })
    });
    found.collect()
}

/// The recording with positions that go on where they began anew.
pub(crate) fn without_wraps(recording: &Recording) -> Cow<'_, Recording> {
    let mut whole = Cow::Borrowed(recording);
    for (index, joint) in recording.joints.iter().enumerate() {
        for Wraps {
            signal,
            rows,
            between,
        } in of_joint(recording, joint)
        {
            let Some(values) = whole.to_mut().joints[index].signals.get_mut(&signal) else {
                continue;
            };
            for segment in recording.segments() {
                let mut gone_rad = 0.0;
                for row in segment {
                    if let Ok(found) = rows.binary_search_by_key(&row, |(row, _)| *row) {
                        gone_rad += rows[found].1;
                    }
                    values[row] -= gone_rad;
                }
            }
            between.into_iter().for_each(|row| values[row] = f64::NAN);
        }
    }
    whole
}

/// What began anew.
pub(crate) fn check(recording: &Recording) -> Vec<Finding> {
    let all = recording.joints.iter();
    let found = all.flat_map(|joint| {
        let found = of_joint(recording, joint).into_iter();
        found.map(move |of| (joint, of))
    });
    let told = found.map(|(joint, wraps)| {
        let rows = wraps.rows;
        let (first, back_rad) = rows[0];
        let many = match rows.len() {
            1 => String::new(),
            count => format!(", and {} times more", count - 1),
        };
        let left_out = match wraps.between.len() {
            0 => "",
            _ => ", without the rows in which it leaps",
        };
        let what = format!(
            "begins anew after {:.4} rad, first in row {} at {:.3} s{many}; the diagnosis lets it go on{left_out}",
            back_rad.abs(),
            first + 1,
            recording.time_s[first] - recording.time_s[0],
        );
        Finding::warning(FindingKind::Wrapped, what)
            .at(joint)
            .of(wraps.signal)
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
    fn an_encoder_may_begin_anew_after_any_way_and_while_rows_are_missing() {
        // 25 rad, as a servo's protocol counts them, with a row in twenty lost
        let kept: Vec<u32> = (0..9000).filter(|row| row * row % 20 != 9).collect();
        let at = |row: u32| 9.0 + 40.0 * (6e-4 * f64::from(row)).sin();
        let shown = |row: &u32| (at(*row) + 12.5).rem_euclid(25.0) - 12.5;
        let mut recording = recording(kept.iter().map(shown).collect(), None);
        recording.time_s = kept.iter().map(|row| 1e-3 * f64::from(*row)).collect();
        let found = check(&recording);
        assert!(found[0].what.contains("after 25.00"), "{found:?}");
        let whole = without_wraps(&recording);
        let position_rad = &whole.joints[0].signals[&Signal::LinkPositionRad];
        for (row, rad) in kept.iter().zip(position_rad) {
            assert!((rad - at(*row)).abs() < 1e-2, "{row}: {rad}");
        }
        // a reference may leap from end to end, and an encoder that stands before and after did
        let square = (0..600).map(|row| if row % 200 < 100 { 2.0 } else { -2.0 });
        recording.time_s = (0..600).map(|row| 1e-3 * f64::from(row)).collect();
        recording.joints[0]
            .signals
            .insert(Signal::LinkPositionRad, square.collect());
        assert!(check(&recording).is_empty());
    }

    #[test]
    fn a_row_in_the_middle_of_a_leap_is_no_sample() {
        // six leaps, of which every second has a row that shows neither end, as a potentiometer's wiper leaves its track
        let mut shown = turning(8.0, 5000);
        let leaps: Vec<usize> = (1..5000)
            .filter(|row| shown[row - 1] - shown[*row] > PI)
            .collect();
        assert_eq!(leaps.len(), 6);
        let between = [leaps[0], leaps[2], leaps[4]];
        for (row, rad) in between.into_iter().zip([4.3, 0.9, 3.2]) {
            shown[row] = rad;
        }
        let recording_of = |shown: &[f64]| recording(shown.to_vec(), None);
        let found = check(&recording_of(&shown));
        assert!(
            found.len() == 1 && found[0].what.contains("without the rows in which it leaps"),
            "{found:?}"
        );
        assert_eq!(found[0].value, Some(6.0));
        let recording = recording_of(&shown);
        let whole = without_wraps(&recording);
        let position_rad = &whole.joints[0].signals[&Signal::LinkPositionRad];
        for (row, rad) in position_rad.iter().enumerate() {
            let goes_on = (rad - 1.0 - 8e-3 * row as f64).abs() < 1e-9;
            assert!(
                goes_on || rad.is_nan() && between.contains(&row),
                "{row}: {rad}"
            );
        }
    }

    #[test]
    fn a_joint_that_goes_a_turn_in_two_rows_does_not_begin_anew() {
        // from rest to rest, there and back, and once from one row to the next
        let at = |row: u32| match (row % 100, row) {
            (0, 1..) => PI,
            (..50, _) => 0.0,
            (50, 250) => TAU,
            (50, _) => PI,
            _ => TAU,
        };
        assert!(check(&recording((0..600).map(at).collect(), None)).is_empty());
        // faster and faster, for as many rows as long logs have
        let faster = (0..200_000).map(|row| 3.1 * 0.5 * f64::from(row) * f64::from(row) / 2e5);
        assert!(check(&recording(faster.collect(), None)).is_empty());
        // on the way to more speed, and back
        let fast = (0..600).map(|row| 3.0 * (0.9 * f64::from(row)).sin());
        assert!(check(&recording(fast.collect(), None)).is_empty());
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
