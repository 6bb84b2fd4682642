//! Links that weigh other than a robot says: written into every kind of file, they read back as they were meant, and what is made of
//! bodies is one still.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::fs;
use std::path::{Path, PathBuf};

use joint_model::rigid_body::{Link, is_inertia_of_a_body};
use robot::{Effect, MassChange, Robot, RobotFile, Simulator, SimulatorFile, Source, load};

/// An inertial frame that is turned, a tool of two fixed links, a gripper that is held, and a link without mass.
const URDF: &str = r#"<robot name="arm">
  <link name="base"><inertial><mass value="9"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
  <!-- what the user wrote stays -->
  <link name="upper">
    <inertial><origin xyz="0.01 0 -0.25" rpy="0.3 -0.2 0.9"/><mass value="2.0"/>
      <inertia ixx="0.025" iyy="0.02" izz="0.01" ixy="0.001" ixz="-0.002" iyz="0.0005"/></inertial>
  </link>
  <link name="lower">
    <inertial><mass value="1.5"/><inertia ixx="0.01" iyy="0.012" izz="0.004"/></inertial>
  </link>
  <link name="mount"/>
  <link name="tool">
    <inertial><origin rpy="0 1.1 0"/><mass value="0.4"/><inertia ixx="0.001" iyy="0.0008" izz="0.0005" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="finger">
    <inertial><origin xyz="0 0.02 0"/><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="100" velocity="10"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="lower"/><origin xyz="0 0.1 -0.5" rpy="0.2 0 0.4"/><axis xyz="0 1 0.2"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/>
  </joint>
  <joint name="flange" type="fixed"><parent link="lower"/><child link="mount"/><origin xyz="0.1 0 -0.3" rpy="0 0.7 0"/></joint>
  <joint name="screws" type="fixed"><parent link="mount"/><child link="tool"/><origin xyz="0 0 -0.1" rpy="1 0 0"/></joint>
  <joint name="slide" type="prismatic">
    <parent link="tool"/><child link="finger"/><origin xyz="0 0 -0.1"/><axis xyz="1 0 0"/><limit lower="0" upper="0.1" effort="9" velocity="1"/>
  </joint>
</robot>
"#;

const MODEL: &str = r#"<mujoco model="arm">
  <compiler angle="radian"/>
  <!-- what the user wrote stays -->
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" pos="0 0.05 0.01"/>
      <inertial pos="0.01 0 -0.25" euler="0.3 -0.2 0.9" mass="2" diaginertia="0.025 0.02 0.01"/>
      <geom type="box" size="0.1 0.1 0.1"/>
      <body name="lower" pos="0 0.1 -0.5" euler="0.2 0 0.4">
        <joint name="elbow" axis="0 1 0.2" pos="0 0.1 0"/>
        <joint name="twist" axis="0 0 1" pos="0.02 0 0"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0.1 0 -0.3"/>
        <geom type="box" size="0.02 0.03 0.05" pos="0.1 0 -0.3" euler="0 0.7 0"/>
        <body name="tool" pos="0.1 0 -0.35" euler="1 0 0">
          <geom type="cylinder" size="0.02 0.05" density="700"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"#;

const TABLES: &str = "shared_effects = [{ effect = \"payload\", mass_kg = 1.2, centre_m = [0.1, 0.02, -0.4] }]\n\
     [[joint]]\nname = \"shoulder\"\neffects = [{ effect = \"link_inertia\", inertia_kg_m2 = 0.03 }]\n\
     [[joint]]\nname = \"elbow\"\n";

/// Of all joints but the gripper's; a link without mass has no centre to be elsewhere.
fn changes(robot: &Robot) -> Vec<MassChange> {
    let names = robot.joint_names().into_iter();
    let names: Vec<&str> = names.filter(|name| *name != "slide").collect();
    let moving = robot.moving_only(&names).unwrap();
    let chain = moving.loaded_chain().unwrap();
    let joints = moving.joints.iter().zip(chain.links()).zip([0.0, 1.0, 2.0]);
    let change = |((joint, link), k): ((&robot::RobotJoint, &Link), f64)| MassChange {
        joint: joint.name.clone(),
        mass_kg: (0.37 - 0.4 * k) * link.mass_kg,
        centre_of_mass_m: [0.013 * k, -0.021, 0.017],
        inertia_part: 0.41 - 0.3 * k,
    };
    joints
        .map(change)
        .map(|mut change| {
            if change.mass_kg == 0.0 {
                change.centre_of_mass_m = [0.0; 3];
            }
            change
        })
        .collect()
}

/// Link by link as the file had it, with what hangs on it, and the change.
fn reads_back(before: &Robot, after: &Robot, changes: &[MassChange]) {
    let names: Vec<&str> = changes.iter().map(|change| change.joint.as_str()).collect();
    let chain = |robot: &Robot| robot.moving_only(&names).unwrap().loaded_chain().unwrap();
    let (before, after) = (chain(before), chain(after));
    let near = |found: f64, wanted: f64, size: f64| {
        assert!(
            (found - wanted).abs() <= 1e-9 * size,
            "{found} {wanted} of {size}"
        );
    };
    for ((before, after), change) in before.links().iter().zip(after.links()).zip(changes) {
        near(
            after.mass_kg,
            before.mass_kg + change.mass_kg,
            before.mass_kg,
        );
        let wanted_m = before.centre_of_mass_m + nalgebra::Vector3::from(change.centre_of_mass_m);
        let wanted_kg_m2 = before.inertia_kg_m2 * (1.0 + change.inertia_part);
        // what weighs nothing has no centre
        for k in 0..if after.mass_kg > 0.0 { 3 } else { 0 } {
            near(after.centre_of_mass_m[k], wanted_m[k], wanted_m.norm());
        }
        for k in 0..9 {
            near(after.inertia_kg_m2[k], wanted_kg_m2[k], wanted_kg_m2.norm());
        }
    }
}

struct Files(tempfile::TempDir);

impl Files {
    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    /// Writes a robot with other links into a simulator's file, and reads that.
    fn through(&self, from: &str, simulator: Simulator, out: &str) -> String {
        let robot = load(from).unwrap();
        let changes = changes(&robot);
        let names: Vec<&str> = changes.iter().map(|change| change.joint.as_str()).collect();
        let moving = robot.moving_only(&names).unwrap();
        let by = moving.reshaping(&changes).unwrap();
        let out = self.path(out);
        let file = SimulatorFile::with_links(&moving, Some(&by), from, simulator, Path::new(&out));
        let text = file.unwrap().text().unwrap();
        fs::write(&out, &text).unwrap();
        reads_back(&robot, &load(&out).unwrap(), &changes);
        text
    }
}

fn files() -> Files {
    Files(tempfile::tempdir().unwrap())
}

#[test]
fn a_urdf_keeps_frames_and_fixed_links_and_each_has_its_part() {
    let files = files();
    let from = files.write("arm.urdf", URDF);
    let text = files.through(&from, Simulator::Urdf, "new.urdf");
    assert!(
        text.contains("<!-- what the user wrote stays -->")
            && text.contains("<link name=\"mount\"/>")
    );
    assert!(
        text.contains("rpy=\"0.3 -0.2 0.9\"") && text.contains("<mass value=\"9\"/>"),
        "{text}"
    );
    // what nothing is told of stays to the byte
    let robot = load(&from).unwrap();
    let none: Vec<MassChange> = robot
        .joints
        .iter()
        .map(|joint| MassChange {
            joint: joint.name.clone(),
            mass_kg: 0.0,
            centre_of_mass_m: [0.0; 3],
            inertia_part: 0.0,
        })
        .collect();
    let by = robot.reshaping(&none).unwrap();
    let out = files.path("same.urdf");
    let file =
        SimulatorFile::with_links(&robot, Some(&by), &from, Simulator::Urdf, Path::new(&out));
    assert_eq!(file.unwrap().text().unwrap(), URDF);
}

#[test]
fn a_mujoco_model_gets_an_inertial_where_geoms_weigh() {
    let files = files();
    let from = files.write("arm.xml", MODEL);
    let text = files.through(&from, Simulator::Mjcf, "new.xml");
    assert!(
        text.contains("euler=\"0.3 -0.2 0.9\"") && text.contains("stays -->"),
        "{text}"
    );
    assert_eq!(text.matches("<inertial").count(), 3, "{text}");
    // whatever its compiler does to masses
    for (key, value) in [
        ("inertiafromgeom", "true"),
        ("settotalmass", "7"),
        ("boundmass", "3"),
        ("boundinertia", "0.05"),
        ("balanceinertia", "true"),
        ("inertiafromgeom", "false"),
    ] {
        let compiler = format!("<compiler angle=\"radian\" {key}=\"{value}\"/>");
        let from = files.write(
            "odd.xml",
            &MODEL.replace("<compiler angle=\"radian\"/>", &compiler),
        );
        files.through(&from, Simulator::Mjcf, "new.xml");
    }
}

#[test]
fn a_robot_of_another_kind_is_converted_with_its_links_and_what_hangs_on_them() {
    let files = files();
    files.write("arm.urdf", URDF);
    let from = files.write(
        "arm.toml",
        &format!("name = \"arm\"\nurdf = \"arm.urdf\"\n{TABLES}"),
    );
    files.through(&from, Simulator::Mjcf, "new.xml");
    // the payload is a link of its own in a URDF, of six digits
    let robot = load(&from).unwrap();
    let by = robot.reshaping(&changes(&robot)).unwrap();
    let reshaped = robot.reshaped(&by).unwrap();
    reads_back(&robot, &reshaped, &changes(&robot));
    let Effect::Payload { mass_kg, .. } = reshaped.shared_effects[0] else {
        panic!("{:?}", reshaped.shared_effects);
    };
    assert!(mass_kg > 0.0 && mass_kg != 1.2, "{mass_kg}");
}

#[test]
fn the_description_of_a_robot_file_gets_other_links_and_keeps_the_rest() {
    let files = files();
    for (name, text, key) in [("arm.urdf", URDF, "urdf"), ("arm.xml", MODEL, "mjcf")] {
        files.write(name, text);
        let held = if key == "urdf" {
            "held = { slide = 0.03 }\n"
        } else {
            ""
        };
        let tables = if key == "urdf" { TABLES } else { "" };
        let toml = |name: &str| format!("name = \"arm\"\n{key} = \"{name}\"\n{held}{tables}");
        let from = files.write("arm.toml", &toml(name));
        let robot = load(&from).unwrap();
        let changes = changes(&robot);
        let by = robot.reshaping(&changes).unwrap();
        let file = RobotFile::parse(&toml(name), "arm.toml").unwrap();
        let source = Source::File(PathBuf::from(&from));
        let new = robot::reshaped_description(&file, &source, &by, Path::new(&files.path("new")));
        files.write(&format!("new_{name}"), &new.unwrap().unwrap());
        let mut file = RobotFile::parse(&toml(&format!("new_{name}")), "new.toml").unwrap();
        // effects stand in the robot file
        for effect in &mut file.shared_effects {
            *effect = by.effect(None, effect);
        }
        for joint in &mut file.joints {
            let index = robot.joint_index(&joint.name);
            for effect in &mut joint.effects {
                *effect = by.effect(index, effect);
            }
        }
        let source = Source::File(PathBuf::from(files.path("new.toml")));
        let mended = file.build(source).unwrap();
        reads_back(&robot, &mended, &changes);
        for (before, after) in robot.joints.iter().zip(&mended.joints) {
            assert_eq!(before.position_limit_rad, after.position_limit_rad);
        }
    }
}

#[test]
fn bodies_stay_bodies_and_what_none_can_be_is_refused() {
    let files = files();
    let robot = load(&files.write("arm.urdf", URDF)).unwrap();
    let mut all = changes(&robot);
    all[0].mass_kg = -1.9999;
    all[0].inertia_part = 3.0;
    let reshaped = robot.reshaped(&robot.reshaping(&all).unwrap()).unwrap();
    for link in reshaped.chain.links() {
        assert!(link.mass_kg > 0.0 && is_inertia_of_a_body(&link.inertia_kg_m2));
    }
    for (mass_kg, inertia_part) in [
        (-2.0, 0.0),
        (0.0, -1.0),
        (f64::NAN, 0.0),
        (0.0, f64::INFINITY),
    ] {
        all[0].mass_kg = mass_kg;
        all[0].inertia_part = inertia_part;
        let refused = robot.reshaping(&all).unwrap_err().to_string();
        assert!(
            refused.contains("shoulder") && !refused.contains('\n'),
            "{refused}"
        );
    }
    all[0].joint = "wrist".to_owned();
    let refused = robot.reshaping(&all).unwrap_err().to_string();
    assert!(refused.contains("wrist"), "{refused}");
}
