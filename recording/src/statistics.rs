//! Numbers about columns, missing values left out.

use nalgebra::{SMatrix, SVector};

/// Of longer columns this many neighbouring values tell step and noise.
const VALUES_LOOKED_AT: usize = 1 << 16;

/// Smallest and largest value, unless there is none.
pub(crate) fn range(values: &[f64]) -> Option<[f64; 2]> {
    let there = values.iter().copied().filter(|value| !value.is_nan());
    there.fold(None, |range, value| {
        let [low, high] = range.unwrap_or([value; 2]);
        Some([value.min(low), value.max(high)])
    })
}

/// Distance from the smallest to the largest value; 0 where there is none.
pub(crate) fn span(values: &[f64]) -> f64 {
    range(values).map_or(0.0, |[low, high]| high - low)
}

/// The value that this share of the others does not exceed.
pub(crate) fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    let index = (share * last as f64).round() as usize;
    Some(*values.select_nth_unstable_by(index, f64::total_cmp).1)
}

/// The step of which all values are multiples, up to an offset, if there is one: the resolution of an encoder or of a
/// converter, or the last digit of a text file.
///
/// Between different values in order of size, all distances are multiples of such a step. Without one they are of
/// all sizes, and a fifth of them is near a multiple of the smallest by chance.
#[must_use]
pub fn step(values: &[f64]) -> Option<f64> {
    /// Distances below this share of the largest value are rounding, also that of 32-bit numbers.
    const ROUNDING: f64 = 4e-7;
    const DISTANCES_MIN: usize = 8;
    let mut sorted: Vec<f64> = some(values);
    sorted.sort_unstable_by(f64::total_cmp);
    let largest = sorted.first()?.abs().max(sorted.last()?.abs());
    let mut distances: Vec<f64> = sorted
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .filter(|distance| *distance > ROUNDING * largest)
        .collect();
    distances.sort_unstable_by(f64::total_cmp);
    if distances.len() < DISTANCES_MIN {
        return None;
    }
    // The smallest may be an accident of rounding, one of the next is not.
    let starts = [0, distances.len() / 100, distances.len() / 20];
    starts
        .into_iter()
        .find_map(|start| common_step(&distances[start..]))
}

/// The step that nine of ten of these ascending distances are multiples of. It begins as the smallest and grows more
/// exact with every distance that fits, and so stays good for larger multiples.
fn common_step(distances: &[f64]) -> Option<f64> {
    let mut step = *distances.first()?;
    let (mut sum, mut multiples, mut fitting) = (0.0, 0.0, 0);
    for distance in distances {
        let multiple = (distance / step).round();
        if (distance / step - multiple).abs() < 0.1 {
            fitting += 1;
            sum += distance;
            multiples += multiple;
            step = sum / multiples;
        }
    }
    (fitting * 10 >= distances.len() * 9).then_some(step)
}

/// Standard deviation of what changes from value to value without the motion: of third differences, which a smooth
/// motion hardly has. Their median size, so that jumps do not count. 0 where quantisation hides it.
#[must_use]
pub fn noise_std(values: &[f64]) -> Option<f64> {
    /// Third differences of white noise have 1 + 9 + 9 + 1 times its variance.
    const VARIANCE_GROWTH: f64 = 20.0;
    /// Of a normal distribution's standard deviation to its median size.
    const STD_PER_MEDIAN: f64 = 1.4826;
    let looked_at = &values[..values.len().min(VALUES_LOOKED_AT)];
    let third = |v: &[f64]| (v[3] - 3.0 * v[2] + 3.0 * v[1] - v[0]).abs();
    let differences = looked_at.windows(4).map(third);
    let median = quantile(differences.filter(|value| !value.is_nan()).collect(), 0.5)?;
    Some(STD_PER_MEDIAN * median / VARIANCE_GROWTH.sqrt())
}

fn some(values: &[f64]) -> Vec<f64> {
    let looked_at = values.iter().take(VALUES_LOOKED_AT).copied();
    looked_at.filter(|value| !value.is_nan()).collect()
}

/// A straight line through pairs of values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    /// Geometric mean of the slopes of y on x and of x on y: noise in one does not tilt it.
    pub(crate) slope: f64,
    pub(crate) correlation: f64,
}

/// The line through all pairs of which both values are there; `None` if one of them never changes.
pub(crate) fn line(x: &[f64], y: &[f64]) -> Option<Line> {
    let pairs = || {
        x.iter()
            .zip(y)
            .filter(|(x, y)| !x.is_nan() && !y.is_nan())
            .map(|(x, y)| (*x, *y))
    };
    let count = pairs().count() as f64;
    let (x_sum, y_sum) = pairs().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x, sum.1 + y));
    let (x_mean, y_mean) = (x_sum / count, y_sum / count);
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (x, y) in pairs() {
        let (x, y) = (x - x_mean, y - y_mean);
        xx += x * x;
        yy += y * y;
        xy += x * y;
    }
    /// Of a constant column the means leave rounding.
    const ROUNDING: f64 = 1e-10;
    let changes = |squares: f64, mean: f64| squares > (ROUNDING * mean).powi(2) * count;
    if !changes(xx, x_mean) || !changes(yy, y_mean) {
        return None;
    }
    let correlation = xy / (xx * yy).sqrt();
    let slope = (yy / xx).sqrt() * correlation.signum();
    let line = Line { slope, correlation };
    (slope.is_finite() && slope != 0.0 && correlation.is_finite()).then_some(line)
}

/// A linear least-squares fit.
struct Fit<const N: usize> {
    solution: SVector<f64, N>,
    inverse: SMatrix<f64, N, N>,
    /// Squares that it leaves.
    left: f64,
}

fn fit<const N: usize>(rows: &[(SVector<f64, N>, f64)]) -> Option<Fit<N>> {
    let mut normal = SMatrix::<f64, N, N>::zeros();
    let mut right = SVector::<f64, N>::zeros();
    for (row, value) in rows {
        normal += row * row.transpose();
        right += row * *value;
    }
    let inverse = normal.try_inverse()?;
    let solution = inverse * right;
    let residual = |(row, value): &(SVector<f64, N>, f64)| (value - row.dot(&solution)).powi(2);
    Some(Fit {
        left: rows.iter().map(residual).sum(),
        solution,
        inverse,
    })
}

/// The first coefficient of a linear least-squares fit and its standard error, rows taken as independent.
pub(crate) fn first_coefficient<const N: usize>(
    rows: &[(SVector<f64, N>, f64)],
) -> Option<(f64, f64)> {
    let fit = fit(rows)?;
    let freedom = rows.len().checked_sub(N).filter(|freedom| *freedom > 0)?;
    let error = (fit.left / freedom as f64 * fit.inverse[(0, 0)]).sqrt();
    (fit.solution[0].is_finite() && error.is_finite()).then_some((fit.solution[0], error))
}

/// Part of the values' squares about their mean that a linear least-squares fit leaves.
pub(crate) fn unexplained<const N: usize>(rows: &[(SVector<f64, N>, f64)]) -> Option<f64> {
    let values = rows.iter().map(|(_, value)| *value);
    let mean = values.clone().sum::<f64>() / rows.len() as f64;
    let about_mean: f64 = values.map(|value| (value - mean).powi(2)).sum();
    let part = fit(rows)?.left / about_mean;
    part.is_finite().then_some(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform between -0.5 and 0.5, the same every time.
    fn noise(count: usize) -> Vec<f64> {
        let mut state = 1_u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..count).map(|_| next()).collect()
    }

    fn swing(count: usize) -> Vec<f64> {
        (0..count).map(|row| (row as f64 * 0.01).sin()).collect()
    }

    #[test]
    fn the_step_of_an_encoder_is_found_and_smooth_values_have_none() {
        for encoder_rad in [1.534e-3, 1.198e-5, 0.0873] {
            for offset in [0.0, 0.4 * encoder_rad] {
                let counted =
                    |value: &f64| (3.0 * value / encoder_rad).round() * encoder_rad + offset;
                let values: Vec<f64> = swing(5000).iter().map(counted).collect();
                let found = step(&values).unwrap();
                assert!((found / encoder_rad - 1.0).abs() < 1e-3, "{found}");
            }
        }
        assert_eq!(step(&swing(5000)), None);
        assert_eq!(step(&noise(5000)), None);
        assert_eq!(step(&[1.0; 50]), None);
        assert_eq!(step(&[f64::NAN; 50]), None);
    }

    #[test]
    fn noise_is_told_from_motion() {
        let std = 1e-3 / 12_f64.sqrt();
        let moving = swing(5000);
        let noisy: Vec<f64> = moving
            .iter()
            .zip(noise(5000))
            .map(|(x, n)| x + 1e-3 * n)
            .collect();
        let found = noise_std(&noisy).unwrap();
        assert!(
            (found / std - 1.0).abs() < 0.1,
            "{found} where {std} was put in"
        );
        assert!(noise_std(&moving).unwrap() < 1e-6);
        assert_eq!(noise_std(&[1.0, 2.0]), None);
    }

    #[test]
    fn a_line_is_the_same_seen_from_both_sides() {
        let x = noise(1000);
        let y: Vec<f64> = x
            .iter()
            .zip(noise(2000)[1000..].iter())
            .map(|(x, n)| -3.0 * x + n)
            .collect();
        let (there, back) = (line(&x, &y).unwrap(), line(&y, &x).unwrap());
        assert!((there.slope * back.slope - 1.0).abs() < 1e-12);
        assert_eq!(there.correlation, back.correlation);
        assert!((-4.0..-2.9).contains(&there.slope));
        assert_eq!(line(&[1.0, 1.0], &[1.0, 2.0]), None);
        assert_eq!(line(&[], &[]), None);
    }
}
