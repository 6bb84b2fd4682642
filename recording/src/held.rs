//! Positions that come more slowly than the rows, each repeated until the next one.

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::grid::runs;
use crate::statistics::{quantile, span};
use crate::{Finding, FindingKind, JointColumns, Recording, STILL_RAD, Signal};

/// Whose values a logger may repeat. Commands and references may truly stay.
const MEASURED: [Signal; 7] = [
    Signal::MotorPositionRad,
    Signal::LinkPositionRad,
    Signal::MotorVelocityRadS,
    Signal::LinkVelocityRadS,
    Signal::MotorTorqueNm,
    Signal::JointTorqueNm,
    Signal::MotorCurrentA,
];
/// Part of a value's changes that are as small as its step, where it has one, and the multiple of that from which on a change is of
/// several steps: an encoder that is turned slowly changes by one after the other. With these numbers none of 164 logs of real
/// robots is found but the three of an arm in which each value stands in three rows.
const SMALL: f64 = 0.1;
const STEPS: f64 = 1.5;
/// Fewer changes tell nothing: half of them is a count within a seventh, by its deviation.
const CHANGES_MIN: usize = 50;
/// Part of the values that stay, where they are repeated: of lost samples, one in three at most.
const NEARLY_ALL: f64 = 0.75;

/// Where a value changes, the first row included, and over how many rows it usually stays. None where it comes with every row, or changes
/// by single steps, as what moves slowly does.
fn changes(values: &[f64]) -> Option<(Vec<usize>, usize)> {
    let mut rows = vec![0];
    rows.extend((1..values.len()).filter(|k| values[*k] != values[k - 1]));
    let ways = || {
        rows.windows(2)
            .map(|pair| (values[pair[1]] - values[pair[0]]).abs())
    };
    // the smallest may be a rounding of what is no change
    let step = quantile(ways().filter(|way| way.is_finite()).collect(), SMALL)?;
    let stays = rows
        .windows(2)
        .zip(ways())
        .filter(|(_, way)| *way > STEPS * step);
    let stays: Vec<f64> = stays.map(|(pair, _)| (pair[1] - pair[0]) as f64).collect();
    if stays.len() < CHANGES_MIN.max(rows.len() / 2) {
        return None;
    }
    // samples that are lost now and then let some stay for longer, and not nearly all
    let nearly_all = quantile(stays.clone(), 1.0 - NEARLY_ALL)?;
    let usual = quantile(stays, 0.5)? as usize;
    (nearly_all > 1.0).then_some((rows, usual))
}

/// What is repeated of a joint, signal by signal: rows with a new value, and over how many it usually stays. What is measured beside a
/// position that comes with every row may truly stay.
fn of_joint(joint: &JointColumns) -> BTreeMap<Signal, (Vec<usize>, usize)> {
    let signals = MEASURED.into_iter();
    let found: BTreeMap<_, _> = signals
        .filter_map(|signal| Some((signal, changes(joint.signals.get(&signal)?)?)))
        .collect();
    // an encoder that stands shows steps of its filter
    let is_held =
        |encoder: &Signal| found.contains_key(encoder) && span(&joint.signals[encoder]) > STILL_RAD;
    let encoders = [Signal::MotorPositionRad, Signal::LinkPositionRad];
    if encoders.iter().any(is_held) {
        found
    } else {
        BTreeMap::new()
    }
}

/// The recording with straight lines from each new value to the next, where values were repeated between them.
pub(crate) fn without_held(recording: &Recording) -> Cow<'_, Recording> {
    let mut whole = Cow::Borrowed(recording);
    let runs = runs(recording);
    for (index, joint) in recording.joints.iter().enumerate() {
        for (signal, (rows, usual)) in of_joint(joint) {
            let Some(values) = whole.to_mut().joints[index].signals.get_mut(&signal) else {
                continue;
            };
            for pair in rows.windows(2) {
                let [from, to] = [pair[0], pair[1]];
                // what stays for longer stands
                let first = from.max(to.saturating_sub(usual + 1));
                let [begin, way] = [values[from], values[to] - values[from]];
                let own = runs.partition_point(|run| run.end <= first);
                let is_one_run = runs.get(own).is_some_and(|run| run.contains(&to));
                if !(is_one_run && way.is_finite()) {
                    continue;
                }
                let part = way / (to - first) as f64;
                for (value, row) in values[first + 1..to].iter_mut().zip(1_u32..) {
                    *value = begin + part * f64::from(row);
                }
            }
        }
    }
    whole
}

/// What was repeated, a joint at a time.
pub(crate) fn check(recording: &Recording) -> Vec<Finding> {
    let told = recording.joints.iter().filter_map(|joint| {
        let found = of_joint(joint);
        let each = found.iter().map(|(signal, (_, usual))| {
            let rate_hz = recording.sample_rate_hz / *usual as f64;
            format!("{} for {usual} rows ({rate_hz:.0} times a second)", signal.name())
        });
        let each: Vec<String> = each.collect();
        let most = found.values().map(|(_, usual)| *usual).max()?;
        let what = format!(
            "values stay until the next ones come, {}: the diagnosis puts straight lines between them",
            each.join(", ")
        );
        let finding = Finding::warning(FindingKind::Held, what);
        Some(finding.at(joint).decided_by(most as f64))
    });
    told.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(row: usize) -> f64 {
        let angle = (row as f64 * 0.01).sin() + 0.3 * (row as f64 * 0.037).sin();
        (angle / 1e-4).round() * 1e-4
    }

    fn recording(position_rad: Vec<f64>, torque_nm: Vec<f64>) -> Recording {
        Recording {
            time_s: (0..position_rad.len())
                .map(|row| 2e-3 * row as f64)
                .collect(),
            segment: None,
            joints: vec![JointColumns {
                name: "joint1".to_owned(),
                signals: BTreeMap::from([
                    (Signal::LinkPositionRad, position_rad),
                    (Signal::MotorTorqueNm, torque_nm),
                ]),
            }],
            sample_rate_hz: 500.0,
            metadata: BTreeMap::new(),
            truncated: false,
        }
    }

    #[test]
    fn what_is_repeated_between_rows_is_told_and_put_on_lines() {
        let held = |every: usize| (0..1200).map(|row| wave(row / every * every)).collect();
        let recording = recording(held(3), held(3));
        let found = check(&recording);
        assert_eq!(found.len(), 1);
        assert!(
            found[0].value == Some(3.0)
                && found[0]
                    .what
                    .contains("link_position_rad for 3 rows (167 times a second)"),
            "{found:?}"
        );
        let whole = without_held(&recording);
        let position_rad = &whole.joints[0].signals[&Signal::LinkPositionRad];
        let off = (0..1190).map(|row| (position_rad[row] - wave(row)).abs());
        // a wave bends by less than that within three rows, and goes forty times as far
        assert!(off.fold(0.0, f64::max) < 1e-3);
    }

    #[test]
    fn rows_that_come_slow_motion_standing_and_a_held_torque_are_none() {
        let held = |every: usize| (0..1200).map(move |row| wave(row / every * every));
        let none = |position_rad: Vec<f64>, torque_nm: Vec<f64>| {
            let recording = recording(position_rad, torque_nm);
            check(&recording).is_empty() && matches!(without_held(&recording), Cow::Borrowed(_))
        };
        assert!(none(held(1).collect(), held(1).collect()));
        // a loop may be slower than what is measured
        assert!(none(held(1).collect(), held(5).collect()));
        // a coarse encoder
        let coarse = held(1).map(|rad| (rad / 0.05).round() * 0.05);
        assert!(none(coarse.clone().collect(), held(1).collect()));
        // that is told with a rounding of its own
        let rounded = coarse
            .enumerate()
            .map(|(row, rad)| rad + 1e-9 * (row % 2) as f64);
        assert!(none(rounded.collect(), held(1).collect()));
        // a third of the samples is lost
        let lost = (0..1200).map(|row| wave(row - usize::from(row % 3 == 2)));
        assert!(none(lost.collect(), held(1).collect()));
        assert!(none(vec![0.5; 1200], vec![0.0; 1200]));
        let stands = held(3).map(|rad| 1e-5 * rad);
        assert!(none(stands.collect(), held(1).collect()));
        assert!(none(vec![f64::NAN; 1200], Vec::new()));
        assert!(none(Vec::new(), Vec::new()));
    }
}
