//! The look-up table that is fed forward.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use robot::FrictionTable;

use super::PeriodicAnalysis;
use super::spectrum::kept;

impl PeriodicAnalysis {
    /// Zero-mean friction over the motor angle for a robot file: `points` values at `2π·i/points` in each direction.
    ///
    /// The mean over revolutions, without cycles that `points` are too few for: more than half as many.
    #[must_use]
    pub fn friction_table(&self, points: usize) -> FrictionTable {
        FrictionTable {
            positive_nm: resampled(&self.positive.mean_revolution_nm, points),
            negative_nm: resampled(&self.negative.mean_revolution_nm, points),
        }
    }
}

/// One period at other points, by its Fourier series without the constant term. Cycles that the mean over a point's
/// rows has weakened are restored.
fn resampled(period: &[f64], points: usize) -> Vec<f64> {
    let mut resampled = vec![0.0; points];
    if points == 0 || period.is_empty() {
        return resampled;
    }
    let mut planner = RealFftPlanner::new();
    let forward = planner.plan_fft_forward(period.len());
    let mut spectrum = forward.make_output_vec();
    let inverse = planner.plan_fft_inverse(points);
    let mut lines = inverse.make_input_vec();
    let transformed = forward.process(&mut period.to_vec(), &mut spectrum);
    let cycles_max = (points.min(period.len()) - 1) / 2;
    for cycles in 1..=cycles_max {
        lines[cycles] =
            spectrum[cycles] / (kept(cycles as f64, period.len()) * period.len() as f64);
    }
    lines[0] = Complex::default();
    // Both only fail for buffers of the wrong length, and these are the planner's own.
    debug_assert!(transformed.is_ok());
    let inverted = inverse.process(&mut lines, &mut resampled);
    debug_assert!(inverted.is_ok());
    resampled
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn law(angle_rad: f64) -> f64 {
        2.0 * (2.0 * angle_rad + 0.3).sin() - 0.5 * (5.0 * angle_rad).cos()
    }

    fn at(points: usize, law: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..points)
            .map(|i| law(TAU * i as f64 / points as f64))
            .collect()
    }

    #[test]
    fn any_number_of_points_samples_the_same_curve() {
        // What averaging over a point's width leaves of the law.
        let averaged = at(64, |angle| {
            2.0 * kept(2.0, 64) * (2.0 * angle + 0.3).sin()
                - 0.5 * kept(5.0, 64) * (5.0 * angle).cos()
        });
        for points in [11, 12, 64, 360, 1000] {
            for (found, expected) in resampled(&averaged, points).iter().zip(at(points, law)) {
                assert!((found - expected).abs() < 1e-12, "{points} points");
            }
        }
    }

    #[test]
    fn has_no_mean_and_no_cycles_beyond_half_the_points() {
        let period = at(64, |angle| 7.0 + (3.0 * angle).sin());
        let table = resampled(&period, 5);
        assert!(table.iter().all(|value| value.abs() < 1e-12));
        assert!(resampled(&period, 0).is_empty());
        assert_eq!(resampled(&period, 1), [0.0]);
    }
}
