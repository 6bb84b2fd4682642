//! Halving the substep changes the motion little, and less each time.

use super::Plant;
use crate::{PlantCommand, PlantMode, PlantParameters};

const PERIOD_S: f64 = 1.0 / 1500.0;

/// Joint positions and torques of half a second: off-and-on velocity commands with reversals, all joints.
fn motion(robot: &str, position_rad: &[f64], refinement: usize) -> (Vec<f64>, Vec<f64>) {
    let robot = robot::load(robot).expect("a shipped robot");
    let parameters = PlantParameters::for_robot(&robot).expect("a shipped plant file");
    let plant = Plant::new(&robot, &parameters, &[], 3, position_rad, PERIOD_S);
    let mut plant = plant.expect("a valid plant");
    plant.substeps *= refinement;
    let mut command = PlantCommand {
        mode: PlantMode::Torque,
        ..PlantCommand::default()
    };
    let holding_nm = plant.sample().motor_torque_nm;
    let (mut positions, mut torques) = (Vec::new(), Vec::new());
    for k in 0..750 {
        let swing = (12.0 * f64::from(k) * PERIOD_S).sin();
        for (joint, holding_nm) in holding_nm.iter().enumerate().take(position_rad.len()) {
            let limit_nm = robot.joints[joint].torque_limit_nm.unwrap_or(1.0);
            command.motor_torque_nm[joint] = holding_nm + 0.6 * limit_nm * swing;
        }
        plant.step(&command);
        let truth = plant.truth();
        positions.extend_from_slice(&truth.link_position_rad[..position_rad.len()]);
        torques.extend_from_slice(&truth.joint_torque_nm[..position_rad.len()]);
    }
    (positions, torques)
}

fn rms_difference(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (sum / a.len() as f64).sqrt()
}

#[test]
fn halving_the_substep_changes_little() {
    let bent_rad = [0.1, 0.7, -0.4, 0.9, 0.3, 0.6, -0.2];
    for (robot, position_rad) in [("pa10", &bent_rad[..]), ("shd17", &[0.5][..])] {
        let [once, twice, fourfold] =
            [1, 2, 4].map(|refinement| motion(robot, position_rad, refinement));
        let position_rad = rms_difference(&once.0, &twice.0);
        let torque_nm = rms_difference(&once.1, &twice.1);
        let finer_position_rad = rms_difference(&twice.0, &fourfold.0);
        println!(
            "{robot}: {position_rad:e} rad, {torque_nm:e} Nm, then {finer_position_rad:e} rad"
        );
        let moved_rad = once.0.iter().map(|angle| angle.abs()).fold(0.0, f64::max);
        assert!(
            position_rad < 1e-3 * moved_rad,
            "{robot}: {position_rad} rad of {moved_rad}"
        );
        assert!(
            finer_position_rad < 0.75 * position_rad,
            "{robot}: {finer_position_rad} after {position_rad}"
        );
    }
}
