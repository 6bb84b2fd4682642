//! Commanded velocities: what the drives' own loops are asked for in identification, as the papers did.
//!
//! PA10-05 identifies friction in the servo driver's velocity mode: the drive holds the speed, the torque it takes is
//! read. Here the reference's velocity is sent, plus a slow correction of position that keeps the joint on its path.

use motion::Trajectory;
use robot::Robot;
use shm_types::messages::{Command, DriveMode, SensorSample};

use crate::reference::ReferenceSource;

/// Position errors die away over half a second: far below the drives' bandwidth, and at constant speed it adds nothing
/// but the drift it removes.
const POSITION_GAIN_S: f64 = 2.0;

/// The controller of one robot on one trajectory, in velocity mode.
#[derive(Clone, Debug)]
pub struct VelocityControl {
    gear_ratios: Vec<f64>,
    reference: ReferenceSource,
}

impl VelocityControl {
    /// A controller that follows `trajectory`.
    pub fn new(robot: &Robot, trajectory: Trajectory) -> Self {
        Self {
            gear_ratios: robot.joints.iter().map(|joint| joint.gear_ratio).collect(),
            reference: ReferenceSource::new(trajectory),
        }
    }

    /// The command that answers one sample. No allocation, no clock.
    pub fn command(&mut self, sample: &SensorSample) -> Command {
        let reference = self.reference.at(sample);
        let mut command = Command {
            header: sample.header,
            mode: DriveMode::Velocity as u32,
            reference_position_rad: reference.position_rad,
            reference_velocity_rad_s: reference.velocity_rad_s,
            reference_acceleration_rad_s2: reference.acceleration_rad_s2,
            ..Command::default()
        };
        for (joint, gear_ratio) in self.gear_ratios.iter().enumerate() {
            let position_rad = sample.readings.motor_position_rad[joint] / gear_ratio;
            let error_rad = reference.position_rad[joint] - position_rad;
            command.joint_velocity_rad_s[joint] =
                reference.velocity_rad_s[joint] + POSITION_GAIN_S * error_rad;
        }
        command
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_behind_its_reference_is_sent_faster() {
        let robot = robot::load("pa10").expect("shipped");
        let trajectory = motion::load("hold", &robot).expect("shipped");
        let mut reference = motion::Reference::default();
        trajectory.sample(0.0, &mut reference);
        let mut sample = SensorSample {
            motion_rate: 1.0,
            ..SensorSample::default()
        };
        for (joint, drive) in robot.joints.iter().enumerate() {
            sample.readings.motor_position_rad[joint] =
                drive.gear_ratio * (reference.position_rad[joint] - 0.01 * joint as f64);
        }
        let command = VelocityControl::new(&robot, trajectory).command(&sample);
        assert_eq!(command.mode, DriveMode::Velocity as u32);
        for joint in 0..7 {
            let expected_rad_s = POSITION_GAIN_S * 0.01 * joint as f64;
            assert!((command.joint_velocity_rad_s[joint] - expected_rad_s).abs() < 1e-12);
        }
    }
}
