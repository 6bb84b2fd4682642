//! What the loop makes of a run and a robot file: limits of the joints, patience with what is missing.

use robot::Robot;
use shm_types::instance::RunConfig;

use crate::cycle::CycleConfig;
use crate::limits::JointLimits;

/// For so long without a fresh command the last torque is held.
const HOLD_NS: u64 = 10_000_000;
/// For so long after that joints are damped. A joint that gravity pulls falls on slowly while it is damped.
const DAMPING_NS: u64 = 100_000_000;
/// For so long after that the brakes are closed and a command still goes on: enough for a service to be started again.
const WAITING_NS: u64 = 2_900_000_000;

/// Drives that are ready must be enabled in this time. CiA 402 drives need three exchanges and their brake's release, up to some
/// tenths of a second; the rest is for a bus that loses frames.
pub const ENABLING_NS: u64 = 3_000_000_000;
/// Drives that were damped must be enabled again in this time: as long as a holding brake may take, and short enough that a damped
/// PA-10 falls by less than half a radian.
const REENABLING_NS: u64 = 500_000_000;
/// For so long after the operator's reset drives are asked to clear their faults.
const RESET_NS: u64 = 1_000_000_000;

/// What the cycle needs to know of a run of this robot.
pub fn cycle_config(run: &RunConfig, robot: &Robot) -> CycleConfig {
    let joints = (0..robot.joints.len())
        .map(|joint| joint_limits(robot, joint))
        .collect();
    // To the nearest, and at least one.
    let cycles = |time_ns: u64| ((time_ns + run.period_ns / 2) / run.period_ns).max(1);
    CycleConfig {
        session: run.session,
        period_ns: run.period_ns,
        joints,
        joint_names: robot
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .collect(),
        hold_cycles: cycles(HOLD_NS),
        damping_cycles: cycles(DAMPING_NS),
        waiting_cycles: cycles(WAITING_NS),
        enabling_cycles: cycles(ENABLING_NS),
        reenabling_cycles: cycles(REENABLING_NS),
        reset_cycles: cycles(RESET_NS),
    }
}

/// Without a torque limit in the robot file: as good as none, but finite.
const NO_TORQUE_LIMIT_NM: f64 = 1e6;
/// A torque may go from nothing to its limit in this time.
const FULL_TORQUE_TIME_S: f64 = 0.01;
/// A commanded velocity may go from nothing to its limit in this time.
const FULL_VELOCITY_TIME_S: f64 = 0.1;
/// Without a velocity limit in the robot file.
const NO_VELOCITY_LIMIT_RAD_S: f64 = 1e3;

/// Without a `standstill_limit_rad` in the robot file. Assumed: low gains let a joint stick for a while, but its motor twists the
/// gear, and the encoder shows that.
const STANDSTILL_RAD: f64 = 0.05;
/// Without a `following_limit_rad` in the robot file. Assumed: low gains without a model let a joint sag by much, not by that.
const FOLLOWING_RAD: f64 = 1.0;

fn joint_limits(robot: &Robot, index: usize) -> JointLimits {
    let joint = &robot.joints[index];
    let motor_torque_nm = joint.torque_limit_nm.unwrap_or(NO_TORQUE_LIMIT_NM);
    let velocity_rad_s = joint
        .velocity_limit_rad_s
        .unwrap_or(NO_VELOCITY_LIMIT_RAD_S);
    let [position_min_rad, position_max_rad] = joint
        .position_limit_rad
        .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    let damping_nm_s_rad = robot
        .control
        .as_ref()
        .map_or(0.0, |control| control.derivative_nm_s_rad[index]);
    JointLimits {
        gear_ratio: joint.gear_ratio,
        motor_torque_nm,
        motor_torque_rate_nm_s: motor_torque_nm / FULL_TORQUE_TIME_S,
        position_min_rad,
        position_max_rad,
        velocity_rad_s,
        acceleration_rad_s2: velocity_rad_s / FULL_VELOCITY_TIME_S,
        damping_nm_s_rad,
        standstill_rad: joint.standstill_limit_rad.unwrap_or(STANDSTILL_RAD),
        following_rad: joint.following_limit_rad.unwrap_or(FOLLOWING_RAD),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::control_options::ControlOptions;
    use shm_types::instance::{ControlMode, Mode, Wait};

    #[test]
    fn patience_is_the_same_time_at_every_rate() {
        let robot = robot::load("shd17").expect("shipped");
        for period_ns in [666_667, 250_000, 4_000_000, 50_000_000] {
            let run = RunConfig {
                session: 1,
                robot: "shd17".to_owned(),
                driver: "emulator".to_owned(),
                trajectory: "sine".to_owned(),
                plant: None,
                control: ControlMode::Torque,
                options: ControlOptions::default(),
                estimators: Vec::new(),
                mode: Mode::Lockstep,
                period_ns,
                cycles: 1,
                wait: Wait::Block,
                wake_early_ns: 0,
                seed: 1,
                inject: None,
                record: None,
                command_deadline_ns: period_ns,
                cores: Vec::new(),
                initial_position_rad: vec![0.0],
            };
            let config = cycle_config(&run, &robot);
            let off_ns = (config.patience_cycles() * period_ns).abs_diff(3_010_000_000);
            assert!(off_ns <= 3 * period_ns, "{period_ns} ns: {config:?}");
            assert!(config.hold_cycles >= 1);
        }
    }
}
