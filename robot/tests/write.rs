//! Robots written as URDF, MuJoCo model and robot file are the same robots.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::fs;
use std::path::Path;

use robot::{Robot, Written, load};

/// Torques of a few motions, of the bodies as the file has them.
fn torques_nm(robot: &Robot) -> Vec<f64> {
    let count = robot.joints.len();
    let chain = robot.loaded_chain().unwrap();
    let mut all = Vec::new();
    for motion in 0..20 {
        let values = |part: usize, most: f64| -> Vec<f64> {
            let numbers =
                (0..count).map(|joint| 1.0 + (3 * count * motion + count * part + joint) as f64);
            numbers
                .map(|number| most * (2.0 * (number * 0.618_033_988_749_894_9).fract() - 1.0))
                .collect()
        };
        let mut torque_nm = vec![0.0; count];
        chain.inverse_dynamics(
            &values(0, 2.0),
            &values(1, 3.0),
            &values(2, 5.0),
            &mut torque_nm,
        );
        all.extend(torque_nm);
    }
    all
}

#[track_caller]
fn assert_same_dynamics(before: &Robot, after: &Robot) {
    assert_eq!(before.joint_names(), after.joint_names());
    let (ours, theirs) = (torques_nm(before), torques_nm(after));
    let largest = ours
        .iter()
        .fold(0.0_f64, |largest, value| largest.max(value.abs()));
    for (ours, theirs) in ours.iter().zip(&theirs) {
        assert!((ours - theirs).abs() < 1e-9 * largest, "{ours} {theirs}");
    }
}

fn written(robot: &Robot, extension: &str) -> Written {
    match extension {
        "urdf" => robot.to_urdf(),
        "xml" => robot.to_mjcf(),
        _ => robot.to_robot_file().unwrap(),
    }
}

/// The robot after it was written and read.
fn through(robot: &Robot, extension: &str, folder: &Path) -> Robot {
    let path = folder.join(format!("robot.{extension}"));
    fs::write(&path, written(robot, extension).text).unwrap();
    load(path.to_str().unwrap()).unwrap()
}

/// All robots that lie in the repository, those of tests and examples too.
fn robots() -> Vec<Robot> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut all = Vec::new();
    for folder in ["robots", "examples"] {
        for entry in fs::read_dir(root.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            // the others are plants, trajectories and effects
            if path.extension().is_some_and(|kind| kind == "toml")
                && fs::read_to_string(&path).unwrap().contains("[[link]]")
            {
                all.push(load(path.to_str().unwrap()).unwrap());
            }
        }
    }
    assert!(all.len() >= 3, "{}", all.len());
    all
}

/// Two branches, a joint that slides, frames turned to where roll and yaw are one, a payload and a ring.
const TREE: &str = r#"
name = "tree & leaf"
gravity_m_s2 = [0.3, 0.0, -9.8]
shared_effects = [{ effect = "payload", mass_kg = 0.7, centre_m = [0.1, 0.0, 0.2] }]
[[link]]
joint = "a"
origin_rpy_rad = [0.3, 1.5707963267948966, -0.4]
axis = [0.0, 2.0, 1.0]
mass_kg = 2.0
centre_of_mass_m = [0.01, 0.0, 0.2]
inertia_kg_m2 = { xx = 0.02, yy = 0.03, zz = 0.02, xy = 0.001, yz = -0.002, xz = 0.003 }
[[link]]
joint = "b"
kind = "prismatic"
origin_m = [0.0, 0.1, 0.3]
axis = [1.0, 0.0, 0.0]
mass_kg = 1.0
centre_of_mass_m = [0.0, 0.0, 0.0]
inertia_kg_m2 = { xx = 0.01, yy = 0.01, zz = 0.01 }
[[link]]
joint = "c"
parent = "a"
origin_m = [0.0, -0.1, 0.3]
origin_rpy_rad = [0.0, -1.5707963, 0.5]
axis = [0.0, 0.0, 1.0]
mass_kg = 0.0
centre_of_mass_m = [0.0, 0.0, 0.0]
inertia_kg_m2 = { xx = 0.0, yy = 0.0, zz = 0.0 }
[[link]]
joint = "d&<d"
axis = [0.0, 1.0, 0.0]
origin_m = [0.2, 0.0, 0.0]
mass_kg = 0.5
centre_of_mass_m = [0.0, 0.0, 0.1]
inertia_kg_m2 = { xx = 0.004, yy = 0.004, zz = 0.001 }
[[joint]]
name = "a"
gear_ratio = 100.0
rotor_inertia_kg_m2 = 1e-5
torque_limit_nm = 0.5
position_limit_rad = [-2.0, 1.0]
effects = [{ effect = "link_inertia", inertia_kg_m2 = 0.05 }, { effect = "coulomb_friction", coulomb_nm = 2.0 }]
[[joint]]
name = "b"
[[joint]]
name = "c"
[[joint]]
name = "d&<d"
velocity_limit_rad_s = 3.0
effects = [{ effect = "joint_spring", stiffness_nm_rad = 4.0, rest_rad = 0.3 }, { effect = "viscous_friction", viscous_nm_s_rad = 0.4 }]
"#;

fn tree(folder: &Path) -> Robot {
    let path = folder.join("tree.toml");
    fs::write(&path, TREE).unwrap();
    load(path.to_str().unwrap()).unwrap()
}

#[test]
fn every_robot_is_the_same_in_every_format_and_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut all = robots();
    all.push(tree(folder.path()));
    for robot in all {
        for extension in ["urdf", "xml", "toml"] {
            // URDF has no gravity of its own
            let mut robot = robot.clone();
            if extension == "urdf" {
                robot.chain.set_gravity([0.0, 0.0, -9.81].into()).unwrap();
            }
            let there = through(&robot, extension, folder.path());
            assert_same_dynamics(&robot, &there);
            let back = through(&there, "toml", folder.path());
            assert_same_dynamics(&robot, &back);
            let again = through(&back, extension, folder.path());
            assert_same_dynamics(&robot, &again);
        }
    }
}

#[test]
fn drives_come_back_as_far_as_a_format_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let robot = tree(folder.path());
    let urdf = through(&robot, "urdf", folder.path());
    assert_eq!(urdf.joints[0].gear_ratio, 100.0);
    assert_eq!(urdf.joints[0].torque_limit_nm, Some(0.5));
    assert_eq!(urdf.joints[0].position_limit_rad, Some([-2.0, 1.0]));
    assert_eq!(urdf.joints[0].effects, robot.joints[0].effects[1..]);
    let mjcf = through(&robot, "xml", folder.path());
    assert_eq!(mjcf.joints[0].rotor_inertia_kg_m2, 0.1);
    assert_eq!(mjcf.joints[0].torque_limit_nm, Some(50.0));
    assert_eq!(mjcf.joints[3].effects.len(), 2);
    assert_eq!(mjcf.chain.gravity_m_s2(), robot.chain.gravity_m_s2());
    let toml = through(&robot, "toml", folder.path());
    assert_eq!(toml.joints, robot.joints);
    assert_eq!(toml.shared_effects, robot.shared_effects);
    assert_eq!(toml.name, robot.name);
}

#[test]
fn what_a_format_cannot_hold_is_listed() {
    let pa10 = load("pa10").unwrap();
    let urdf = pa10.to_urdf().left_out.join("\n");
    for words in [
        "rotor inertia",
        "direction_friction",
        "control: URDF has no controller",
        "encoder steps",
    ] {
        assert!(urdf.contains(words), "{words}\n{urdf}");
    }
    let mjcf = pa10.to_mjcf().left_out.join("\n");
    for words in ["gear (", "load_torque", "no cycle from sample to command"] {
        assert!(mjcf.contains(words), "{words}\n{mjcf}");
    }
    let bench = load("shd17").unwrap().to_mjcf().left_out.join("\n");
    assert!(bench.contains("the tool's frame"), "{bench}");
    let folder = tempfile::tempdir().unwrap();
    let tree = tree(folder.path()).to_urdf().left_out.join("\n");
    assert!(tree.contains("gravity 0.3 0 -9.8"), "{tree}");
    assert!(tree.contains("d&<d: URDF has no joint_spring"), "{tree}");
}
