//! What the fits of this crate say of their uncertainty.

use serde::Serialize;

/// A fitted value and its standard error, in the value's unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// One standard deviation of what the value would scatter by if the measurement were repeated.
    pub standard_error: f64,
}

/// Root mean square; zero of nothing.
pub(crate) fn root_mean_square(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values
        .into_iter()
        .fold((0.0, 0_usize), |(sum, count), value| {
            (sum + value * value, count + 1)
        });
    if count == 0 {
        return 0.0;
    }
    (sum / count as f64).sqrt()
}

/// Over how many successive samples a residual persists: `1 + 2·Σ ρ_k`, at least 1, so that `n` samples tell as much as
/// `n` over this many independent ones.
///
/// The sum of autocorrelations ends before the first that is not positive, and at a quarter of the samples, beyond which
/// they are mostly noise (the initial positive sequence of Geyer, Statistical Science 7 (1992) 473-483, by single lags).
/// A residual that swings about zero therefore counts as more persistent than it is.
pub(crate) fn correlated_samples(residuals: &[f64]) -> f64 {
    let power: f64 = residuals.iter().map(|residual| residual * residual).sum();
    if !power.is_normal() {
        return 1.0;
    }
    let autocorrelation = |lag: usize| {
        let pairs = residuals.iter().zip(&residuals[lag..]);
        pairs.map(|(a, b)| a * b).sum::<f64>() / power
    };
    let positive: f64 = (1..residuals.len() / 4)
        .map(autocorrelation)
        .take_while(|correlation| *correlation > 0.0)
        .sum();
    1.0 + 2.0 * positive
}

#[cfg(test)]
mod tests {
    use rand_core::{RngCore, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    fn white(count: usize) -> Vec<f64> {
        let mut random = Pcg64::seed_from_u64(1);
        (0..count)
            .map(|_| f64::from(random.next_u32()) / f64::from(u32::MAX) - 0.5)
            .collect()
    }

    #[test]
    fn samples_held_k_times_count_once() {
        assert!(correlated_samples(&white(4000)) < 1.2);
        let held: Vec<f64> = white(2000).into_iter().flat_map(|x| [x; 8]).collect();
        let found = correlated_samples(&held);
        assert!((7.0..9.5).contains(&found), "{found}");
    }

    #[test]
    fn nothing_and_zeros_persist_for_one_sample() {
        assert_eq!(correlated_samples(&[]), 1.0);
        assert_eq!(correlated_samples(&[0.0; 50]), 1.0);
        assert_eq!(root_mean_square([]), 0.0);
        assert_eq!(root_mean_square([3.0, -3.0]), 3.0);
    }
}
