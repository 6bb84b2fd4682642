//! The numbers of a robot file that a recording is checked against.

use recording::{CheckJoint, CheckRobot};
use robot::{Robot, RobotJoint};

/// What the checks need to know of a robot.
pub fn check_robot(robot: &Robot) -> CheckRobot {
    CheckRobot {
        name: robot.name.clone(),
        joints: robot.joints.iter().map(check_joint).collect(),
    }
}

fn check_joint(joint: &RobotJoint) -> CheckJoint {
    CheckJoint {
        name: joint.name.clone(),
        gear_ratio: joint.gear_ratio,
        position_limit_rad: joint.position_limit_rad,
        velocity_limit_rad_s: joint.velocity_limit_rad_s,
        torque_limit_nm: joint.torque_limit_nm,
        torque_constant_nm_a: joint.torque_constant_nm_a,
        motor_encoder_resolution_rad: joint.motor_encoder_resolution_rad,
        link_encoder_resolution_rad: joint.link_encoder_resolution_rad,
    }
}
