//! Low-pass without delay, and derivatives of what it leaves.

use joint_model::filter::{Butterworth, FilterError};

/// Order of the low-pass in each direction.
const ORDER: usize = 4;

/// Runs a low-pass forwards and backwards: no delay, twice the attenuation. Ends are continued by reflection about them.
///
/// # Errors
/// [`FilterError`] for a cut-off outside zero to half the rate.
pub fn low_pass(values: &[f64], cutoff_hz: f64, rate_hz: f64) -> Result<Vec<f64>, FilterError> {
    let mut filter = Butterworth::design(ORDER, cutoff_hz, rate_hz)?;
    let (Some(&first), Some(&last)) = (values.first(), values.last()) else {
        return Ok(Vec::new());
    };
    let margin = ((3.0 * rate_hz / cutoff_hz) as usize).min(values.len() - 1);
    let before = (1..=margin).rev().map(|k| 2.0 * first - values[k]);
    let after = (1..=margin).map(|k| 2.0 * last - values[values.len() - 1 - k]);
    let mut padded: Vec<f64> = before.chain(values.iter().copied()).chain(after).collect();
    filter.reset(padded[0]);
    filter.run(padded.iter_mut());
    filter.reset(padded[padded.len() - 1]);
    filter.run(padded.iter_mut().rev());
    Ok(padded[margin..margin + values.len()].to_vec())
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
    let count = values.len();
    if count < 3 {
        return vec![0.0; count];
    }
    (0..count)
        .map(|k| {
            let k = k.clamp(1, count - 2);
            (values[k + 1] - 2.0 * values[k] + values[k - 1]) / period_s.powi(2)
        })
        .collect()
}
