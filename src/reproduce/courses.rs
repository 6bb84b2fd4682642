//! The papers' motions on the emulated PA-10.

use motion::{JointEntry, MotionError, TrajectoryFile, TrapezoidEntry};
use robot::Robot;

use super::bench::Course;

/// Rest at either end of a sweep: long enough for the feedback to settle.
const DWELL_S: f64 = 1.0;

/// Length of the run along the lemniscate: one and a half rounds. PA10-05 does not say how long it ran.
const LEMNISCATE_S: f64 = 20.0;

/// PA10-05, eq (14).
pub fn lemniscate(robot: &Robot) -> Result<Course, MotionError> {
    Ok(Course {
        trajectory: motion::load("lemniscate", robot)?,
        duration_s: LEMNISCATE_S,
    })
}

/// PA10-05, section V-A: joint 3 from the greatest gravity load, 1.0 rad at 0.1 rad/s.
pub fn joint_three(robot: &Robot) -> Result<Course, MotionError> {
    let trajectory = motion::load("trapezoid", robot)?;
    let duration_s = trajectory.duration_s().unwrap_or_default();
    Ok(Course {
        trajectory,
        duration_s,
    })
}

/// One joint there and back over `range_rad`, all others at zero: twice through the region of low stiffness.
pub fn sweep(
    robot: &Robot,
    joint: usize,
    range_rad: [f64; 2],
    speed_rad_s: f64,
) -> Result<Course, MotionError> {
    let [low_rad, high_rad] = range_rad;
    let name = robot.joints[joint].name.clone();
    let file = TrajectoryFile {
        joints: vec![JointEntry::Trapezoid(TrapezoidEntry {
            name: name.clone(),
            start_rad: Some(low_rad),
            distance_rad: Some(high_rad - low_rad),
            speed_rad_s: Some(speed_rad_s),
            acceleration_rad_s2: None,
            dwell_s: Some(DWELL_S),
        })],
        ..TrajectoryFile::default()
    };
    // Accelerating from rest at 1 rad/s², the usual of a trapezoid, takes as long as the speed has units.
    let move_s = (high_rad - low_rad) / speed_rad_s + speed_rad_s;
    Ok(Course {
        trajectory: file.build(&format!("sweep of {name}"), robot)?,
        duration_s: 2.0 * (move_s + DWELL_S),
    })
}
