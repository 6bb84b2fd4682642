//! Where and how fast a joint may move in an experiment, from its robot file.

use robot::Robot;

use super::menu::Room;
use crate::error::CliError;

/// Furthest from the centre.
const REACH_RAD: f64 = 1.5;
/// Part of the velocity limit.
const SPEED_PART: f64 = 0.8;
/// Where the file tells no limit.
const SPEED_RAD_S: f64 = 1.0;
const ACCELERATION_RAD_S2: f64 = 5.0;
/// Part of the torque limit that may go into gravity, friction and acceleration.
const TORQUE_PART: f64 = 0.6;
/// Between these, whatever the torque allows.
const ACCELERATIONS_RAD_S2: [f64; 2] = [0.5, 20.0];
/// Poses at which gravity is looked at.
const POSES: usize = 41;

/// The room of a joint while all others hold.
///
/// # Errors
/// [`CliError::Input`] if there is none.
pub fn room(robot: &Robot, joint: usize) -> Result<Room, CliError> {
    let file = &robot.joints[joint];
    let centre_rad = motion::home_rad(file);
    let reach_rad = motion::swing_rad(file, centre_rad, REACH_RAD);
    let limit_rad_s = file.velocity_limit_rad_s.map(|limit| SPEED_PART * limit);
    let speed_rad_s = limit_rad_s.unwrap_or(SPEED_RAD_S);
    // false for NaN too
    if !(reach_rad > 0.0 && speed_rad_s > 0.0) {
        return Err(CliError::Input(format!(
            "robot `{}`, joint `{}`: position_limit_rad and velocity_limit_rad_s leave no room to move; widen them",
            robot.name, file.name
        )));
    }
    let poses_rad = (0..POSES).map(|pose| {
        let part = 2.0 * pose as f64 / (POSES - 1) as f64 - 1.0;
        centre_rad + part * reach_rad
    });
    let chain = robot.loaded_chain().map_err(CliError::input)?;
    let mut position_rad: Vec<f64> = robot.joints.iter().map(motion::home_rad).collect();
    let mut torque_nm = vec![0.0; robot.joints.len()];
    let loads: Vec<[f64; 2]> = poses_rad
        .map(|pose_rad| {
            position_rad[joint] = pose_rad;
            chain.gravity_torque(&position_rad, &mut torque_nm);
            [pose_rad, torque_nm[joint].abs()]
        })
        .collect();
    let by_load = |a: &&[f64; 2], b: &&[f64; 2]| a[1].total_cmp(&b[1]);
    let [light_rad, _] = *loads.iter().min_by(by_load).unwrap_or(&[centre_rad, 0.0]);
    let [heavy_rad, heavy_nm] = *loads.iter().max_by(by_load).unwrap_or(&[centre_rad, 0.0]);
    Ok(Room {
        centre_rad,
        reach_rad,
        speed_rad_s,
        acceleration_rad_s2: acceleration_rad_s2(robot, joint, speed_rad_s, heavy_nm),
        light_rad,
        heavy_rad,
    })
}

/// What the motor's torque allows beside gravity and friction.
fn acceleration_rad_s2(robot: &Robot, joint: usize, speed_rad_s: f64, gravity_nm: f64) -> f64 {
    let file = &robot.joints[joint];
    let Some(limit_nm) = file.torque_limit_nm else {
        return ACCELERATION_RAD_S2;
    };
    let count = robot.joints.len();
    let position_rad: Vec<f64> = robot.joints.iter().map(motion::home_rad).collect();
    let (rest, mut unit) = (vec![0.0; count], vec![0.0; count]);
    unit[joint] = 1.0;
    let [mut moved_nm, mut held_nm] = [vec![0.0; count], vec![0.0; count]];
    robot
        .chain
        .inverse_dynamics(&position_rad, &rest, &unit, &mut moved_nm);
    robot.chain.gravity_torque(&position_rad, &mut held_nm);
    let inertia_kg_m2 =
        moved_nm[joint] - held_nm[joint] + file.rotor_inertia_kg_m2 * file.gear_ratio.powi(2);
    let friction_nm = file.steady_friction().drag_nm(speed_rad_s, 0.0, 0.0, 0.0);
    let left_nm = TORQUE_PART * limit_nm * file.gear_ratio - gravity_nm - friction_nm;
    let [least, most] = ACCELERATIONS_RAD_S2;
    (left_nm / inertia_kg_m2).clamp(least, most)
}
