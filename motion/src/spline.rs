//! Cubic spline through waypoints: continuous acceleration, at rest at both ends ("clamped").

/// Curvatures of the spline through `values` at `times`, ascending, at least two of each.
///
/// Solves the tridiagonal system of the clamped cubic spline with zero end slopes (de Boor, A Practical Guide to
/// Splines, chapter IV) by elimination.
pub fn curvatures(times: &[f64], values: &[f64]) -> Vec<f64> {
    let last = times.len() - 1;
    let width = |i: usize| times[i + 1] - times[i];
    let slope = |i: usize| (values[i + 1] - values[i]) / width(i);
    // Row i: below·m[i-1] + middle·m[i] + above·m[i+1] = right.
    let row = |i: usize| {
        let below = if i > 0 { width(i - 1) } else { 0.0 };
        let above = if i < last { width(i) } else { 0.0 };
        let slope_before = if i > 0 { slope(i - 1) } else { 0.0 };
        let slope_after = if i < last { slope(i) } else { 0.0 };
        (
            below,
            2.0 * (below + above),
            above,
            6.0 * (slope_after - slope_before),
        )
    };
    let mut above_reduced = vec![0.0; times.len()];
    let mut result = vec![0.0; times.len()];
    for i in 0..=last {
        let (below, middle, above, right) = row(i);
        let (above_before, right_before) = if i > 0 {
            (above_reduced[i - 1], result[i - 1])
        } else {
            (0.0, 0.0)
        };
        let pivot = middle - below * above_before;
        above_reduced[i] = above / pivot;
        result[i] = (right - below * right_before) / pivot;
    }
    for i in (0..last).rev() {
        result[i] -= above_reduced[i] * result[i + 1];
    }
    result
}

/// Position, velocity and acceleration between the waypoints `left` and `left + 1`.
pub fn sample(
    times: &[f64],
    values: &[f64],
    curvatures: &[f64],
    left: usize,
    time: f64,
) -> [f64; 3] {
    let width = times[left + 1] - times[left];
    let (a, b) = (
        (times[left + 1] - time) / width,
        (time - times[left]) / width,
    );
    let (from, to) = (curvatures[left], curvatures[left + 1]);
    [
        a * values[left]
            + b * values[left + 1]
            + ((a.powi(3) - a) * from + (b.powi(3) - b) * to) * width * width / 6.0,
        (values[left + 1] - values[left]) / width
            + ((3.0 * b * b - 1.0) * to - (3.0 * a * a - 1.0) * from) * width / 6.0,
        a * from + b * to,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMES: [f64; 5] = [0.0, 0.5, 1.2, 2.0, 4.0];
    const VALUES: [f64; 5] = [0.1, -0.3, 0.4, 0.4, 1.0];

    #[test]
    fn passes_through_the_waypoints_with_continuous_acceleration() {
        let curvatures = curvatures(&TIMES, &VALUES);
        for i in 0..4 {
            assert!(
                (sample(&TIMES, &VALUES, &curvatures, i, TIMES[i])[0] - VALUES[i]).abs() < 1e-12
            );
            assert!(
                (sample(&TIMES, &VALUES, &curvatures, i, TIMES[i + 1])[0] - VALUES[i + 1]).abs()
                    < 1e-12
            );
        }
        for (i, time) in TIMES.into_iter().enumerate().skip(1).take(3) {
            let before = sample(&TIMES, &VALUES, &curvatures, i - 1, time);
            let after = sample(&TIMES, &VALUES, &curvatures, i, time);
            assert!((before[1] - after[1]).abs() < 1e-12 && (before[2] - after[2]).abs() < 1e-12);
        }
    }

    #[test]
    fn rests_at_both_ends() {
        let curvatures = curvatures(&TIMES, &VALUES);
        assert!(sample(&TIMES, &VALUES, &curvatures, 0, 0.0)[1].abs() < 1e-12);
        assert!(sample(&TIMES, &VALUES, &curvatures, 3, 4.0)[1].abs() < 1e-12);
    }

    #[test]
    fn two_points_make_the_cubic_from_rest_to_rest() {
        let (times, values) = ([0.0, 2.0], [0.0, 1.0]);
        let curvatures = curvatures(&times, &values);
        assert!(
            (sample(&times, &values, &curvatures, 0, 0.5)[0] - (3.0 * 0.0625 - 2.0 * 0.015625))
                .abs()
                < 1e-12
        );
    }
}
