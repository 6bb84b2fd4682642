//! Where position control wants the output to be: the trajectory inside the drive.
//!
//! With no limit set the command is followed at once. With a velocity or acceleration limit the control position goes over
//! to the commanded one, which itself moves with the commanded velocity, with accelerations of `±a` or none and velocities
//! within `±v` (moteus, reference/configuration.md, `servo.default_velocity_limit`). All values are those of the output.

/// What is commanded and how fast it may be reached.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    /// Where the output should be now, in revolutions; `None` for wherever the velocity leads.
    pub position_rev: Option<f64>,
    /// How fast that moves.
    pub velocity_rev_s: f64,
    /// At most this fast; NaN for no limit.
    pub velocity_limit_rev_s: f64,
    /// Speeding up and slowing down by at most this; NaN for no limit.
    pub acceleration_limit_rev_s2: f64,
}

/// The trajectory as it stands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Trajectory {
    /// Where the output is held to; `None` while position control is off.
    pub position_rev: Option<f64>,
    /// How fast that moves.
    pub velocity_rev_s: f64,
    /// How that changes.
    pub acceleration_rev_s2: f64,
    /// Whether it has arrived at the commanded position and velocity.
    pub done: bool,
}

/// Within this many steps of where it should be, at the target's speed, a trajectory has arrived.
const NEAR_STEPS: f64 = 10.0;

impl Trajectory {
    /// One step. It begins where and as fast as the output is. The goal moves on; its position is dropped once reached.
    pub fn advance(&mut self, goal: &mut Goal, measured: (f64, f64), step_s: f64) {
        let unlimited =
            goal.velocity_limit_rev_s.is_nan() && goal.acceleration_limit_rev_s2.is_nan();
        if let (true, Some(position_rev)) = (unlimited, goal.position_rev) {
            self.position_rev = Some(position_rev);
            goal.position_rev = None;
        } else if self.position_rev.is_none() {
            self.position_rev = Some(measured.0);
            self.velocity_rev_s = measured.1;
        }
        let before_rev_s = self.velocity_rev_s;
        self.acceleration_rev_s2 = 0.0;
        if unlimited {
            self.velocity_rev_s = goal.velocity_rev_s;
            self.done = true;
        } else {
            self.done = false;
            match goal.position_rev {
                None => self.approach_velocity(goal, step_s),
                Some(position_rev) => self.approach_position(goal, position_rev, step_s),
            }
        }
        let mean_rev_s = if self.acceleration_rev_s2 == 0.0 {
            self.velocity_rev_s
        } else {
            0.5 * (before_rev_s + self.velocity_rev_s)
        };
        self.position_rev = self
            .position_rev
            .map(|position_rev| position_rev + mean_rev_s * step_s);
        goal.position_rev = goal
            .position_rev
            .map(|position_rev| position_rev + goal.velocity_rev_s * step_s);
    }

    fn approach_velocity(&mut self, goal: &Goal, step_s: f64) {
        let missing_rev_s = goal.velocity_rev_s - self.velocity_rev_s;
        let most_rev_s = goal.acceleration_limit_rev_s2 * step_s;
        if missing_rev_s.abs() <= most_rev_s || most_rev_s.is_nan() {
            self.velocity_rev_s = goal.velocity_rev_s;
            self.done = true;
        } else {
            self.acceleration_rev_s2 = goal.acceleration_limit_rev_s2.copysign(missing_rev_s);
            self.velocity_rev_s += self.acceleration_rev_s2 * step_s;
        }
    }

    fn approach_position(&mut self, goal: &mut Goal, target_rev: f64, step_s: f64) {
        let away_rev = target_rev - self.position_rev.unwrap_or(target_rev);
        let most_rev_s2 = goal.acceleration_limit_rev_s2;
        if most_rev_s2.is_nan() {
            let velocity_rev_s = goal.velocity_limit_rev_s.copysign(away_rev);
            if (velocity_rev_s * step_s).abs() >= away_rev.abs() {
                self.arrive(goal);
            } else {
                self.velocity_rev_s = velocity_rev_s;
            }
            return;
        }
        // seen from the moving target
        let closing_rev_s = self.velocity_rev_s - goal.velocity_rev_s;
        let near_rev = closing_rev_s.abs().max(goal.velocity_rev_s.abs()) * NEAR_STEPS * step_s;
        if closing_rev_s.abs() <= most_rev_s2 * step_s
            && away_rev.abs() <= near_rev.max(most_rev_s2 * step_s * step_s)
        {
            self.arrive(goal);
            return;
        }
        self.acceleration_rev_s2 = self.acceleration(goal, away_rev, closing_rev_s, step_s);
        self.velocity_rev_s += self.acceleration_rev_s2 * step_s;
        let limit_rev_s = goal.velocity_limit_rev_s;
        if self.velocity_rev_s.abs() > limit_rev_s
            && self.acceleration_rev_s2 * self.velocity_rev_s > 0.0
        {
            self.velocity_rev_s = limit_rev_s.copysign(self.velocity_rev_s);
            self.acceleration_rev_s2 = 0.0;
        }
    }

    /// Speed up, keep on, or brake so as to stand at the target.
    fn acceleration(&self, goal: &Goal, away_rev: f64, closing_rev_s: f64, step_s: f64) -> f64 {
        let most_rev_s2 = goal.acceleration_limit_rev_s2;
        let limit_rev_s = goal.velocity_limit_rev_s;
        if self.velocity_rev_s.abs() > limit_rev_s {
            return -most_rev_s2.copysign(self.velocity_rev_s);
        }
        if closing_rev_s * away_rev < 0.0 || away_rev == 0.0 {
            return -most_rev_s2.copysign(closing_rev_s);
        }
        let faster_rev_s = closing_rev_s.abs() + most_rev_s2 * step_s;
        let travelled_rev = 0.5 * (closing_rev_s.abs() + faster_rev_s) * step_s;
        let stop_rev = faster_rev_s * faster_rev_s / (2.0 * most_rev_s2);
        if away_rev.abs() - travelled_rev <= stop_rev {
            let needed_rev_s2 = closing_rev_s * closing_rev_s / (2.0 * away_rev.abs());
            return -needed_rev_s2.min(most_rev_s2).copysign(closing_rev_s);
        }
        if self.velocity_rev_s.abs() >= limit_rev_s && self.velocity_rev_s * away_rev > 0.0 {
            return 0.0;
        }
        most_rev_s2.copysign(away_rev)
    }

    fn arrive(&mut self, goal: &mut Goal) {
        self.position_rev = goal.position_rev;
        goal.position_rev = None;
        self.velocity_rev_s = goal.velocity_rev_s;
        self.done = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 1.0 / 6000.0;

    fn goal(position_rev: Option<f64>, velocity_rev_s: f64, limits: [f64; 2]) -> Goal {
        Goal {
            position_rev,
            velocity_rev_s,
            velocity_limit_rev_s: limits[0],
            acceleration_limit_rev_s2: limits[1],
        }
    }

    #[test]
    fn without_limits_the_command_is_the_trajectory() {
        let mut trajectory = Trajectory::default();
        let mut goal = goal(Some(0.5), 0.25, [f64::NAN; 2]);
        trajectory.advance(&mut goal, (0.0, 0.0), STEP_S);
        assert_eq!(trajectory.position_rev, Some(0.5 + 0.25 * STEP_S));
        assert!(trajectory.done && goal.position_rev.is_none());
    }

    #[test]
    fn limits_are_kept_and_the_target_is_reached() {
        for (start_rev, target_rev, limits) in [
            (0.0, 0.3, [0.2, 1.0]),
            (0.3, -0.5, [f64::INFINITY, 2.0]),
            (0.0, 0.001, [0.5, 50.0]),
            (0.0, 0.4, [0.3, f64::NAN]),
        ] {
            let (mut trajectory, mut goal) =
                (Trajectory::default(), goal(Some(target_rev), 0.0, limits));
            let mut before_rev_s = 0.0;
            let mut steps = 0;
            while !trajectory.done && steps < 60_000 {
                trajectory.advance(&mut goal, (start_rev, 0.0), STEP_S);
                assert!(trajectory.velocity_rev_s.abs() <= limits[0] * (1.0 + 1e-9));
                let change_rev_s = (trajectory.velocity_rev_s - before_rev_s).abs();
                assert!(limits[1].is_nan() || change_rev_s <= limits[1] * STEP_S * 1.001);
                before_rev_s = trajectory.velocity_rev_s;
                steps += 1;
            }
            assert!(trajectory.done, "to {target_rev} within {limits:?}");
            let missed_rev = trajectory.position_rev.expect("runs") - target_rev;
            assert!(missed_rev.abs() < 1e-9, "{missed_rev} off {target_rev}");
        }
    }

    #[test]
    fn a_velocity_alone_is_reached_from_the_speed_there_is() {
        let (mut trajectory, mut goal) = (Trajectory::default(), goal(None, 1.0, [f64::NAN, 2.0]));
        for _ in 0..600 {
            trajectory.advance(&mut goal, (0.1, 0.5), STEP_S);
        }
        assert!((trajectory.velocity_rev_s - 0.7).abs() < 1e-9);
        assert!(!trajectory.done);
        for _ in 0..1000 {
            trajectory.advance(&mut goal, (0.1, 0.5), STEP_S);
        }
        assert_eq!(trajectory.velocity_rev_s, 1.0);
        assert!(trajectory.done);
    }
}
