//! From recordings to poses: means over one turn of the motor.
//!
//! Everything tied to the wave generator's angle averages out over one turn, so poses scatter little. Over the `2π/N` by
//! which the joint moves meanwhile, gravity torque is nearly straight, but friction under load is not: Table V falls within
//! as much. A pose therefore keeps samples of its motion, at which friction is evaluated.

use std::f64::consts::TAU;

use joint_model::friction::Direction;
use robot::Robot;

use crate::steady_motion::slow::Run;

/// Angle of the cells that decide which poses are left out together: the same place is passed both ways, and more
/// than once.
const FOLD_CELL_RAD: f64 = 0.3;

/// Samples of a pose at most: more than two for each of the 30 teeth or so that a flexspline's ripple may count.
const SAMPLES: usize = 64;

/// The mean of successive rows in which every joint keeps its direction of motion, or its rest.
#[derive(Clone, Debug)]
pub(super) struct Pose {
    /// All joints' angles at each sample.
    pub samples_rad: Vec<Vec<f64>>,
    /// What the moving joints feel.
    pub readings: Vec<Reading>,
    /// Poses of one cell of the fastest joint's angle have the same number.
    pub cell: i64,
}

/// One moving joint in one pose, joint side unless named otherwise.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    pub joint: usize,
    pub direction: Direction,
    pub velocity_rad_s: f64,
    pub torque_nm: f64,
    /// The motor's angle at each sample of the pose.
    pub motor_rad: Vec<f64>,
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
        poses.extend(pose(run, &stretch));
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
fn pose(run: &Run, stretch: &Stretch) -> Option<Pose> {
    let rows = stretch.from..stretch.to.min(run.rows);
    if rows.len() < run.window_rows.max(1) {
        return None;
    }
    let mean = |values: &[f64]| values[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
    let count = rows.len().min(SAMPLES);
    let sampled: Vec<usize> = (0..count)
        .map(|sample| rows.start + (2 * sample + 1) * rows.len() / (2 * count))
        .collect();
    let at_samples = |values: &[f64]| sampled.iter().map(|row| values[*row]).collect();
    let readings: Vec<Reading> = run
        .joints
        .iter()
        .enumerate()
        .filter_map(|(joint, motion)| {
            Some(Reading {
                joint,
                direction: motion.direction[rows.start]?,
                velocity_rad_s: mean(&motion.velocity_rad_s),
                torque_nm: mean(&motion.torque_nm),
                motor_rad: at_samples(&motion.motor_position_rad),
            })
        })
        .collect();
    let fastest = readings
        .iter()
        .max_by(|a, b| a.velocity_rad_s.abs().total_cmp(&b.velocity_rad_s.abs()))?;
    let fastest_rad = mean(&run.joints[fastest.joint].position_rad);
    let angles = |row: &usize| {
        run.joints
            .iter()
            .map(|joint| joint.position_rad[*row])
            .collect()
    };
    Some(Pose {
        cell: (fastest_rad / FOLD_CELL_RAD).floor() as i64,
        samples_rad: sampled.iter().map(angles).collect(),
        readings,
    })
}
