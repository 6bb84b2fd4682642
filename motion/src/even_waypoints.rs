//! A joint's waypoints at even times: a cubic spline with continuous acceleration, at rest at both ends.

use crate::spline;

/// A spline that holds its last point.
#[derive(Clone, Debug)]
pub struct EvenWaypoints {
    times_s: Vec<f64>,
    positions_rad: Vec<f64>,
    curvatures_rad_s2: Vec<f64>,
}

impl EvenWaypoints {
    /// Through at least two positions, `step_s` apart; none from fewer.
    pub fn new(positions_rad: &[f64], step_s: f64) -> Option<Self> {
        let times_s: Vec<f64> = (0..positions_rad.len())
            .map(|k| k as f64 * step_s)
            .collect();
        (times_s.len() >= 2).then(|| Self {
            curvatures_rad_s2: spline::curvatures(&times_s, positions_rad, [0.0; 2]),
            positions_rad: positions_rad.to_vec(),
            times_s,
        })
    }

    /// Time of the last waypoint.
    pub fn duration_s(&self) -> f64 {
        self.times_s[self.times_s.len() - 1]
    }

    /// Position, velocity and acceleration.
    pub fn sample(&self, time_s: f64) -> [f64; 3] {
        let last = self.times_s.len() - 1;
        if time_s >= self.duration_s() {
            return [self.positions_rad[last], 0.0, 0.0];
        }
        let after = self.times_s.partition_point(|at_s| *at_s <= time_s);
        spline::sample(
            &self.times_s,
            &self.positions_rad,
            &self.curvatures_rad_s2,
            after.saturating_sub(1).min(last - 1),
            time_s,
        )
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn runs_through_its_points_and_rests_at_both_ends() {
        let path = EvenWaypoints::new(&[0.1, 0.3, 0.2], 0.5).unwrap();
        assert_eq!(path.duration_s(), 1.0);
        let at = |time_s: f64| path.sample(time_s);
        assert!((at(0.5)[0] - 0.3).abs() < 1e-12);
        assert!((at(0.0)[0] - 0.1).abs() < 1e-12 && at(0.0)[1].abs() < 1e-12);
        assert!(at(1.0 - 1e-9)[1].abs() < 1e-6);
        assert_eq!(at(7.0), [0.2, 0.0, 0.0]);
        assert!(EvenWaypoints::new(&[0.1], 0.5).is_none());
    }
}
