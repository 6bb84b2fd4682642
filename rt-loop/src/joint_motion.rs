//! How each joint moves, from its motor encoder.
//!
//! A velocity is the last change of the reading over the time since the change before. A reading that is repeated, by a lost
//! frame or by a coarse encoder, is then followed by the true velocity and not by twice that: until it changes, the joint has
//! gone less than one more such step, and its velocity is at most that step over the time it has had.

use shm_types::JOINTS_MAX;
use shm_types::messages::{DriveSample, PerJoint};

use crate::cycle::CycleConfig;
use crate::limits::{JointMotion, within};

/// Samples in a row that may be repeated. A reading that has stood for longer was no repetition: the joint stood, and what it
/// has gone it has gone since. So a joint at its velocity limit is not taken for a runaway until eight are repeated in a row,
/// and a jump that stays is one if it is further than the joint goes in 7.5 periods at its limit.
const REPEATED_MAX: u64 = 4;
/// A reading that changes faster than this many times the velocity limit is no motion: the encoder has jumped.
const JUMP_VELOCITY_FACTOR: f64 = 10.0;

/// The motion of all joints as far as the last usable sample shows it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointMotions {
    joints: [Tachometer; JOINTS_MAX],
    measured_cycle: Option<u64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Tachometer {
    motion: JointMotion,
    step_rad: f64,
    changed_cycle: u64,
}

impl JointMotions {
    /// The motion of every joint; those the robot does not have stand still.
    pub fn motions(&self) -> [JointMotion; JOINTS_MAX] {
        self.joints.map(|joint| joint.motion)
    }

    /// The first joint whose reading jumped since the last usable sample.
    pub fn jumped_joint(
        &self,
        config: &CycleConfig,
        cycle: u64,
        sample: &DriveSample,
    ) -> Option<u32> {
        let elapsed_s = cycle.saturating_sub(self.measured_cycle?) as f64 * config.period_s();
        let positions_rad = joint_positions_rad(config, sample);
        let jumped = config
            .joints
            .iter()
            .enumerate()
            .position(|(joint, limits)| {
                let step_rad =
                    (positions_rad[joint] - self.joints[joint].motion.position_rad).abs();
                let reach_rad = JUMP_VELOCITY_FACTOR * limits.velocity_rad_s * elapsed_s;
                step_rad > reach_rad
            });
        jumped.map(|joint| joint as u32)
    }

    /// Takes the sample of `cycle`.
    pub fn observe(&mut self, config: &CycleConfig, cycle: u64, sample: &DriveSample) {
        let positions_rad = joint_positions_rad(config, sample);
        let before = self.measured_cycle.replace(cycle);
        let tachometers = self.joints.iter_mut().zip(positions_rad);
        for (tachometer, position_rad) in tachometers.take(config.joint_count()) {
            match before {
                None => tachometer.start(cycle, position_rad),
                Some(before) => tachometer.observe(
                    cycle,
                    before.saturating_sub(REPEATED_MAX),
                    position_rad,
                    config.period_s(),
                ),
            }
        }
    }

    /// Whether the joint's reading is still the one of a cycle before `cycle`.
    pub fn stands_still(&self, joint: usize, cycle: u64) -> bool {
        self.joints[joint].changed_cycle < cycle
    }
}

fn joint_positions_rad(config: &CycleConfig, sample: &DriveSample) -> PerJoint {
    let mut positions_rad = [0.0; JOINTS_MAX];
    for (joint, limits) in config.joints.iter().enumerate() {
        positions_rad[joint] = sample.readings.motor_position_rad[joint] / limits.gear_ratio;
    }
    positions_rad
}

impl Tachometer {
    fn start(&mut self, cycle: u64, position_rad: f64) {
        self.motion.position_rad = position_rad;
        self.changed_cycle = cycle;
    }

    /// Takes a reading. What it has changed, it has changed since `oldest_cycle` at the earliest.
    fn observe(&mut self, cycle: u64, oldest_cycle: u64, position_rad: f64, period_s: f64) {
        let seconds_since = |before: u64| cycle.saturating_sub(before) as f64 * period_s;
        let change_rad = position_rad - self.motion.position_rad;
        if change_rad == 0.0 {
            let highest_rad_s = self.step_rad / (seconds_since(self.changed_cycle) + period_s);
            let velocity_rad_s = &mut self.motion.velocity_rad_s;
            *velocity_rad_s = within(-highest_rad_s, *velocity_rad_s, highest_rad_s);
        } else if cycle > self.changed_cycle {
            let since = self.changed_cycle.max(oldest_cycle);
            self.motion.position_rad = position_rad;
            self.motion.velocity_rad_s = change_rad / seconds_since(since);
            self.step_rad = change_rad.abs();
            self.changed_cycle = cycle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PERIOD_S: f64 = 1.0 / 1500.0;

    /// The highest speed a tachometer shows while a joint at `velocity_rad_s` is read as `reading_rad` says.
    fn highest_shown_rad_s(readings_rad: impl Iterator<Item = f64>) -> f64 {
        let mut tachometer = Tachometer::default();
        let mut highest_rad_s: f64 = 0.0;
        for (cycle, reading_rad) in readings_rad.enumerate() {
            if cycle == 0 {
                tachometer.start(0, reading_rad);
            } else {
                let before = cycle as u64 - 1;
                let oldest = before.saturating_sub(REPEATED_MAX);
                tachometer.observe(cycle as u64, oldest, reading_rad, PERIOD_S);
            }
            highest_rad_s = highest_rad_s.max(tachometer.motion.velocity_rad_s.abs());
        }
        highest_rad_s
    }

    #[test]
    fn a_repeated_sample_is_followed_by_the_true_velocity() {
        let repeated = (0_u32..100).map(|cycle| {
            let last_fresh = if cycle % 10 == 5 { cycle - 1 } else { cycle };
            2.5 * f64::from(last_fresh) * PERIOD_S
        });
        assert!((highest_shown_rad_s(repeated) - 2.5).abs() < 1e-9);
    }

    #[test]
    fn a_coarse_encoder_shows_even_motion_as_even() {
        // 0.1 rad/s in steps of three periods' motion.
        let step_rad = 3.0 * 0.1 * PERIOD_S;
        let coarse = (0_u32..300).map(|cycle| step_rad * f64::from(cycle / 3));
        assert!((highest_shown_rad_s(coarse) - 0.1).abs() < 1e-9);
    }

    #[test]
    fn a_joint_that_has_stopped_is_soon_shown_as_standing() {
        let mut tachometer = Tachometer::default();
        tachometer.observe(1, 0, PERIOD_S, PERIOD_S);
        assert!((tachometer.motion.velocity_rad_s - 1.0).abs() < 1e-9);
        for cycle in 2..102 {
            tachometer.observe(cycle, 0, PERIOD_S, PERIOD_S);
        }
        assert!(tachometer.motion.velocity_rad_s < 0.011);
    }

    proptest! {
        /// Whichever samples are repeated, a joint below a speed is never shown above it.
        #[test]
        fn repeated_samples_never_raise_the_velocity(
            velocity_rad_s in 0.01..5.0_f64, repeats in prop::collection::vec(0..=REPEATED_MAX, 50),
        ) {
            let mut fresh = 0;
            let readings = repeats.into_iter().flat_map(|repeated| {
                let reading_rad = velocity_rad_s * fresh as f64 * PERIOD_S;
                fresh += 1 + repeated;
                std::iter::repeat_n(reading_rad, 1 + repeated as usize)
            });
            prop_assert!(highest_shown_rad_s(readings) <= velocity_rad_s * (1.0 + 1e-9));
        }
    }
}
