//! Chains out of URDF files.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::fs;
use std::path::Path;

use joint_model::rigid_body::JointKind;
use nalgebra::Vector3;
use robot::{Effect, Robot, RobotError, load, load_text};

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
fn the_nearest_inertia_is_taken_of_a_link_that_no_body_can_be() {
    let own = r#"<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>"#;
    let with = |izz: &str| {
        let flat = own.replace("izz=\"0.01\"", &format!("izz=\"{izz}\""));
        let robot = read(&ARM.replace(own, &flat)).unwrap();
        let inertia_kg_m2 = robot.chain.links()[1].inertia_kg_m2;
        (robot.notes, inertia_kg_m2.diagonal())
    };
    // the second moments are izz/2, izz/2 and 0.01 - izz/2: at 0.026 the last is -0.003, and becomes none
    let (notes, moments) = with("0.026");
    assert!(
        notes[0].contains("doubtful: no body has this inertia"),
        "{notes:?}"
    );
    let nearest = Vector3::new(0.013, 0.013, 0.026);
    assert!((moments - nearest).norm() < 1e-12, "{moments}");
    assert_eq!(with("0.02").0, Vec::<String>::new());
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
fn a_base_may_be_fixed_to_a_world_that_is_no_link_of_the_file() {
    let turned = "rpy=\"0 0 1.5707963267948966\"";
    for rpy in [turned, "rpy=\"1.5707963267948966 0 0\""] {
        let written = ARM.replace(turned, rpy);
        let implied = written.replace("  <link name=\"world\"/>\n", "");
        assert_ne!(written, implied);
        let origins = [&written, &implied].map(|text| {
            let robot = read(text).unwrap();
            robot.chain.links()[0].origin
        });
        assert_eq!(origins[0], origins[1], "{rpy}");
    }
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
fn what_is_no_tree_is_refused() {
    refused(
        "type=\"continuous\"",
        "type=\"helical\"",
        "joint `q2`: type helical is not known",
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
        "line 3, link `base`: not connected to the base",
    );
    refused(
        "<link name=\"world\"/>",
        "<link name=\"world\"/><link name=\"island\"/>",
        "several base links",
    );
    refused(
        "xyz=\"0 2 0\"",
        "xyz=\"0 0 0\"",
        "line 9, joint `q1`: axis [0.0, 0.0, 0.0] must not be zero",
    );
    refused(
        "xyz=\"0 2 0\"",
        "xyz=\"0 up 0\"",
        "line 9, axis in joint `q1`: xyz = \"0 up 0\" must be finite numbers",
    );
    refused("xyz=\"0 2 0\"", "xyz=\"0 2\"", "xyz has 2 numbers where 3");
    refused(
        "<mass value=\"0.5\"/>",
        "<mass value=\"-1\"/>",
        "link `lower`: mass -1 kg",
    );
    refused("<robot name", "<robt name", "not valid XML");
    refused("</robot>", "", "not valid XML");
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

/// Two branches, a gripper with a mimicking finger on one of them, and what drives are known to do.
const TREE: &str = r#"<?xml version="1.0"?>
<!-- written by hand -->
<robot name="two_arms">
  <link name="base"/>
  <link name="left"><inertial><origin xyz="0 0 0.1"/><mass value="1"/><inertia ixx="0.02" iyy="0.02" izz="0.01"/></inertial></link>
  <link name="right"><inertial><origin xyz="0 0 0.2"/><mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.01"/></inertial></link>
  <link name="f1"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial></link>
  <link name="f2"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial></link>
  <joint name="left" type="revolute"><parent link="base"/><child link="left"/><origin xyz="0 0.3 0"/><origin xyz="9 9 9"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="100" velocity="2"/><dynamics damping="2.0" friction="3.0"/></joint>
  <joint name="right" type="continuous"><parent link="base"/><child link="right"/><origin xyz="0 -0.3 0"/><axis xyz="0 1 0"/></joint>
  <joint name="finger" type="prismatic"><parent link="left"/><child link="f1"/><origin xyz="0 0 0.2"/><axis xyz="1 0 0"/></joint>
  <joint name="finger2" type="prismatic"><parent link="left"/><child link="f2"/><origin xyz="0 0 0.2"/><axis xyz="-1 0 0"/>
    <mimic joint="finger" multiplier="2" offset="0.01"/></joint>
  <transmission name="t"><joint name="left"><hardwareInterface>EffortJointInterface</hardwareInterface></joint>
    <actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator></transmission>
  <gazebo reference="left"/>
  <gazebo reference="right"/>
</robot>"#;

fn tree_with(robot: &str) -> Result<Robot, RobotError> {
    load_from(tempfile::tempdir().unwrap().path(), TREE, robot)
}

#[test]
fn a_urdf_is_a_robot() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["tree.urdf", "tree.txt"] {
        let path = folder.path().join(name);
        fs::write(&path, TREE).unwrap();
        let robot = load(path.to_str().unwrap()).unwrap();
        assert_eq!(robot.name, "two_arms");
        assert_eq!(robot.joint_names(), ["left", "finger", "right"]);
        assert!(robot.control.is_none());
        let parents: Vec<_> = robot.chain.links().iter().map(|link| link.parent).collect();
        assert_eq!(parents, [None, Some(0), None]);
        assert_eq!(robot.chain.links()[1].kind, JointKind::Prismatic);
        let (left, right) = (&robot.joints[0], &robot.joints[2]);
        assert_eq!((left.gear_ratio, right.gear_ratio), (50.0, 1.0));
        assert_eq!(left.torque_limit_nm, Some(2.0));
        assert_eq!(
            left.effects,
            [
                Effect::CoulombFriction { coulomb_nm: 3.0 },
                Effect::ViscousFriction {
                    viscous_nm_s_rad: 2.0
                },
            ]
        );
        assert_eq!(right.effects, []);
        let place = path.display();
        assert_eq!(
            robot.notes,
            [
                format!(
                    "{place}, line 9, origin in joint `left`: repeated; the first one counts, as in ROS"
                ),
                format!(
                    "{place}, line 17, gazebo in robot `two_arms`: <gazebo> is not read, 2 times"
                ),
                "held, as part of what carries them: `finger2` at 0.01 (mimics `finger`, which moves: its mass stays there)"
                    .to_owned(),
            ]
        );
    }
}

#[test]
fn a_urdf_is_written_as_the_robot_file_that_says_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree.urdf");
    fs::write(&path, TREE).unwrap();
    let (text, _) = load_text(path.to_str().unwrap()).unwrap();
    let written = folder.path().join("tree.toml");
    fs::write(&written, text).unwrap();
    let [one, other] = [path, written].map(|path| load(path.to_str().unwrap()).unwrap());
    assert_eq!(one.joints, other.joints);
    assert_eq!(one.notes, other.notes);
}

#[test]
fn joints_that_are_not_listed_are_held_where_the_file_says() {
    let robot = tree_with(
        "name = \"arm\"\nurdf = \"arm.urdf\"\nheld = { finger = 0.02 }\n[[joint]]\nname = \"left\"\ngear_ratio = 20\n",
    )
    .unwrap();
    assert_eq!(robot.joint_names(), ["left"]);
    let link = &robot.chain.links()[0];
    assert!((link.mass_kg - 1.2).abs() < 1e-15);
    // fingers at 0.02 and -(2·0.02 + 0.01)
    assert!((link.centre_of_mass_m.x - 0.1 * (0.02 - 0.05) / 1.2).abs() < 1e-15);
    assert_eq!(
        robot.notes.last().unwrap(),
        "held, as part of what carries them: `finger` at 0.02, `finger2` at 0.05 (mimics `finger`), `right` at 0"
    );
    // the file's ratio counts, and the effort is at the joint
    assert_eq!(robot.joints[0].gear_ratio, 20.0);
    assert_eq!(robot.joints[0].torque_limit_nm, Some(5.0));
    // what a joint carries weighs the same, held or not
    let whole = tree_with("name = \"arm\"\nurdf = \"arm.urdf\"\n").unwrap();
    assert_eq!(whole.joint_names(), ["left", "finger", "right"]);
    let mut torque_nm = [0.0; 3];
    whole
        .chain
        .gravity_torque(&[0.5, 0.02, 0.0], &mut torque_nm);
    let only = whole.moving_only(&["left", "elsewhere"]).unwrap();
    assert!(
        only.notes
            .last()
            .unwrap()
            .ends_with(": `finger` at 0, `right` at 0")
    );
    assert!(whole.moving_only(&["elsewhere"]).is_err());
    let mut held_nm = [0.0];
    only.chain.gravity_torque(&[0.5], &mut held_nm);
    // the finger 0.02 further out
    let finger_nm = -0.1 * 9.81 * 0.02 * 0.5_f64.cos();
    assert!((torque_nm[0] - held_nm[0] - finger_nm).abs() < 1e-12);
}

#[test]
fn friction_of_the_robot_file_counts_before_the_urdfs() {
    let robot = tree_with(
        "name = \"arm\"\nurdf = \"arm.urdf\"\n[[joint]]\nname = \"left\"\neffects = [{ effect = \"coulomb_friction\", coulomb_nm = 1.0 }]\n",
    )
    .unwrap();
    assert_eq!(
        robot.joints[0].effects,
        [
            Effect::CoulombFriction { coulomb_nm: 1.0 },
            Effect::ViscousFriction {
                viscous_nm_s_rad: 2.0
            },
        ]
    );
}

#[test]
fn slips_about_held_joints_are_named() {
    let held = |table: &str| {
        let text = format!(
            "name = \"arm\"\nurdf = \"arm.urdf\"\nheld = {{ {table} }}\n[[joint]]\nname = \"left\"\n"
        );
        tree_with(&text).unwrap_err().to_string()
    };
    assert!(held("fingr = 0.1").contains("did you mean `finger`?"));
    assert!(held("left = 0.1").contains("joint `left` has a [[joint]] table too"));
    assert!(held("finger = inf").contains("finger = inf must be a finite number"));
    let robot = "name = \"arm\"\nurdf = \"arm.urdf\"\n[[joint]]\nname = \"left\"\n";
    for leader in ["nobody", "finger2"] {
        let urdf = TREE.replace(
            "mimic joint=\"finger\"",
            &format!("mimic joint=\"{leader}\""),
        );
        let message = load_from(tempfile::tempdir().unwrap().path(), &urdf, robot).unwrap_err();
        let words = format!("line 13, joint `finger2`: mimics `{leader}`");
        assert!(message.to_string().contains(&words), "{message}");
    }
}

#[test]
fn macros_are_refused_with_the_command_that_expands_them() {
    let folder = tempfile::tempdir().unwrap();
    for start in [
        "<robot name=\"a\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\">",
        "<robot name=\"a\">",
    ] {
        let path = folder.path().join("arm.urdf.xacro");
        fs::write(
            &path,
            format!("{start}<xacro:include filename=\"b\"/></robot>"),
        )
        .unwrap();
        let message = load(path.to_str().unwrap()).unwrap_err().to_string();
        let command = format!(
            "xacro {} > {}",
            path.display(),
            folder.path().join("arm.urdf").display()
        );
        assert!(message.contains(&command), "{message}");
    }
    // the name space alone is what expanded files keep
    let expanded = ARM.replace(
        "<robot",
        "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\"",
    );
    assert!(read(&expanded).is_ok());
}

#[test]
fn a_humanoid_has_more_joints_than_the_loop_takes() {
    let mut urdf = "<robot name=\"many\"><link name=\"base\"/>".to_owned();
    for index in 0..29 {
        urdf += &format!(
            "<link name=\"l{index}\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\"/></inertial></link>\
             <joint name=\"q{index}\" type=\"continuous\"><parent link=\"base\"/><child link=\"l{index}\"/></joint>"
        );
    }
    urdf += "</robot>";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("many.urdf");
    fs::write(&path, urdf).unwrap();
    let robot = load(path.to_str().unwrap()).unwrap();
    assert_eq!(robot.joints.len(), 29);
    let message = robot.check_fits_loop().unwrap_err().to_string();
    assert!(
        message.contains("29 joints, the loop takes at most 16"),
        "{message}"
    );
    assert!(
        robot
            .moving_only(&["q3"])
            .unwrap()
            .check_fits_loop()
            .is_ok()
    );
}

#[test]
fn more_links_than_any_robot_has_are_refused_at_once() {
    let links: String = (0..100_000)
        .map(|index| format!("<link name=\"l{index}\"/>"))
        .collect();
    refused(
        "</robot>",
        &format!("{links}</robot>"),
        "more than 4096 links",
    );
    // each follows the one before it
    let mut chain = "<robot name=\"followers\"><link name=\"base\"/><link name=\"free\"/>\
        <joint name=\"free\" type=\"continuous\"><parent link=\"base\"/><child link=\"free\"/></joint>"
        .to_owned();
    for index in 0..4000 {
        chain += &format!(
            "<link name=\"l{index}\"/><joint name=\"q{index}\" type=\"prismatic\"><parent link=\"base\"/>\
             <child link=\"l{index}\"/><mimic joint=\"q{}\"/></joint>",
            (index + 1) % 4000
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("followers.urdf");
    fs::write(&path, chain + "</robot>").unwrap();
    let message = load(path.to_str().unwrap()).unwrap_err().to_string();
    assert!(message.contains(": mimics `q"), "{message}");
}
