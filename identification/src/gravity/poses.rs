//! From recordings to poses: means over one turn of the motor.
//!
//! Everything tied to the wave generator's angle averages out over one turn, so poses scatter little; the pose itself
//! moves by `2π/N`, over which gravity torque bends by less than a part in a thousand for gear ratios from 50 on.

use std::f64::consts::TAU;

use joint_model::friction::Direction;
use robot::Robot;

use crate::slow_motion::Run;

/// Angle of the cells that decide which poses are left out together: the same place is passed both ways, and more
/// than once.
const FOLD_CELL_RAD: f64 = 0.3;

/// The mean of successive rows in which every joint keeps its direction of motion, or its rest.
#[derive(Clone, Debug)]
pub(super) struct Pose {
    pub position_rad: Vec<f64>,
    /// What the moving joints feel.
    pub readings: Vec<Reading>,
    /// Poses of one cell of the fastest joint's angle have the same number.
    pub cell: i64,
}

/// One moving joint in one pose, joint side.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    pub joint: usize,
    pub direction: Direction,
    pub velocity_rad_s: f64,
    pub torque_nm: f64,
    /// What the robot file knows of friction without load, about the axis.
    pub friction_nm: f64,
}

/// Successive rows that may become one pose.
#[derive(Default)]
struct Stretch {
    from: usize,
    to: usize,
}

/// The poses of a run, in order.
pub(super) fn poses(run: &Run, robot: &Robot) -> Vec<Pose> {
    let mut poses = Vec::new();
    let mut stretch = Stretch::default();
    for row in 0..=run.rows {
        if row < run.rows && continues(run, robot, &stretch, row) {
            stretch.to = row + 1;
            continue;
        }
        poses.extend(pose(run, robot, &stretch));
        stretch = Stretch {
            from: row,
            to: row + 1,
        };
    }
    poses
}

fn continues(run: &Run, robot: &Robot, stretch: &Stretch, row: usize) -> bool {
    run.joints.iter().zip(&robot.joints).all(|(motion, drive)| {
        let travel_rad = motion.position_rad[row] - motion.position_rad[stretch.from];
        motion.direction[row] == motion.direction[stretch.from]
            && (motion.direction[row].is_none() || travel_rad.abs() * drive.gear_ratio < TAU)
    })
}

/// Nothing where no joint moves, or the stretch is shorter than a velocity is taken over.
fn pose(run: &Run, robot: &Robot, stretch: &Stretch) -> Option<Pose> {
    let rows = stretch.from..stretch.to.min(run.rows);
    if rows.len() < run.window_rows.max(1) {
        return None;
    }
    let mean = |values: &[f64]| values[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
    let readings: Vec<Reading> = run
        .joints
        .iter()
        .enumerate()
        .filter_map(|(joint, motion)| {
            let direction = motion.direction[rows.start]?;
            let friction = unloaded(robot, joint);
            let friction_nm = rows.clone().map(|row| {
                let (velocity_rad_s, motor_rad) =
                    (motion.velocity_rad_s[row], motion.motor_position_rad[row]);
                friction.drag_nm(velocity_rad_s, 0.0, motor_rad, 0.0)
            });
            Some(Reading {
                joint,
                direction,
                velocity_rad_s: mean(&motion.velocity_rad_s),
                torque_nm: mean(&motion.torque_nm),
                friction_nm: friction_nm.sum::<f64>() / rows.len() as f64,
            })
        })
        .collect();
    let position_rad: Vec<f64> = run
        .joints
        .iter()
        .map(|joint| mean(&joint.position_rad))
        .collect();
    let fastest = readings
        .iter()
        .max_by(|a, b| a.velocity_rad_s.abs().total_cmp(&b.velocity_rad_s.abs()))?;
    Some(Pose {
        cell: (position_rad[fastest.joint] / FOLD_CELL_RAD).floor() as i64,
        position_rad,
        readings,
    })
}

/// The joint's friction without what depends on load.
fn unloaded(robot: &Robot, joint: usize) -> joint_model::friction::SteadyFriction {
    joint_model::friction::SteadyFriction {
        load_torque: None,
        load_dependent: Default::default(),
        ..robot.joints[joint].steady_friction()
    }
}
