//! Histograms of times in nanoseconds: quantiles in microseconds, ratios with their range, files for HdrHistogram's tools.

use std::fs;
use std::path::Path;

use hdrhistogram::Histogram;

pub type Times = Histogram<u64>;

/// Half, 99 in 100, 999 in 1000.
pub const QUANTILES: [f64; 3] = [0.5, 0.99, 0.999];

/// Up to 10 s.
pub fn empty() -> Times {
    Histogram::new_with_bounds(1, 10_000_000_000, 3).expect("the bounds are in range")
}

/// [`QUANTILES`] in microseconds.
pub fn quantiles_us(times: &Times) -> [f64; 3] {
    QUANTILES.map(|quantile| times.value_at_quantile(quantile) as f64 * 1e-3)
}

/// Median of some numbers, with the least and the largest.
#[derive(Clone, Copy)]
pub struct Spread {
    pub median: f64,
    pub least: f64,
    pub largest: f64,
}

impl Spread {
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        let at = |index: usize| values.get(index).copied().unwrap_or(f64::NAN);
        Self {
            median: (at((values.len().max(1) - 1) / 2) + at(values.len() / 2)) / 2.0,
            least: at(0),
            largest: at(values.len().saturating_sub(1)),
        }
    }

    /// `median (least to largest)`.
    pub fn cell(&self, decimals: usize) -> String {
        format!(
            "{:.decimals$} ({:.decimals$} to {:.decimals$})",
            self.median, self.least, self.largest
        )
    }
}

/// For each quantile, its spread over rounds.
pub fn spreads(rounds: &[[f64; 3]]) -> [Spread; 3] {
    [0, 1, 2].map(|index| Spread::of(rounds.iter().map(|round| round[index])))
}

/// Spreads as cells of a table.
pub fn cells(rounds: &[[f64; 3]], decimals: usize) -> String {
    spreads(rounds)
        .map(|spread| spread.cell(decimals))
        .join(" | ")
}

/// Round by round, one over the other.
pub fn ratios(above: &[[f64; 3]], below: &[[f64; 3]]) -> Vec<[f64; 3]> {
    above
        .iter()
        .zip(below)
        .map(|(above, below)| [0, 1, 2].map(|index| above[index] / below[index]))
        .collect()
}

/// HdrHistogram's table of percentiles, in microseconds.
pub fn write_hgrm(path: &Path, times: &Times) {
    let mut text = String::from("       Value     Percentile TotalCount 1/(1-Percentile)\n\n");
    for step in times.iter_quantiles(5) {
        let quantile = step.quantile_iterated_to();
        let count = times.count_between(0, step.value_iterated_to());
        let value_us = step.value_iterated_to() as f64 * 1e-3;
        text += &match quantile < 1.0 {
            true => format!(
                "{value_us:12.3} {quantile:2.12} {count:10} {:14.2}\n",
                1.0 / (1.0 - quantile)
            ),
            false => format!("{value_us:12.3} {quantile:2.12} {count:10}            inf\n"),
        };
    }
    text += &format!(
        "#[Mean    = {:12.3}, StdDeviation   = {:12.3}]\n#[Max     = {:12.3}, Total count    = {:12}]\n",
        times.mean() * 1e-3,
        times.stdev() * 1e-3,
        times.max() as f64 * 1e-3,
        times.len()
    );
    fs::write(path, text).expect("the folder is ours");
}
