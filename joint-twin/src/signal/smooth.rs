//! Low-pass without delay, and derivatives of what it leaves.

use joint_model::filter::{Butterworth, FilterError};

/// Order of the low-pass in each direction.
const ORDER: usize = 4;

/// Runs a low-pass forwards and backwards: no delay, twice the attenuation. Ends are continued by reflection about them.
///
/// # Errors
/// [`FilterError`] for a cut-off outside zero to half the rate.
pub fn low_pass(values: &[f64], cutoff_hz: f64, rate_hz: f64) -> Result<Vec<f64>, FilterError> {
    let mut padded = Vec::new();
    let fill = |rows: &mut [[f64; 1]]| {
        for (row, value) in rows.iter_mut().zip(values) {
            *row = [*value];
        }
    };
    let smooth = low_pass_together(&mut padded, values.len(), fill, [cutoff_hz, rate_hz])?;
    Ok(smooth.iter().map(|[value]| *value).collect())
}

/// The same for several signals at once, in little more time than for one: `fill` makes them, a row of each for each sample.
/// `padded` is room to work in, whatever was there before.
///
/// # Errors
/// [`FilterError`] for a cut-off outside zero to half the rate.
pub fn low_pass_together<const N: usize>(
    padded: &mut Vec<[f64; N]>,
    samples: usize,
    fill: impl FnOnce(&mut [[f64; N]]),
    [cutoff_hz, rate_hz]: [f64; 2],
) -> Result<&[[f64; N]], FilterError> {
    let filter = Butterworth::design(ORDER, cutoff_hz, rate_hz)?;
    let Some(last) = samples.checked_sub(1) else {
        return Ok(&[]);
    };
    let margin = ((3.0 * rate_hz / cutoff_hz) as usize).min(last);
    padded.clear();
    padded.resize(margin + samples + margin, [0.0; N]);
    fill(&mut padded[margin..=margin + last]);
    let (first, end) = (padded[margin], padded[margin + last]);
    for k in 1..=margin {
        let (early, late) = (padded[margin + k], padded[margin + last - k]);
        padded[margin - k] = std::array::from_fn(|signal| 2.0 * first[signal] - early[signal]);
        padded[margin + last + k] = std::array::from_fn(|signal| 2.0 * end[signal] - late[signal]);
    }
    let from = padded[0];
    filter.run_from(&from, padded.iter_mut());
    let from = padded[padded.len() - 1];
    filter.run_from(&from, padded.iter_mut().rev());
    Ok(&padded[margin..margin + samples])
}

/// Central differences; one-sided at the ends.
pub fn derivative(values: &[f64], period_s: f64) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
            if from == to {
                0.0
            } else {
                (values[to] - values[from]) / ((to - from) as f64 * period_s)
            }
        })
        .collect()
}

/// Second central differences; those at the ends are their neighbours'.
pub fn second_derivative(values: &[f64], period_s: f64) -> Vec<f64> {
    (0..values.len())
        .map(|k| second_difference(values, k) / period_s.powi(2))
        .collect()
}

/// Second central difference about a sample, at the ends that of the neighbour; none of fewer than three values.
pub fn second_difference(values: &[f64], k: usize) -> f64 {
    if values.len() < 3 {
        return 0.0;
    }
    let k = k.clamp(1, values.len() - 2);
    values[k + 1] - 2.0 * values[k] + values[k - 1]
}
