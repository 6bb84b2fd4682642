//! Positions that were misread: a row in which a joint would have leapt and come back.

use std::borrow::Cow;

use crate::statistics::quantile;
use crate::{Finding, FindingKind, JointColumns, Recording, Signal};

/// A joint that leaps there and back within two rows, each time so many times farther than it goes from row to row anywhere else, did
/// not. In 74 logs of 20 robots none goes farther back than elsewhere (1.0 times); serial servos' read errors are 70 times and more.
const FARTHER: f64 = 10.0;
/// Part of the rows that may be misread.
const MOST: f64 = 0.01;
/// Whose values are looked at.
const ENCODERS: [Signal; 2] = [Signal::MotorPositionRad, Signal::LinkPositionRad];

/// Rows of a position that were misread, in order.
pub(crate) fn rows(values: &[f64]) -> Vec<usize> {
    let way = |k: usize| values[k + 1] - values[k];
    let ways: Vec<f64> = (1..values.len()).map(|k| way(k - 1).abs()).collect();
    let there_and_back = |k: usize| {
        let is_back = way(k - 1) * way(k) < 0.0;
        if is_back {
            way(k - 1).abs().min(way(k).abs())
        } else {
            0.0
        }
    };
    let finite: Vec<f64> = ways.iter().copied().filter(|way| *way > 0.0).collect();
    let least = finite.iter().copied().fold(f64::INFINITY, f64::min);
    let usual = quantile(finite, 1.0 - MOST).unwrap_or(f64::INFINITY);
    let mut leaps: Vec<usize> = (1..values.len().saturating_sub(1))
        .filter(|k| there_and_back(*k) > FARTHER * least.max(usual))
        .collect();
    // what is left out is as far beyond all that stays
    loop {
        let touches = |way: usize| {
            leaps.binary_search(&way).is_ok() || leaps.binary_search(&(way + 1)).is_ok()
        };
        let others = ways
            .iter()
            .enumerate()
            .filter(|(k, way)| way.is_finite() && !touches(*k));
        let farthest = others.fold(least, |farthest, (_, way)| farthest.max(*way));
        let before = leaps.len();
        leaps.retain(|k| there_and_back(*k) > FARTHER * farthest);
        if leaps.len() == before {
            return leaps;
        }
    }
}

/// What was misread of a joint, signal by signal.
fn of_joint(joint: &JointColumns) -> impl Iterator<Item = (Signal, Vec<usize>)> {
    ENCODERS.into_iter().filter_map(|signal| {
        let rows = rows(joint.signals.get(&signal)?);
        (!rows.is_empty()).then_some((signal, rows))
    })
}

/// The recording without values in misread rows.
pub(crate) fn without_misread(recording: &Recording) -> Cow<'_, Recording> {
    let mut whole = Cow::Borrowed(recording);
    for (index, joint) in recording.joints.iter().enumerate() {
        for (signal, rows) in of_joint(joint) {
            if let Some(values) = whole.to_mut().joints[index].signals.get_mut(&signal) {
                rows.into_iter().for_each(|row| values[row] = f64::NAN);
            }
        }
    }
    whole
}

/// What was misread.
pub(crate) fn check(recording: &Recording) -> Vec<Finding> {
    let all = recording.joints.iter();
    let found = all.flat_map(|joint| of_joint(joint).map(move |of| (joint, of)));
    let told = found.map(|(joint, (signal, rows))| {
        let values = &joint.signals[&signal];
        let first = rows[0];
        let leap = (values[first] - values[first - 1]).abs();
        let many = match rows.len() {
            1 => String::new(),
            count => format!(", as {} others do", count - 1),
        };
        let what = format!(
            "was misread: row {} leaps by {leap:.2} rad and back, at {:.3} s{many}; such rows are left out",
            first + 1,
            recording.time_s[first] - recording.time_s[0],
        );
        Finding::warning(FindingKind::Misread, what)
            .at(joint)
            .of(signal)
            .decided_by(rows.len() as f64)
    });
    told.collect()
}

#[cfg(test)]
mod tests {
    use super::rows;

    fn wave(count: u32) -> Vec<f64> {
        let at = |k: u32| (1.5 * (f64::from(k) * 0.02).sin() / 1.5e-3).round() * 1.5e-3;
        (0..count).map(at).collect()
    }

    #[test]
    fn leaps_and_back_are_misread_rows() {
        let mut values = wave(600);
        assert!(rows(&values).is_empty());
        values[105] = -3.1;
        values[301] = 0.0;
        values[402] = f64::NAN;
        assert_eq!(rows(&values), [105, 301]);
    }

    #[test]
    fn steps_flicker_and_impacts_are_none() {
        // an encoder that stands between two counts
        let flickers: Vec<f64> = (0..500_u32)
            .map(|k| f64::from(u8::from(k % 97 == 5)))
            .collect();
        assert!(rows(&flickers).is_empty());
        // a new run that begins elsewhere
        let mut begins = wave(600);
        begins[300..].iter_mut().for_each(|value| *value += 2.0);
        assert!(rows(&begins).is_empty());
        // noise
        let noise: Vec<f64> = (0..2000_u32).map(|k| f64::from(k * k % 1009)).collect();
        assert!(rows(&noise).is_empty());
        assert!(rows(&[]).is_empty());
        assert!(rows(&[1.0]).is_empty());
        assert!(rows(&[f64::NAN; 5]).is_empty());
    }
}
