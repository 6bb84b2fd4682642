//! Velocity from an encoder's positions: an observer of position, velocity and acceleration.
//!
//! Prediction at constant acceleration, corrected by the position error `r` with `g·r`, `h·r/T`, `2k·r/T²`, where
//! `g = 1 - θ³`, `h = 1.5 (1-θ)² (1+θ)`, `k = 0.5 (1-θ)³`: all three poles at `θ`, so a step is followed without ringing.
//! Source: Brookner, Tracking and Kalman Filtering Made Easy (1998), section 1.3: the fading-memory, critically damped
//! g-h-k filter, a Luenberger observer with the acceleration as its disturbance.
//! Motor torque is no input on purpose: while friction holds a joint, torque says nothing about motion, and an observer
//! that believes it sees velocity where there is none. Follows constant acceleration without lag.

use core::f64::consts::TAU;

/// After a longer gap the observer starts again at rest: extrapolated that far, noise of the acceleration is no position.
const GAP_MAX_CYCLES: u64 = 15;

/// One encoder's observer.
#[derive(Clone, Copy, Debug)]
pub struct VelocityObserver {
    gains: [f64; 3],
    period_s: f64,
    newest_cycle: Option<u64>,
    position_rad: f64,
    velocity_rad_s: f64,
    acceleration_rad_s2: f64,
}

impl VelocityObserver {
    /// An observer with its poles at `bandwidth_hz` for samples every `period_s`.
    pub fn new(bandwidth_hz: f64, period_s: f64) -> Self {
        let pole = (-TAU * bandwidth_hz * period_s).exp();
        let (one_minus, one_plus) = (1.0 - pole, 1.0 + pole);
        Self {
            gains: [
                1.0 - pole.powi(3),
                1.5 * one_minus.powi(2) * one_plus,
                0.5 * one_minus.powi(3),
            ],
            period_s,
            newest_cycle: None,
            position_rad: 0.0,
            velocity_rad_s: 0.0,
            acceleration_rad_s2: 0.0,
        }
    }

    /// Takes the position of a cycle and gives the velocity. Skipped cycles count as time; a repeated or earlier one, or a
    /// position that is no number, changes nothing.
    pub fn observe(&mut self, cycle: u64, position_rad: f64) -> f64 {
        let since = self.newest_cycle.map(|newest| cycle.saturating_sub(newest));
        if !position_rad.is_finite() || since == Some(0) {
            return self.velocity_rad_s;
        }
        self.newest_cycle = Some(cycle);
        match since {
            Some(cycles) if cycles <= GAP_MAX_CYCLES => self.correct(cycles as f64, position_rad),
            _ => {
                self.position_rad = position_rad;
                self.velocity_rad_s = 0.0;
                self.acceleration_rad_s2 = 0.0;
            }
        }
        self.velocity_rad_s
    }

    fn correct(&mut self, cycles: f64, position_rad: f64) {
        let [g, h, k] = self.gains;
        let time_s = cycles * self.period_s;
        self.position_rad +=
            time_s * (self.velocity_rad_s + 0.5 * time_s * self.acceleration_rad_s2);
        self.velocity_rad_s += time_s * self.acceleration_rad_s2;
        let error_rad = position_rad - self.position_rad;
        self.position_rad += g * error_rad;
        self.velocity_rad_s += h * error_rad / time_s;
        self.acceleration_rad_s2 += 2.0 * k * error_rad / (time_s * time_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1.0 / 1500.0;

    #[test]
    fn constant_acceleration_is_followed_without_lag_even_with_cycles_missing() {
        let mut observer = VelocityObserver::new(25.0, PERIOD_S);
        for cycle in (0..3000).filter(|cycle| cycle % 7 != 3) {
            let time_s = cycle as f64 * PERIOD_S;
            let velocity_rad_s = observer.observe(cycle, 0.2 * time_s - 0.15 * time_s * time_s);
            if cycle > 1000 {
                assert!((velocity_rad_s - 0.2 + 0.3 * time_s).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_step_is_followed_without_ringing_longer_than_its_bandwidth() {
        let mut observer = VelocityObserver::new(25.0, PERIOD_S);
        observer.observe(0, 0.0);
        let velocities = (1..300).map(|cycle| observer.observe(cycle, 1e-3));
        let turns = velocities
            .collect::<Vec<f64>>()
            .windows(2)
            .filter(|pair| pair[0].signum() != pair[1].signum())
            .count();
        assert!(turns <= 2, "{turns} changes of sign");
    }

    #[test]
    fn an_encoder_that_flickers_by_one_step_shows_hardly_any_motion() {
        const STEP_RAD: f64 = 7.66e-6; // PA10-05, section II, joint side
        let mut observer = VelocityObserver::new(25.0, PERIOD_S);
        let fastest_rad_s = (0..3000)
            .map(|cycle| observer.observe(cycle, STEP_RAD * (cycle % 2) as f64).abs())
            .skip(300)
            .fold(0.0, f64::max);
        assert!(fastest_rad_s < 0.1 * STEP_RAD / PERIOD_S, "{fastest_rad_s}");
    }

    #[test]
    fn repeated_cycles_and_missing_positions_change_nothing_and_a_long_gap_starts_again() {
        let mut observer = VelocityObserver::new(25.0, PERIOD_S);
        for cycle in 0..500 {
            observer.observe(cycle, 0.3 * cycle as f64 * PERIOD_S);
        }
        let velocity_rad_s = observer.observe(499, 7.0);
        assert!((velocity_rad_s - 0.3).abs() < 1e-6);
        assert_eq!(observer.observe(500, f64::NAN), velocity_rad_s);
        assert_eq!(observer.observe(600, 5.0), 0.0);
    }
}
