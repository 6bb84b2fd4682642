//! Joints that are moved from outside, and the first torque of one of them: what commissioning asks for before any trajectory.
//!
//! The reference is where the joint is, so that nothing of the loop's watch for joints that do not follow is meant. The nudge
//! is a torque that grows in a straight line to the joint's limit, first in the positive direction, then in the negative one,
//! and ends for good once the joint has moved: here, in the cycle that sees it, because nobody else is as fast.

use robot::Robot;
use shm_types::JOINTS_MAX;
use shm_types::messages::{Command, DriveMode, LoopState, SensorSample};

/// From no torque to the joint's limit. Assumed: slow enough for a hand on the emergency stop.
pub const NUDGE_RISE_S: f64 = 2.0;
/// Without torque before each direction.
pub const NUDGE_REST_S: f64 = 0.5;
/// Joint side: a joint that has gone this far has moved, and gets no more torque. More than a torque at its limit twists a
/// gear: 37 Nm the SHD-17-100 by 4 mrad.
pub const NUDGE_END_RAD: f64 = 0.02;

/// The controller of joints that nobody commands, but for one.
#[derive(Clone, Debug)]
pub struct ByHand {
    gear_ratios: Vec<f64>,
    nudge: Option<Nudge>,
}

#[derive(Clone, Copy, Debug)]
struct Nudge {
    joint: usize,
    /// Motor side.
    torque_limit_nm: f64,
    /// Where it stood, joint side, and the trajectory too, when the first sample came in which the drives obeyed. A service that
    /// was started again begins anew, from no torque.
    begun: Option<(f64, u64)>,
    has_moved: bool,
}

impl ByHand {
    /// No joint gets torque.
    pub fn released(robot: &Robot) -> Self {
        Self {
            gear_ratios: robot.joints.iter().map(|joint| joint.gear_ratio).collect(),
            nudge: None,
        }
    }

    /// One joint is nudged, up to its `torque_limit_nm`; without one it gets none.
    pub fn nudged(robot: &Robot, joint: usize) -> Self {
        let drive = robot.joints.get(joint);
        let torque_limit_nm = drive.and_then(|drive| drive.torque_limit_nm);
        Self {
            nudge: Some(Nudge {
                joint,
                torque_limit_nm: torque_limit_nm.unwrap_or(0.0),
                begun: None,
                has_moved: false,
            }),
            ..Self::released(robot)
        }
    }

    /// The command that answers one sample. No allocation, no clock.
    pub fn command(&mut self, sample: &SensorSample) -> Command {
        let mut command = Command {
            header: sample.header,
            mode: DriveMode::Torque as u32,
            ..Command::default()
        };
        for (joint, gear_ratio) in self.gear_ratios.iter().enumerate().take(JOINTS_MAX) {
            command.reference_position_rad[joint] =
                sample.readings.motor_position_rad[joint] / gear_ratio;
        }
        if let Some(nudge) = &mut self.nudge
            && nudge.joint < self.gear_ratios.len().min(JOINTS_MAX)
        {
            let position_rad = command.reference_position_rad[nudge.joint];
            command.motor_torque_nm[nudge.joint] = nudge.torque_nm(sample, position_rad);
        }
        command
    }
}

impl Nudge {
    fn torque_nm(&mut self, sample: &SensorSample, position_rad: f64) -> f64 {
        if LoopState::from_raw(sample.state) != Some(LoopState::Running) {
            return 0.0;
        }
        let here = (position_rad, sample.motion_time_ns);
        let (begun_at_rad, begun_at_ns) = *self.begun.get_or_insert(here);
        // False for what is no number: no torque on a joint that nobody sees.
        let stands = (position_rad - begun_at_rad).abs() < NUDGE_END_RAD;
        self.has_moved |= !stands;
        match self.has_moved {
            true => 0.0,
            false => {
                let since_ns = sample.motion_time_ns.saturating_sub(begun_at_ns);
                self.torque_limit_nm * nudge_share(since_ns as f64 * 1e-9)
            }
        }
    }
}

/// Of the limit, with its direction, so long after the drives began to obey.
fn nudge_share(time_s: f64) -> f64 {
    let share = |begin_s: f64| {
        let rise = (time_s - begin_s) / NUDGE_RISE_S;
        if (0.0..1.0).contains(&rise) {
            rise
        } else {
            0.0
        }
    };
    share(NUDGE_REST_S) - share(2.0 * NUDGE_REST_S + NUDGE_RISE_S)
}

/// When both directions have had their torque, after the drives began to obey.
pub const NUDGE_S: f64 = 2.0 * (NUDGE_REST_S + NUDGE_RISE_S);

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    fn sample(state: LoopState, time_s: f64, position_rad: f64) -> SensorSample {
        let mut sample = SensorSample {
            motion_time_ns: (time_s * 1e9) as u64,
            motion_rate: 1.0,
            state: state as u32,
            ..SensorSample::default()
        };
        sample.readings.motor_position_rad[0] = 100.0 * position_rad;
        sample
    }

    #[test]
    fn a_released_joint_gets_no_torque_and_is_where_it_should_be() {
        let robot = robot::load("shd17").unwrap();
        let mut released = ByHand::released(&robot);
        let command = released.command(&sample(LoopState::Running, 1.0, 0.3));
        assert_eq!(command.mode, DriveMode::Torque as u32);
        assert_eq!(command.motor_torque_nm, [0.0; JOINTS_MAX]);
        assert!((command.reference_position_rad[0] - 0.3).abs() < 1e-12);
    }

    #[test]
    fn a_nudge_goes_both_ways_within_the_limit_and_only_while_the_loop_runs() {
        let robot = robot::load("shd17").unwrap();
        let limit_nm = robot.joints[0].torque_limit_nm.unwrap();
        let mut nudged = ByHand::nudged(&robot, 0);
        let mut torque_nm =
            |state, time_s| nudged.command(&sample(state, time_s, 0.3)).motor_torque_nm[0];
        assert_eq!(torque_nm(LoopState::Enabling, 1.5), 0.0);
        assert_eq!(torque_nm(LoopState::Running, 0.0), 0.0);
        assert_eq!(torque_nm(LoopState::Running, 0.4), 0.0, "it rests first");
        assert!((torque_nm(LoopState::Running, 1.5) - limit_nm / 2.0).abs() < 1e-9);
        assert_eq!(torque_nm(LoopState::Holding, 1.5), 0.0);
        assert_eq!(torque_nm(LoopState::Running, 2.6), 0.0, "and between");
        assert!((torque_nm(LoopState::Running, 4.0) + limit_nm / 2.0).abs() < 1e-9);
        for step in 0..600 {
            let at_nm = torque_nm(LoopState::Running, 0.01 * f64::from(step));
            assert!(at_nm.abs() <= limit_nm, "{at_nm}");
        }
        assert_eq!(torque_nm(LoopState::Running, NUDGE_S), 0.0);
    }

    #[test]
    fn a_joint_that_has_moved_or_is_not_seen_gets_no_more_torque() {
        let robot = robot::load("shd17").unwrap();
        for moved_to_rad in [
            0.3 + NUDGE_END_RAD + 1e-9,
            0.3 - NUDGE_END_RAD - 1e-9,
            f64::NAN,
        ] {
            let mut nudged = ByHand::nudged(&robot, 0);
            let mut torque_nm = |time_s, position_rad| {
                let asked = sample(LoopState::Running, time_s, position_rad);
                nudged.command(&asked).motor_torque_nm[0]
            };
            assert_eq!(torque_nm(7.0, 0.3), 0.0, "it begins at whatever time");
            assert!(torque_nm(8.0, 0.3) > 0.0);
            assert_eq!(torque_nm(8.1, moved_to_rad), 0.0);
            assert_eq!(torque_nm(8.2, 0.3), 0.0, "it came back: for good");
        }
    }

    #[test]
    fn without_a_limit_there_is_no_torque() {
        let mut robot = robot::load("shd17").unwrap();
        robot.joints[0].torque_limit_nm = None;
        let mut nudged = ByHand::nudged(&robot, 0);
        let command = nudged.command(&sample(LoopState::Running, 1.5, 0.0));
        assert_eq!(command.motor_torque_nm[0], 0.0);
        // and a joint that is none is nobody's
        ByHand::nudged(&robot, 99).command(&sample(LoopState::Running, 1.5, 0.0));
    }
}
