//! Commands and runs that the tests share.
#![allow(dead_code, reason = "each test binary uses some of it")]

use plant_emulator::{Plant, PlantCommand, PlantMode};

/// The control period of the shipped robots.
pub const PERIOD_S: f64 = 1.0 / 1500.0;

/// Motor torques, one a joint; the rest zero.
pub fn torque(motor_torque_nm: &[f64]) -> PlantCommand {
    let mut command = PlantCommand {
        mode: PlantMode::Torque,
        ..PlantCommand::default()
    };
    command.motor_torque_nm[..motor_torque_nm.len()].copy_from_slice(motor_torque_nm);
    command
}

/// Joint velocities, one a joint; the rest zero.
pub fn velocity(joint_velocity_rad_s: &[f64]) -> PlantCommand {
    let mut command = PlantCommand {
        mode: PlantMode::Velocity,
        ..PlantCommand::default()
    };
    command.joint_velocity_rad_s[..joint_velocity_rad_s.len()]
        .copy_from_slice(joint_velocity_rad_s);
    command
}

/// No torque and no brake: nothing but physics.
pub fn released() -> PlantCommand {
    torque(&[])
}

/// No torque; the brakes hold.
pub fn braked() -> PlantCommand {
    PlantCommand::default()
}

/// Short-circuited windings.
pub fn damping() -> PlantCommand {
    PlantCommand {
        mode: PlantMode::Damping,
        ..PlantCommand::default()
    }
}

/// The same command for so many periods.
pub fn run(plant: &mut Plant, command: &PlantCommand, periods: usize) {
    for _ in 0..periods {
        plant.step(command);
    }
}
