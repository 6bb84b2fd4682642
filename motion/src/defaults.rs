//! What the named trajectories do on a robot that nobody wrote a file for.

use std::f64::consts::{FRAC_PI_2, TAU};

use robot::{Robot, RobotJoint};

use crate::PaTenArm;
use crate::entry::{HoldEntry, JointEntry, MultiSineEntry, SineEntry, TrapezoidEntry};
use crate::file::TrajectoryKind;

/// Speeds up to which the PA-10's friction was identified (PA10-05, section IV.B); brisk enough for any joint.
const SPEED_RAD_S: f64 = 0.4;
/// Share of the way to the nearest limit that a default motion uses.
const RANGE_SHARE: f64 = 0.8;

/// The trajectory to run where none is named: the lemniscate for an arm like the PA-10, else a multi-sine.
pub fn default_name(robot: &Robot) -> &'static str {
    if PaTenArm::new(&robot.chain).is_ok() {
        "lemniscate"
    } else {
        "multi_sine"
    }
}

/// Where a joint waits: zero, or the middle of its range where zero lies outside.
pub fn home_rad(joint: &RobotJoint) -> f64 {
    match joint.position_limit_rad {
        Some([low, high]) if !(low..high).contains(&0.0) => (low + high) / 2.0,
        _ => 0.0,
    }
}

/// Largest swing about `centre_rad` that keeps well away from the limits.
pub fn swing_rad(joint: &RobotJoint, centre_rad: f64, most_rad: f64) -> f64 {
    let [low, high] = joint.position_limit_rad.unwrap_or([f64::MIN, f64::MAX]);
    (RANGE_SHARE * (high - centre_rad).min(centre_rad - low)).clamp(0.0, most_rad)
}

/// Largest speed a default motion uses.
pub fn speed_rad_s(joint: &RobotJoint) -> f64 {
    joint
        .velocity_limit_rad_s
        .map_or(SPEED_RAD_S, |limit_rad_s| {
            SPEED_RAD_S.min(0.5 * limit_rad_s)
        })
}

/// Phase that spreads the joints' sines over the circle.
pub fn spread_phase_rad(index: usize, robot: &Robot) -> f64 {
    TAU * index as f64 / robot.joints.len() as f64
}

/// What a joint without a table of its own does.
pub fn entry(kind: TrajectoryKind, index: usize, robot: &Robot) -> JointEntry {
    let name = robot.joints[index].name.clone();
    match kind {
        TrajectoryKind::Sine => JointEntry::Sine(SineEntry {
            name,
            ..Default::default()
        }),
        TrajectoryKind::MultiSine => JointEntry::MultiSine(MultiSineEntry {
            name,
            ..Default::default()
        }),
        TrajectoryKind::Trapezoid => trapezoid(name, index, robot),
        TrajectoryKind::Hold | TrajectoryKind::Lemniscate => hold(name, None),
    }
}

/// The experiment of PA10-05, section V.A: joint 3 moves 1.0 rad at 0.1 rad/s, beginning with the largest gravity load
/// on it. That is: upper arm level, elbow bent by a right angle, forearm level beside it. Other robots move their first
/// joint about its home.
fn trapezoid(name: String, index: usize, robot: &Robot) -> JointEntry {
    let start_rad = PaTenArm::new(&robot.chain).is_ok().then_some(-FRAC_PI_2);
    match (start_rad.is_some(), index) {
        (true, 2) | (false, 0) => JointEntry::Trapezoid(TrapezoidEntry {
            name,
            start_rad,
            ..Default::default()
        }),
        (true, 1 | 3) => hold(name, Some(FRAC_PI_2)),
        _ => hold(name, None),
    }
}

fn hold(name: String, position_rad: Option<f64>) -> JointEntry {
    JointEntry::Hold(HoldEntry { name, position_rad })
}
