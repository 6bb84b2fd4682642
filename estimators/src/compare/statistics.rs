//! What is said about a series of errors.

use serde::Serialize;

/// Errors of many rows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Rows.
    pub rows: usize,
    /// Mean with its sign.
    pub average_nm: f64,
    /// Root mean square.
    pub rms_nm: f64,
    /// Largest magnitude.
    pub max_nm: f64,
    /// Magnitude that one row in twenty exceeds.
    pub p95_nm: f64,
}

impl Errors {
    /// Of all that are numbers; none if there are none.
    pub fn of(errors: impl Iterator<Item = f64>) -> Option<Self> {
        let errors: Vec<f64> = errors.filter(|error| error.is_finite()).collect();
        if errors.is_empty() {
            return None;
        }
        let count = errors.len() as f64;
        let mut sizes: Vec<f64> = errors.iter().map(|error| error.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        Some(Self {
            rows: errors.len(),
            average_nm: errors.iter().sum::<f64>() / count,
            rms_nm: (errors.iter().map(|error| error * error).sum::<f64>() / count).sqrt(),
            max_nm: sizes[sizes.len() - 1],
            p95_nm: sizes[(sizes.len() * 19 / 20).min(sizes.len() - 1)],
        })
    }
}

/// How an error changed while the joint was held.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Drift {
    /// Error over the last second less that over the first.
    pub change_nm: f64,
    /// Between the middles of the two seconds.
    pub over_s: f64,
}

/// The length of the means at both ends.
const END_S: f64 = 1.0;
/// A minute is meant; a shorter hold says something from this on.
const HOLD_MIN_S: f64 = 5.0;

impl Drift {
    pub(super) fn over(errors: &[f64], time_s: &[f64]) -> Option<Self> {
        let (begin_s, end_s) = (*time_s.first()?, *time_s.last()?);
        if end_s - begin_s < HOLD_MIN_S {
            return None;
        }
        let mean = |from_s: f64, to_s: f64| {
            let rows = errors.iter().zip(time_s);
            let within: Vec<f64> = rows
                .filter(|(error, time_s)| error.is_finite() && (from_s..=to_s).contains(*time_s))
                .map(|(error, _)| *error)
                .collect();
            (!within.is_empty()).then(|| within.iter().sum::<f64>() / within.len() as f64)
        };
        Some(Self {
            change_nm: mean(end_s - END_S, end_s)? - mean(begin_s, begin_s + END_S)?,
            over_s: end_s - begin_s - END_S,
        })
    }
}

/// Standard deviation from sample to sample: second differences, which a slow change leaves alone, over the root of six.
pub(super) fn noise(values: &[f64], rows: &[usize]) -> Option<f64> {
    let squares: Vec<f64> = rows
        .windows(3)
        .filter(|rows| rows[2] == rows[0] + 2)
        .map(|rows| (values[rows[0]] - 2.0 * values[rows[1]] + values[rows[2]]).powi(2) / 6.0)
        .filter(|square| square.is_finite())
        .collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// Rows by which `values` lag behind `reference`, where they are most alike, to a fraction of a row; none if they become more
/// alike up to the end of the search.
pub(super) fn lag_rows(values: &[f64], reference: &[f64], rows: &[usize]) -> Option<f64> {
    const LAGS: std::ops::RangeInclusive<i64> = -15..=60;
    let alike: Vec<f64> = LAGS
        .map(|lag| correlation(values, reference, rows, lag))
        .collect::<Option<_>>()?;
    let best = (0..alike.len()).max_by(|a, b| alike[*a].total_cmp(&alike[*b]))?;
    let whole = (best as i64 + LAGS.start()) as f64;
    let (before, after) = (alike[best.checked_sub(1)?], alike.get(best + 1)?);
    // the top of the parabola through three points
    let bend = before - 2.0 * alike[best] + after;
    Some(if bend < 0.0 {
        whole + 0.5 * (before - after) / bend
    } else {
        whole
    })
}

fn correlation(values: &[f64], reference: &[f64], rows: &[usize], lag: i64) -> Option<f64> {
    let pairs = || {
        rows.iter().filter_map(move |row| {
            let later = usize::try_from(*row as i64 + lag).ok()?;
            let pair = (*values.get(later)?, reference[*row]);
            (pair.0 + pair.1).is_finite().then_some(pair)
        })
    };
    let count = pairs().count() as f64;
    if count < 2.0 {
        return None;
    }
    let mean_a = pairs().map(|(a, _)| a).sum::<f64>() / count;
    let mean_b = pairs().map(|(_, b)| b).sum::<f64>() / count;
    let [ab, aa, bb] = pairs().fold([0.0; 3], |[ab, aa, bb], (a, b)| {
        let (a, b) = (a - mean_a, b - mean_b);
        [ab + a * b, aa + a * a, bb + b * b]
    });
    (aa > 0.0 && bb > 0.0).then(|| ab / (aa * bb).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_known_errors() {
        let errors = (1..=100).map(|k| {
            if k % 2 == 0 {
                f64::from(k)
            } else {
                -f64::from(k)
            }
        });
        let found = Errors::of(errors.chain([f64::NAN])).unwrap();
        assert_eq!((found.rows, found.max_nm, found.p95_nm), (100, 100.0, 96.0));
        assert!((found.average_nm - 0.5).abs() < 1e-12);
        assert!((found.rms_nm - 3383.5_f64.sqrt()).abs() < 1e-9);
        assert_eq!(Errors::of([f64::NAN].into_iter()), None);
    }

    #[test]
    fn a_delay_is_found_to_a_fraction_of_a_row() {
        let wave = |row: f64| (0.03 * row).sin() + 0.4 * (0.011 * row).cos();
        let reference: Vec<f64> = (0..4000).map(|row| wave(f64::from(row))).collect();
        let values: Vec<f64> = (0..4000)
            .map(|row| 2.0 * wave(f64::from(row) - 7.3))
            .collect();
        let rows: Vec<usize> = (100..3900).collect();
        let lag = lag_rows(&values, &reference, &rows).unwrap();
        assert!((lag - 7.3).abs() < 0.05, "{lag}");
        let late: Vec<f64> = (0..4000).map(|row| wave(f64::from(row) - 70.0)).collect();
        assert_eq!(lag_rows(&late, &reference, &rows), None);
    }

    #[test]
    fn drift_and_noise_are_told_apart() {
        let time_s: Vec<f64> = (0..60_000).map(|row| f64::from(row) * 1e-3).collect();
        let errors: Vec<f64> = time_s
            .iter()
            .enumerate()
            .map(|(row, time_s)| 0.01 * time_s + if row % 2 == 0 { 0.1 } else { -0.1 })
            .collect();
        let drift = Drift::over(&errors, &time_s).unwrap();
        assert!((drift.change_nm / drift.over_s - 0.01).abs() < 1e-5);
        let rows: Vec<usize> = (0..errors.len()).collect();
        // an alternation of ±a has second differences of 4 a
        assert!((noise(&errors, &rows).unwrap() - 0.4 / 6.0_f64.sqrt()).abs() < 1e-9);
    }
}
