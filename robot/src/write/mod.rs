//! Robots written in other formats: what is written reads back as the same bodies, and what a format has no words for is listed.

mod mjcf;
mod toml;
mod urdf;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::{Effect, Part, Robot, RobotJoint};

/// A text in a format, and what that format could not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The text.
    pub text: String,
    /// What is missing in it, each in one line.
    pub left_out: Vec<String>,
}

/// A name that fits into an attribute of XML.
fn in_attribute(name: &str) -> String {
    name.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;")
}

/// Numbers between blanks, each with the digits that read back as the same.
fn numbers<'a>(values: impl IntoIterator<Item = &'a f64>) -> String {
    let all: Vec<String> = values.into_iter().map(f64::to_string).collect();
    all.join(" ")
}

fn vector(values: &Vector3<f64>) -> String {
    numbers(values.iter())
}

/// The upper half of a symmetric matrix.
struct Symmetric {
    xx: f64,
    yy: f64,
    zz: f64,
    xy: f64,
    xz: f64,
    yz: f64,
}

impl Symmetric {
    fn of(m: &Matrix3<f64>) -> Self {
        let mean = |row: usize, column: usize| 0.5 * (m[(row, column)] + m[(column, row)]);
        Self {
            xx: m[(0, 0)],
            yy: m[(1, 1)],
            zz: m[(2, 2)],
            xy: mean(0, 1),
            xz: mean(0, 2),
            yz: mean(1, 2),
        }
    }
}

/// Fixed-axis roll, pitch and yaw, exact also where two of the axes are one.
fn roll_pitch_yaw(turn: &UnitQuaternion<f64>) -> [f64; 3] {
    let m = turn.to_rotation_matrix();
    let yaw = m[(1, 0)].atan2(m[(0, 0)]);
    let (sin, cos) = yaw.sin_cos();
    let pitch = (-m[(2, 0)]).atan2(cos * m[(0, 0)] + sin * m[(1, 0)]);
    let roll = (sin * m[(0, 2)] - cos * m[(1, 2)]).atan2(cos * m[(1, 1)] - sin * m[(0, 1)]);
    [roll, pitch, yaw]
}

/// What no description of a robot has, of a joint.
fn beyond_descriptions(joint: &RobotJoint) -> Vec<&'static str> {
    let mut parts = Vec::new();
    let mut part = |is_there: bool, what| {
        if is_there {
            parts.push(what);
        }
    };
    part(joint.torque_constant_nm_a.is_some(), "torque constant");
    part(
        joint.motor_encoder_resolution_rad.is_some() || joint.link_encoder_resolution_rad.is_some(),
        "encoder steps",
    );
    part(
        joint.position_noise_rad != 0.0 || joint.torque_noise_nm != 0.0,
        "noise",
    );
    part(joint.direction_friction.is_some(), "direction_friction");
    part(joint.load_torque.is_some(), "load_torque");
    part(joint.friction_table.is_some(), "friction_table");
    part(!joint.torque_tables.is_empty(), "torque_tables");
    part(joint.estimators.is_some(), "estimators");
    parts
}

/// What each joint has that the format does not, the same of several joints once.
fn left_out_of_joints(
    robot: &Robot,
    format: &str,
    of_joint: impl Fn(&RobotJoint) -> Vec<String>,
) -> Vec<String> {
    let mut lists: Vec<(String, Vec<&str>)> = Vec::new();
    for joint in &robot.joints {
        let parts = beyond_descriptions(joint).into_iter().map(str::to_owned);
        let parts: Vec<String> = parts.chain(of_joint(joint)).collect();
        if parts.is_empty() {
            continue;
        }
        let parts = parts.join(", ");
        match lists.iter_mut().find(|(known, _)| *known == parts) {
            Some((_, joints)) => joints.push(&joint.name),
            None => lists.push((parts, vec![&joint.name])),
        }
    }
    lists
        .into_iter()
        .map(|(parts, joints)| format!("{}: {format} has no {parts}", joints.join(", ")))
        .collect()
}

/// Effects of a joint that are neither in the bodies nor among those that the format says.
fn unsaid(joint: &RobotJoint, says: impl Fn(&Effect) -> bool) -> Vec<String> {
    let others = joint.effects.iter();
    let others = others.filter(|effect| effect.part() != Part::Bodies && !says(effect));
    others.map(|effect| effect.name().to_owned()).collect()
}

/// The sum of a joint's friction of one kind.
fn sum_of(joint: &RobotJoint, value: impl Fn(&Effect) -> Option<f64>) -> f64 {
    joint.effects.iter().filter_map(value).sum()
}

fn coulomb_nm(effect: &Effect) -> Option<f64> {
    match effect {
        Effect::CoulombFriction { coulomb_nm } => Some(*coulomb_nm),
        _ => None,
    }
}

fn viscous_nm_s_rad(effect: &Effect) -> Option<f64> {
    match effect {
        Effect::ViscousFriction { viscous_nm_s_rad } => Some(*viscous_nm_s_rad),
        _ => None,
    }
}

/// What of the whole robot a description cannot say.
fn left_out_of_robot(robot: &Robot, format: &str) -> Vec<String> {
    let mut left_out = Vec::new();
    if robot.chain.tool() != nalgebra::Isometry3::identity() {
        left_out.push(format!(
            "the tool's frame: {format} as it is read here has none"
        ));
    }
    let others = robot.shared_effects.iter();
    let others = others.filter(|effect| !effect.is_whole_arm());
    left_out.extend(others.map(|effect| format!("{}: {format} has no such effect", effect.name())));
    left_out
}

/// The robot as its file has it, effects on the bodies in them.
fn loaded(robot: &Robot) -> joint_model::rigid_body::Chain {
    // a robot that was built has one
    robot.loaded_chain().unwrap_or_else(|_| robot.chain.clone())
}

/// Names of links: a link is called after its joint.
fn link_name(robot: &Robot, index: Option<usize>) -> String {
    let named = |index: usize| format!("{}_link", in_attribute(&robot.joints[index].name));
    index.map_or_else(|| "base".to_owned(), named)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn roll_pitch_and_yaw_come_back_also_where_they_are_degenerate() {
        for pitch in [0.3, FRAC_PI_2, -FRAC_PI_2, FRAC_PI_2 - 1e-9, 1.0, 3.0] {
            for roll in [0.0, 0.7, -2.5] {
                for yaw in [0.0, 1.9, -3.0] {
                    let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
                    let [roll, pitch, yaw] = roll_pitch_yaw(&turn);
                    let back = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
                    let apart = (turn.to_rotation_matrix().into_inner()
                        - back.to_rotation_matrix().into_inner())
                    .norm();
                    assert!(apart < 1e-14, "{roll} {pitch} {yaw}: {apart}");
                }
            }
        }
    }
}
