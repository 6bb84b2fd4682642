//! A move with trapezoidal velocity: constant acceleration, constant velocity, constant deceleration.

/// One move from rest to rest, once, or there and back for ever.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trapezoid {
    start_rad: f64,
    /// +1 or -1.
    direction: f64,
    distance_rad: f64,
    acceleration_rad_s2: f64,
    ramp_s: f64,
    cruise_s: f64,
    /// Rest after each move where the motion repeats.
    dwell_s: Option<f64>,
}

impl Trapezoid {
    /// A move by `distance_rad` (its sign is the direction). Where the distance is too short to reach the speed, the
    /// move is a triangle. `dwell_s` makes it repeat there and back, resting that long at either end.
    pub fn new(
        start_rad: f64,
        distance_rad: f64,
        speed_rad_s: f64,
        acceleration_rad_s2: f64,
        dwell_s: Option<f64>,
    ) -> Self {
        let length_rad = distance_rad.abs();
        let ramp_s =
            (speed_rad_s / acceleration_rad_s2).min((length_rad / acceleration_rad_s2).sqrt());
        let cruise_rad = length_rad - acceleration_rad_s2 * ramp_s * ramp_s;
        let peak_rad_s = acceleration_rad_s2 * ramp_s;
        let cruise_s = if peak_rad_s > 0.0 {
            cruise_rad.max(0.0) / peak_rad_s
        } else {
            0.0
        };
        let direction = distance_rad.signum();
        Self {
            start_rad,
            direction,
            distance_rad: length_rad,
            acceleration_rad_s2,
            ramp_s,
            cruise_s,
            dwell_s,
        }
    }

    /// Time from rest to rest.
    pub fn move_s(&self) -> f64 {
        2.0 * self.ramp_s + self.cruise_s
    }

    /// One round where the motion repeats.
    pub fn period_s(&self) -> Option<f64> {
        self.dwell_s.map(|dwell_s| 2.0 * (self.move_s() + dwell_s))
    }

    /// Position, velocity and acceleration.
    pub fn sample(&self, time_s: f64) -> [f64; 3] {
        let [covered_rad, speed_rad_s, acceleration_rad_s2] =
            match self.period_s().zip(self.dwell_s) {
                None => self.along(time_s),
                Some((period_s, dwell_s)) => {
                    let in_round_s = time_s.rem_euclid(period_s);
                    let back_s = in_round_s - self.move_s() - dwell_s;
                    if back_s < 0.0 {
                        self.along(in_round_s)
                    } else {
                        let [covered_rad, speed_rad_s, acceleration_rad_s2] = self.along(back_s);
                        [
                            self.distance_rad - covered_rad,
                            -speed_rad_s,
                            -acceleration_rad_s2,
                        ]
                    }
                }
            };
        let sign = self.direction;
        [
            self.start_rad + sign * covered_rad,
            sign * speed_rad_s,
            sign * acceleration_rad_s2,
        ]
    }

    fn along(&self, time_s: f64) -> [f64; 3] {
        let (a, ramp_s) = (self.acceleration_rad_s2, self.ramp_s);
        let left_s = self.move_s() - time_s;
        if time_s <= 0.0 {
            [0.0; 3]
        } else if left_s <= 0.0 {
            [self.distance_rad, 0.0, 0.0]
        } else if time_s < ramp_s {
            [a * time_s * time_s / 2.0, a * time_s, a]
        } else if left_s < ramp_s {
            [
                self.distance_rad - a * left_s * left_s / 2.0,
                a * left_s,
                -a,
            ]
        } else {
            [a * ramp_s * (time_s - ramp_s / 2.0), a * ramp_s, 0.0]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn assert_near(found: [f64; 3], expected: [f64; 3]) {
        let near = found
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(near, "{found:?} is not {expected:?}");
    }

    #[test]
    fn covers_the_distance_at_the_speed() {
        let trapezoid = Trapezoid::new(-0.5, 1.0, 0.1, 1.0, None);
        assert!((trapezoid.move_s() - 10.1).abs() < 1e-12);
        assert_near(trapezoid.sample(0.0), [-0.5, 0.0, 0.0]);
        assert_near(trapezoid.sample(5.05), [0.0, 0.1, 0.0]);
        assert_near(trapezoid.sample(0.05), [-0.49875, 0.05, 1.0]);
        assert_near(trapezoid.sample(99.0), [0.5, 0.0, 0.0]);
    }

    #[test]
    fn short_moves_are_triangles_and_no_move_rests() {
        let triangle = Trapezoid::new(0.0, -0.01, 1.0, 1.0, None);
        assert_near(triangle.sample(0.05), [-0.00125, -0.05, -1.0]);
        assert_near(triangle.sample(0.15), [-0.00875, -0.05, 1.0]);
        assert_near(triangle.sample(1.0), [-0.01, 0.0, 0.0]);
        assert_near(
            Trapezoid::new(0.2, 0.0, 1.0, 1.0, None).sample(0.5),
            [0.2, 0.0, 0.0],
        );
    }

    #[test]
    fn repeats_there_and_back() {
        let trapezoid = Trapezoid::new(0.0, 1.0, 0.5, 1.0, Some(0.25));
        let period_s = 2.0 * (2.5 + 0.25);
        assert_eq!(trapezoid.period_s(), Some(period_s));
        assert_near(trapezoid.sample(2.6), [1.0, 0.0, 0.0]);
        assert_near(trapezoid.sample(2.75 + 1.25), [0.5, -0.5, 0.0]);
        assert_near(trapezoid.sample(3.0 * period_s + 1.25), [0.5, 0.5, 0.0]);
    }

    #[test]
    fn velocity_is_the_slope_of_position() {
        let trapezoid = Trapezoid::new(0.0, -1.0, 0.5, 0.7, Some(0.1));
        let h = 1e-6;
        for step in 0..800 {
            let t = 0.0137 * f64::from(step);
            let slope = (trapezoid.sample(t + h)[0] - trapezoid.sample(t - h)[0]) / (2.0 * h);
            assert!((slope - trapezoid.sample(t)[1]).abs() < 1e-5, "at {t}");
        }
    }
}
