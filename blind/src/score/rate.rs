//! Rates with intervals, and means.

use serde::Serialize;

/// Two-sided 95 % of the normal distribution.
pub(super) const Z95: f64 = 1.959_964;

/// A share of cases with its 95 % interval by Wilson (J. Am. Stat. Assoc. 22 (1927) 209–212), which stays within 0 and 1
/// and is right for few cases too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rate {
    /// Cases that have it.
    pub hits: usize,
    /// Cases that might.
    pub of: usize,
    /// Their quotient; none of none is no number.
    pub rate: Option<f64>,
    /// 95 % interval.
    pub low: f64,
    /// 95 % interval.
    pub high: f64,
}

impl Rate {
    /// Of yes and no.
    pub fn of(answers: impl Iterator<Item = bool>) -> Self {
        let (mut hits, mut of) = (0, 0);
        for answer in answers {
            hits += usize::from(answer);
            of += 1;
        }
        Self::new(hits, of)
    }

    fn new(hits: usize, of: usize) -> Self {
        if of == 0 {
            return Self {
                hits,
                of,
                rate: None,
                low: 0.0,
                high: 1.0,
            };
        }
        let n = of as f64;
        let p = hits as f64 / n;
        let z2 = Z95 * Z95;
        let centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
        let half = Z95 / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
        Self {
            hits,
            of,
            rate: Some(p),
            low: (centre - half).max(0.0),
            high: (centre + half).min(1.0),
        }
    }
}

/// Median; none of nothing.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let (below, above) = ((values.len() - 1) / 2, values.len() / 2);
    Some(0.5 * (values[below] + values[above]))
}

/// Mean; none of nothing.
pub(super) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, count), x| (sum + x, count + 1));
    (count > 0).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_wilson_s() {
        // Newcombe, Statistics in Medicine 17 (1998) 857-872, Table I, method 3
        for (hits, of, low, high) in [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605)] {
            let rate = Rate::new(hits, of);
            assert!(
                (rate.low - low).abs() < 1e-4 && (rate.high - high).abs() < 1e-4,
                "{rate:?}"
            );
        }
    }

    #[test]
    fn the_interval_stays_within_nothing_and_everything() {
        assert_eq!(Rate::of([false; 20].into_iter()).low, 0.0);
        assert_eq!(Rate::of([true; 20].into_iter()).high, 1.0);
        assert_eq!(Rate::of(std::iter::empty()).rate, None);
    }

    #[test]
    fn the_median_lies_in_the_middle() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(Vec::new()), None);
    }
}
