//! Chains out of URDF files.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::fs;
use std::path::Path;

use robot::{Robot, RobotError, load};

const ARM: &str = r#"<robot name="arm">
  <link name="world"/>
  <link name="base"><inertial><mass value="5"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0 0 0.1"/><mass value="1"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>
  <link name="plate"><inertial><origin xyz="0 0 0.1"/><mass value="1"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>
  <link name="lower"><inertial><mass value="0.5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="tip"/>
  <joint name="mount" type="fixed"><origin xyz="0 0 0.5" rpy="0 0 1.5707963267948966"/><parent link="world"/><child link="base"/></joint>
  <joint name="q1" type="revolute"><origin xyz="0.1 0 0"/><parent link="base"/><child link="upper"/><axis xyz="0 2 0"/><limit lower="-1" upper="1" effort="10" velocity="2"/></joint>
  <joint name="weld" type="fixed"><origin xyz="0 0 0.2"/><parent link="upper"/><child link="plate"/></joint>
  <joint name="q2" type="continuous"><origin xyz="0 0 0.3"/><parent link="plate"/><child link="lower"/><axis xyz="0 1 0"/></joint>
  <joint name="end" type="fixed"><origin xyz="0 0 0.2"/><parent link="lower"/><child link="tip"/></joint>
</robot>"#;

const ROBOT: &str = r#"
name = "arm"
urdf = "arm.urdf"
[[joint]]
name = "q2"
gear_ratio = 50.0
rotor_inertia_kg_m2 = 1e-5
[[joint]]
name = "q1"
gear_ratio = 100.0
rotor_inertia_kg_m2 = 1e-5
"#;

fn load_from(folder: &Path, urdf: &str, robot: &str) -> Result<Robot, RobotError> {
    fs::write(folder.join("arm.urdf"), urdf).unwrap();
    fs::write(folder.join("arm.toml"), robot).unwrap();
    load(folder.join("arm.toml").to_str().unwrap())
}

fn read(urdf: &str) -> Result<Robot, RobotError> {
    load_from(tempfile::tempdir().unwrap().path(), urdf, ROBOT)
}

#[track_caller]
fn refused(part: &str, replacement: &str, words: &str) {
    assert!(ARM.contains(part), "{part}");
    let message = read(&ARM.replace(part, replacement))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains(words) && message.contains("arm.urdf") && !message.contains('\n'),
        "{message}"
    );
}

#[test]
fn fixed_joints_merge_into_what_they_hang_on() {
    let robot = read(ARM).unwrap();
    assert_eq!(
        robot
            .joints
            .iter()
            .map(|joint| joint.name.as_str())
            .collect::<Vec<_>>(),
        ["q1", "q2"]
    );
    let upper = &robot.chain.links()[0];
    // Two equal bodies 0.2 m apart along z: centre between them, 2·1 kg·(0.1 m)² more about x and y.
    assert_eq!(upper.mass_kg, 2.0);
    assert!((upper.centre_of_mass_m.z - 0.2).abs() < 1e-12);
    assert!((upper.inertia_kg_m2[(0, 0)] - (0.04 + 0.02)).abs() < 1e-12);
    assert!((upper.inertia_kg_m2[(2, 2)] - 0.02).abs() < 1e-12);
    // The mount lifts and turns the first joint, the weld moves the second.
    assert!(
        (upper.origin.translation.vector - nalgebra::Vector3::new(0.0, 0.1, 0.5)).norm() < 1e-12
    );
    assert!((upper.axis.y - 1.0).abs() < 1e-12);
    assert!((robot.chain.links()[1].origin.translation.z - 0.5).abs() < 1e-12);
}

#[test]
fn limits_come_from_the_urdf_unless_the_robot_file_has_them() {
    let robot = read(ARM).unwrap();
    assert_eq!(robot.joints[0].position_limit_rad, Some([-1.0, 1.0]));
    assert_eq!(robot.joints[0].velocity_limit_rad_s, Some(2.0));
    assert_eq!(robot.joints[1].position_limit_rad, None);
    let own_limit = ROBOT.replace(
        "gear_ratio = 100.0",
        "gear_ratio = 100.0\nposition_limit_rad = [-0.5, 0.5]",
    );
    let robot = load_from(tempfile::tempdir().unwrap().path(), ARM, &own_limit).unwrap();
    assert_eq!(robot.joints[0].position_limit_rad, Some([-0.5, 0.5]));
}

#[test]
fn other_topologies_are_refused() {
    refused(
        "type=\"continuous\"",
        "type=\"prismatic\"",
        "joint `q2`: type prismatic is not supported",
    );
    refused(
        "<parent link=\"plate\"/>",
        "<parent link=\"base\"/>",
        "all hang on link `world`",
    );
    refused(
        "<parent link=\"plate\"/>",
        "<parent link=\"plane\"/>",
        "did you mean `plate`?",
    );
    refused(
        "<child link=\"tip\"/>",
        "<child link=\"upper\"/>",
        "link `upper` has two parents",
    );
    refused(
        "<parent link=\"world\"/>",
        "<parent link=\"tip\"/>",
        "not connected to the base",
    );
    refused(
        "<link name=\"world\"/>",
        "<link name=\"world\"/><link name=\"island\"/>",
        "several base links",
    );
    refused(
        "xyz=\"0 2 0\"",
        "xyz=\"0 0 0\"",
        "axis [0.0, 0.0, 0.0] must be finite and not zero",
    );
    refused(
        "<mass value=\"0.5\"/>",
        "<mass value=\"-1\"/>",
        "link `lower`",
    );
    refused("<robot name", "<robt name", "not a valid URDF");
    refused("</robot>", "", "not a valid URDF");
}

#[test]
fn a_loop_apart_from_the_base_is_refused() {
    let ring = r#"<link name="a"/><link name="b"/>
      <joint name="ab" type="fixed"><parent link="a"/><child link="b"/></joint>
      <joint name="ba" type="fixed"><parent link="b"/><child link="a"/></joint></robot>"#;
    refused("</robot>", ring, "not connected to the base");
}

#[test]
fn joints_of_urdf_and_robot_file_must_match() {
    let folder = tempfile::tempdir().unwrap();
    let message = load_from(folder.path(), ARM, &ROBOT.replace("\"q2\"", "\"q22\""))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("joint `q22`") && message.contains("did you mean `q2`?"),
        "{message}"
    );
    let message = load_from(folder.path(), ARM, &ROBOT.replace("arm.urdf", "arn.urdf"))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("arn.urdf: cannot be read") && message.contains("relative to itself"),
        "{message}"
    );
}
