//! Cubic spline through waypoints: continuous acceleration, told slopes at both ends ("clamped").

/// Curvatures of the spline through `values` at `times`, ascending, at least two of each.
///
/// Solves the tridiagonal system of the clamped cubic spline with these end slopes (de Boor, A Practical Guide to
/// Splines, chapter IV) by elimination.
pub fn curvatures(times: &[f64], values: &[f64], end_slopes: [f64; 2]) -> Vec<f64> {
    let last = times.len() - 1;
    let width = |i: usize| times[i + 1] - times[i];
    let slope = |i: usize| (values[i + 1] - values[i]) / width(i);
    // Row i: below·m[i-1] + middle·m[i] + above·m[i+1] = right.
    let row = |i: usize| {
        let below = if i > 0 { width(i - 1) } else { 0.0 };
        let above = if i < last { width(i) } else { 0.0 };
        let slope_before = if i > 0 { slope(i - 1) } else { end_slopes[0] };
        let slope_after = if i < last { slope(i) } else { end_slopes[1] };
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
        let curvatures = curvatures(&TIMES, &VALUES, [0.0; 2]);
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
        let curvatures = curvatures(&TIMES, &VALUES, [0.0; 2]);
        assert!(sample(&TIMES, &VALUES, &curvatures, 0, 0.0)[1].abs() < 1e-12);
        assert!(sample(&TIMES, &VALUES, &curvatures, 3, 4.0)[1].abs() < 1e-12);
    }

    #[test]
    fn a_cubic_with_its_own_end_slopes_is_met_exactly() {
        let cubic = |t: f64| 0.3 - t + 0.5 * t * t - 0.2 * t.powi(3);
        let slope = |t: f64| -1.0 + t - 0.6 * t * t;
        let values = TIMES.map(cubic);
        let curvatures = curvatures(&TIMES, &values, [slope(TIMES[0]), slope(TIMES[4])]);
        for (left, time) in [(0, 0.2), (1, 1.0), (2, 1.3), (3, 3.9)] {
            let [position, velocity, acceleration] =
                sample(&TIMES, &values, &curvatures, left, time);
            assert!((position - cubic(time)).abs() < 1e-12);
            assert!((velocity - slope(time)).abs() < 1e-12);
            assert!((acceleration - (1.0 - 1.2 * time)).abs() < 1e-12);
        }
    }

    #[test]
    fn two_points_make_the_cubic_from_rest_to_rest() {
        let (times, values) = ([0.0, 2.0], [0.0, 1.0]);
        let curvatures = curvatures(&times, &values, [0.0; 2]);
        assert!(
            (sample(&times, &values, &curvatures, 0, 0.5)[0] - (3.0 * 0.0625 - 2.0 * 0.015625))
                .abs()
                < 1e-12
        );
    }
}
