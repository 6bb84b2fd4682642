//! Soft start: path time that begins at rest and then runs with the clock.
//!
//! Over the first `T` seconds `s(t) = T·(u³ - u⁴/2)` with `u = t/T`, after that `s(t) = t - T/2`. So `s' = 3u² - 2u³`
//! rises from 0 to 1, and `s''` is zero at both ends: position, velocity and acceleration of any smooth path stay
//! continuous, and the motion starts with zero velocity and acceleration.

/// Path time and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathTime {
    /// `s`.
    pub time_s: f64,
    /// `ds/dt`.
    pub rate: f64,
    /// `d²s/dt²`.
    pub rate_change_1_s: f64,
}

/// Path time at `time_s` for a soft start over `duration_s`; 0 starts abruptly.
pub fn path_time(time_s: f64, duration_s: f64) -> PathTime {
    if time_s >= duration_s {
        return PathTime {
            time_s: time_s - duration_s / 2.0,
            rate: 1.0,
            rate_change_1_s: 0.0,
        };
    }
    let u = time_s / duration_s;
    PathTime {
        time_s: duration_s * u.powi(3) * (1.0 - u / 2.0),
        rate: u * u * (3.0 - 2.0 * u),
        rate_change_1_s: 6.0 * u * (1.0 - u) / duration_s,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_at_rest_and_joins_the_clock_smoothly() {
        assert_eq!(
            path_time(0.0, 2.0),
            PathTime {
                time_s: 0.0,
                rate: 0.0,
                rate_change_1_s: 0.0
            }
        );
        let (before, after) = (path_time(2.0 - 1e-9, 2.0), path_time(2.0, 2.0));
        assert!((before.time_s - after.time_s).abs() < 1e-8);
        assert!((before.rate - 1.0).abs() < 1e-12 && before.rate_change_1_s.abs() < 1e-8);
        assert_eq!(path_time(5.0, 2.0).time_s, 4.0);
    }

    #[test]
    fn derivatives_are_those_of_path_time() {
        for step in 1..20 {
            let (t, h) = (0.1 * f64::from(step), 1e-5);
            let (low, mid, high) = (
                path_time(t - h, 2.0),
                path_time(t, 2.0),
                path_time(t + h, 2.0),
            );
            assert!(((high.time_s - low.time_s) / (2.0 * h) - mid.rate).abs() < 1e-8);
            assert!(((high.rate - low.rate) / (2.0 * h) - mid.rate_change_1_s).abs() < 1e-8);
        }
    }

    #[test]
    fn zero_duration_starts_abruptly() {
        assert_eq!(
            path_time(0.0, 0.0),
            PathTime {
                time_s: 0.0,
                rate: 1.0,
                rate_change_1_s: 0.0
            }
        );
    }
}
