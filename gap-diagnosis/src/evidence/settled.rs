//! How many rows of what the best set leaves are independent, and how large it is: the yardstick of every set.

use super::sums::dot;
use super::{Evidence, Names, Scored};

/// Correlation below which rows count as independent.
const INDEPENDENT: f64 = 0.05;
/// Rows that are independent at least.
pub(super) const ROWS_LEAST: f64 = 10.0;

/// What the best set leaves of a signal.
#[derive(Clone, Copy, Debug)]
pub struct Settled {
    /// Rows that are as good as independent.
    pub independent_rows: f64,
    /// Mean square, the floor included.
    pub variance: f64,
    /// Mean square that is nobody's: the floor's, and what no law is exact by.
    pub floor: f64,
}

impl Evidence {
    /// Finds how many rows are independent: by what the best set leaves, which depends on how much the file's values may give, which
    /// depends on that.
    pub(super) fn settle(&mut self) {
        /// Rounds until the number of independent rows stays, on all of the development robots.
        const ROUNDS: usize = 2;
        for _ in 0..ROUNDS {
            self.eliminate();
            let best = self.sets().into_iter().max_by(|a, b| {
                let fitted = |set: &Scored| set.score + self.cost(set.names);
                fitted(a).total_cmp(&fitted(b))
            });
            let Some(best) = best else { return };
            self.settle_by(best.names);
        }
        self.eliminate();
    }

    fn settle_by(&mut self, names: Names) {
        let fit = self.fit(names);
        let rest: Vec<f64> = self
            .gap_nm
            .iter()
            .zip(&fit.predicted_nm)
            .map(|(gap, predicted)| gap - predicted)
            .collect();
        let left = self.left(names);
        let without = self.left(0);
        self.settled = self
            .spans
            .iter()
            .enumerate()
            .map(|(index, span)| {
                let [mean, before] = [&left, &without].map(|of| {
                    let square: f64 = of.iter().map(|part| part[index]).sum();
                    square / span.rows.len().max(1) as f64
                });
                let inexact = self.inexact.powi(2) * (before - mean).max(0.0);
                let floor = span.floor_nm.powi(2) + inexact;
                Settled {
                    independent_rows: independent_rows(&rest[span.rows.clone()]),
                    variance: (mean + floor).max(f64::MIN_POSITIVE),
                    floor,
                }
            })
            .collect();
    }
}

/// Rows that are as good as independent, from the correlation of a signal with itself: `n / (1 + 2 Σ ρ)` up to where it dies away.
pub fn independent_rows(signal: &[f64]) -> f64 {
    let rows = signal.len();
    if rows < 2 {
        return ROWS_LEAST;
    }
    let mean = signal.iter().sum::<f64>() / rows as f64;
    let centred: Vec<f64> = signal.iter().map(|x| x - mean).collect();
    let square = dot(&centred, &centred).max(f64::MIN_POSITIVE);
    let mut sum = 1.0;
    for lag in 1..rows / 3 {
        let correlation = dot(&centred[..rows - lag], &centred[lag..]) / square;
        if correlation < INDEPENDENT {
            break;
        }
        sum += 2.0 * correlation;
    }
    (rows as f64 / sum).max(ROWS_LEAST)
}
