//! Vibration above the band that is compared. A gear that swings in its friction, because that falls with speed, rubs less than
//! the law says at its mean speed; nothing within the band shows why.

use joint_model::filter::FilterError;

use crate::smooth::{low_pass, second_derivative};

/// The vibration is sought from so many times the band's limit on, up to some frequency and part of the sample rate.
const FROM_CUTOFFS: f64 = 1.5;
const TO_HZ: f64 = 150.0;
const TO_RATE: f64 = 0.2;
/// Over which it is averaged.
const AROUND_S: f64 = 0.06;
/// So many times what it is in half of all rows is what encoder and controller make.
const USUAL: f64 = 2.0;

/// Acceleration, root mean square, beyond what is usual of this recording, sample by sample. Zero where the sample rate is too
/// low to see any.
///
/// # Errors
/// [`FilterError`] if the rate is no rate.
pub(crate) fn beyond_usual_rad_s2(
    position_rad: &[f64],
    cutoff_hz: f64,
    rate_hz: f64,
) -> Result<Vec<f64>, FilterError> {
    let (from_hz, to_hz) = (FROM_CUTOFFS * cutoff_hz, TO_HZ.min(TO_RATE * rate_hz));
    if to_hz < 2.0 * from_hz {
        return Ok(vec![0.0; position_rad.len()]);
    }
    let all = low_pass(position_rad, to_hz, rate_hz)?;
    let slow = low_pass(position_rad, from_hz, rate_hz)?;
    let fast: Vec<f64> = all
        .iter()
        .zip(&slow)
        .map(|(all, slow)| all - slow)
        .collect();
    let squares: Vec<f64> = second_derivative(&fast, 1.0 / rate_hz)
        .iter()
        .map(|x| x * x)
        .collect();
    let around = (AROUND_S * rate_hz) as usize;
    let mut sums = vec![0.0];
    for square in &squares {
        sums.push(sums[sums.len() - 1] + square);
    }
    let mean_squares: Vec<f64> = (0..squares.len())
        .map(|k| {
            let (from, to) = (
                k.saturating_sub(around),
                (k + around + 1).min(squares.len()),
            );
            (sums[to] - sums[from]).max(0.0) / (to - from) as f64
        })
        .collect();
    let mut sorted = mean_squares.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = USUAL.powi(2) * sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let beyond = mean_squares
        .iter()
        .map(|square| (square - usual).max(0.0).sqrt());
    Ok(beyond.collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn a_gear_that_swings_for_a_while_is_seen_there_and_nowhere_else() {
        let position_rad: Vec<f64> = (0..15_000)
            .map(|k| {
                let time_s = f64::from(k) / 1500.0;
                let swing = 1e-4 * (std::f64::consts::TAU * 58.0 * time_s).sin();
                let noise = 1e-6 * f64::from(k * 7919 % 101) / 101.0;
                let swings = (3.0..4.0).contains(&time_s);
                (0.5 * time_s).sin() + noise + if swings { swing } else { 0.0 }
            })
            .collect();
        let beyond = beyond_usual_rad_s2(&position_rad, 15.0, 1500.0).unwrap();
        let expected = 1e-4 * (std::f64::consts::TAU * 58.0_f64).powi(2) / 2.0_f64.sqrt();
        assert!(
            (beyond[5250] / expected - 1.0).abs() < 0.1,
            "{}",
            beyond[5250]
        );
        assert!(beyond[3000] < 0.01 * expected && beyond[12_000] < 0.01 * expected);
        assert_eq!(
            beyond_usual_rad_s2(&position_rad, 15.0, 100.0).unwrap()[5250],
            0.0
        );
    }
}
