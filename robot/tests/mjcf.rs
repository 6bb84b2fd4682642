//! Robots out of MuJoCo models.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI};
use std::fs;
use std::path::Path;

use joint_model::rigid_body::JointKind;
use nalgebra::Vector3;
use robot::{ControlKind, Effect, Robot, RobotError, load};

fn load_from(folder: &Path, text: &str) -> Result<Robot, RobotError> {
    let path = folder.join("arm.xml");
    fs::write(&path, text).unwrap();
    load(path.to_str().unwrap())
}

fn read(text: &str) -> Result<Robot, RobotError> {
    load_from(tempfile::tempdir().unwrap().path(), text)
}

/// A model of this world, with what goes before it.
fn model(before: &str, world: &str) -> String {
    format!("<mujoco model=\"arm\">{before}<worldbody>{world}</worldbody></mujoco>")
}

#[track_caller]
fn refused(text: &str, words: &str) {
    let message = read(text).unwrap_err().to_string();
    assert!(
        message.contains(words) && message.contains("arm.xml") && !message.contains('\n'),
        "{message}"
    );
}

const PENDULUM: &str = r#"<mujoco model="pendulum"><compiler angle="radian"/><option gravity="0 0 -9.8" timestep="0.002"/>
<default><joint armature="0.1" damping="0.5" frictionloss="0.2"/></default>
<worldbody><body name="l1"><joint name="shoulder" type="hinge" axis="0 1 0" range="-2 2" stiffness="4" springref="0.5"/>
<inertial pos="0 0 -0.25" mass="2" diaginertia="0.025 0.025 0.004"/></body></worldbody>
<actuator><position name="shoulder" joint="shoulder" kp="300" kv="30" forcerange="-60 60"/></actuator></mujoco>"#;

#[test]
fn joints_and_actuators_say_what_drives_do() {
    let robot = read(PENDULUM).unwrap();
    assert_eq!(robot.name, "pendulum");
    assert_eq!(robot.chain.gravity_m_s2().z, -9.8);
    let joint = &robot.joints[0];
    assert_eq!((joint.gear_ratio, joint.rotor_inertia_kg_m2), (1.0, 0.1));
    assert_eq!(joint.position_limit_rad, Some([-2.0, 2.0]));
    assert_eq!(joint.torque_limit_nm, Some(60.0));
    assert_eq!(
        joint.effects,
        [
            Effect::CoulombFriction { coulomb_nm: 0.2 },
            Effect::ViscousFriction {
                viscous_nm_s_rad: 0.5
            },
            Effect::JointSpring {
                stiffness_nm_rad: 4.0,
                rest_rad: 0.5
            },
        ]
    );
    let control = robot.control.unwrap();
    assert_eq!(control.kind, ControlKind::PdFeedforward);
    assert_eq!((control.rate_hz, control.delay_cycles), (500.0, 0));
    assert_eq!(control.proportional_nm_rad, [300.0]);
    assert_eq!(control.derivative_nm_s_rad, [30.0]);
    assert!(robot.notes[0].contains("line 5, position `shoulder`: MuJoCo's kv"));
    let link = &robot.chain.links()[0];
    assert_eq!((link.mass_kg, link.centre_of_mass_m.z), (2.0, -0.25));
}

#[test]
fn a_robot_file_may_name_the_model_and_add_what_it_cannot_say() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arm.xml"), PENDULUM).unwrap();
    let path = folder.path().join("arm.toml");
    let text =
        "name = \"p\"\nmjcf = \"arm.xml\"\n[[joint]]\nname = \"shoulder\"\ngear_ratio = 100.0\n";
    fs::write(&path, text).unwrap();
    let robot = load(path.to_str().unwrap()).unwrap();
    // armature and force are at the joint, the file's values at the motor
    assert!((robot.joints[0].rotor_inertia_kg_m2 - 1e-5).abs() < 1e-20);
    assert!((robot.joints[0].torque_limit_nm.unwrap() - 0.6).abs() < 1e-15);
    assert_eq!(robot.control.unwrap().proportional_nm_rad, [300.0]);
    assert_eq!(robot.chain.gravity_m_s2().z, -9.8);
    fs::write(&path, format!("{text}[control]\nkind = \"unknown\"\n")).unwrap();
    assert!(load(path.to_str().unwrap()).unwrap().control.is_none());
    fs::write(&path, text.replace("mjcf", "urdf")).unwrap();
    let message = load(path.to_str().unwrap()).unwrap_err().to_string();
    assert!(
        message.contains("the first element is <mujoco>, not <robot>"),
        "{message}"
    );
}

#[test]
fn angles_are_degrees_unless_the_model_says_radians() {
    let world = r#"<body euler="90 0 0"><joint name="a" axis="0 1 0" range="-90 90" ref="30"/>
        <inertial pos="0 0 1" mass="1" diaginertia="0 0 0"/></body>"#;
    let robot = read(&model("", world)).unwrap();
    let [low, high] = robot.joints[0].position_limit_rad.unwrap();
    assert!((low + FRAC_PI_2).abs() < 1e-15 && (high - FRAC_PI_2).abs() < 1e-15);
    // at its reference the body stands as written: its z turned by 90° about x
    let tool = robot.chain.tool_pose(&[FRAC_PI_6]) * Vector3::z();
    assert!(
        (tool - Vector3::new(0.0, -1.0, 0.0)).norm() < 1e-12,
        "{tool}"
    );
    let radian = model(
        "<compiler angle=\"radian\"/>",
        &world.replace("90 0 0", "0 0 0"),
    );
    assert_eq!(
        read(&radian).unwrap().joints[0].position_limit_rad,
        Some([-90.0, 90.0])
    );
}

#[test]
fn orientations_may_be_written_in_any_way() {
    let ways = [
        ("", "quat=\"2 2 0 0\""),
        ("", "axisangle=\"3 0 0 90\""),
        ("", "xyaxes=\"2 0 0 1 0 1\""),
        ("", "zaxis=\"0 -3 0\""),
        ("<compiler eulerseq=\"zyx\"/>", "euler=\"0 0 90\""),
        ("<compiler eulerseq=\"XYZ\"/>", "euler=\"90 0 0\""),
        (
            "<compiler angle=\"radian\"/>",
            "euler=\"1.5707963267948966 0 0\"",
        ),
    ];
    for (before, way) in ways {
        let world = format!(
            "<body {way}><joint name=\"a\"/><inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/></body>"
        );
        let axis = read(&model(before, &world)).unwrap().chain.links()[0].origin * Vector3::z();
        assert!((axis + Vector3::y()).norm() < 1e-12, "{way}: {axis}");
    }
    // small letters turn along, capital ones stay
    let world = "<body euler=\"90 90 0\"><joint name=\"a\"/><inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/></body>";
    let turned = |sequence: &str| {
        let before = format!("<compiler eulerseq=\"{sequence}\"/>");
        read(&model(&before, world)).unwrap().chain.links()[0].origin * Vector3::x()
    };
    assert!(
        (turned("xyz") - Vector3::y()).norm() < 1e-12,
        "{}",
        turned("xyz")
    );
    assert!(
        (turned("XYZ") + Vector3::z()).norm() < 1e-12,
        "{}",
        turned("XYZ")
    );
}

#[test]
fn several_joints_of_a_body_follow_each_other() {
    let world = r#"<body name="cart"><joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
        <joint pos="0 0 1" axis="0 1 0"/><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/>
        <body name="other" pos="0 0 2"><joint type="ball"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body>"#;
    let robot = read(&model("", world)).unwrap();
    assert_eq!(robot.joint_names(), ["x", "y", "cart_joint3"]);
    let links = robot.chain.links();
    assert_eq!(
        links.iter().map(|link| link.kind).collect::<Vec<_>>(),
        [
            JointKind::Prismatic,
            JointKind::Prismatic,
            JointKind::Revolute
        ]
    );
    assert_eq!(
        links.iter().map(|link| link.mass_kg).collect::<Vec<_>>(),
        [0.0, 0.0, 4.0]
    );
    // hung at z = 1, seen from there: 3 kg at -1 and 1 kg at 1
    assert!((links[2].centre_of_mass_m.z + 0.5).abs() < 1e-15);
    assert!(robot.notes[0].contains("ball joint, taken as fixed where it stands"));
    let mut force_n = [0.0; 3];
    robot
        .chain
        .inverse_dynamics(&[0.0; 3], &[0.0; 3], &[2.0, 0.0, 0.0], &mut force_n);
    assert!((force_n[0] - 8.0).abs() < 1e-12);
}

#[test]
fn classes_are_inherited_and_overridden() {
    let before = r#"<compiler angle="radian"/><default class="all"><joint damping="1" armature="0.1"/>
        <default class="strong"><joint damping="2"/><default class="stronger"><joint frictionloss="5"/></default></default>
        <motor ctrlrange="-3 3"/></default>
        <actuator><motor joint="d" gear="20"/></actuator>"#;
    let inertial = "<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>";
    let world = format!(
        r#"<body><joint name="a"/>{inertial}<body childclass="strong"><joint name="b"/>{inertial}
        <frame childclass="stronger"><body><joint name="c"/>{inertial}</body></frame>
        <body><joint name="d" class="all" damping="7"/>{inertial}</body></body></body>"#
    );
    let robot = read(&model(before, &world)).unwrap();
    assert_eq!(robot.joint_names(), ["a", "b", "c", "d"]);
    let damping = |joint: usize| {
        let mut effects = robot.joints[joint].effects.iter();
        effects.find_map(|effect| match effect {
            Effect::ViscousFriction { viscous_nm_s_rad } => Some(*viscous_nm_s_rad),
            _ => None,
        })
    };
    assert_eq!([0, 1, 2, 3].map(damping), [1.0, 2.0, 2.0, 7.0].map(Some));
    assert!(
        robot
            .joints
            .iter()
            .all(|joint| joint.rotor_inertia_kg_m2 == 0.1)
    );
    assert_eq!(
        robot.joints[2].effects[0],
        Effect::CoulombFriction { coulomb_nm: 5.0 }
    );
    assert_eq!(robot.joints[3].torque_limit_nm, Some(60.0));
    assert_eq!(robot.control.unwrap().kind, ControlKind::OpenLoopTorque);
    refused(
        &model("", "<body><joint class=\"stron\"/></body>"),
        "unknown class `stron`",
    );
}

#[test]
fn bodies_without_inertial_weigh_what_their_geoms_do() {
    let weight = |geom: &str| {
        let world = format!("<body><joint name=\"a\"/>{geom}</body>");
        let robot = read(&model("", &world)).unwrap();
        let link = robot.chain.links()[0];
        let i = link.inertia_kg_m2;
        (link.mass_kg, [i[(0, 0)], i[(1, 1)], i[(2, 2)]])
    };
    let close = |(mass_kg, moments): (f64, [f64; 3]), expected_kg: f64, expected: [f64; 3]| {
        let off = moments
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() < 1e-12 * b);
        assert!(
            (mass_kg - expected_kg).abs() < 1e-12 * expected_kg && off,
            "{mass_kg} {moments:?}"
        );
    };
    let sphere_kg = 1000.0 * 4.0 / 3.0 * PI * 1e-3;
    close(
        weight("<geom size=\"0.1\"/>"),
        sphere_kg,
        [0.4 * sphere_kg * 0.01; 3],
    );
    close(
        weight("<geom type=\"box\" size=\"0.1 0.2 0.3\" mass=\"3\"/>"),
        3.0,
        [0.13, 0.10, 0.05],
    );
    close(
        weight("<geom type=\"ellipsoid\" size=\"0.1 0.2 0.3\" mass=\"5\"/>"),
        5.0,
        [0.13, 0.10, 0.05],
    );
    close(
        weight("<geom type=\"cylinder\" size=\"0.1\" fromto=\"0 0 -0.3 0 0 0.3\" mass=\"12\"/>"),
        12.0,
        [0.39, 0.39, 0.06],
    );
    // a capsule without length is a sphere, one without radius a rod
    let (short_kg, short) = weight("<geom type=\"capsule\" size=\"0.1 1e-9\"/>");
    assert!((short_kg / sphere_kg - 1.0).abs() < 1e-6 && (short[0] / short[2] - 1.0).abs() < 1e-6);
    let (_, rod) = weight("<geom type=\"capsule\" size=\"1e-6 0.5\" mass=\"12\"/>");
    assert!((rod[0] - 1.0).abs() < 1e-4 && rod[2] < 1e-9);
    let unseen =
        "<geom size=\"0.1\"/><geom size=\"9\" mass=\"0\"/><geom type=\"plane\" size=\"1 1 1\"/>";
    assert_eq!(weight(unseen).0, weight("<geom size=\"0.1\"/>").0);
    refused(
        &model(
            "",
            "<body><joint name=\"a\"/><geom name=\"g\" type=\"mesh\" mesh=\"m\"/></body>",
        ),
        "geom `g`: the inertia of a mesh is not computed",
    );
    refused(
        &model(
            "",
            "<body><joint name=\"a\"/><geom type=\"box\" size=\"1 1\"/></body>",
        ),
        "size of a box needs 3 numbers above zero",
    );
}

#[test]
fn the_compiler_changes_masses() {
    let world = "<body><joint name=\"a\"/><geom size=\"0.1\" mass=\"2\"/><inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 3\"/></body>";
    let link = |settings: &str| {
        let before = format!("<compiler {settings}/>");
        read(&model(&before, world)).map(|robot| robot.chain.links()[0])
    };
    assert!(
        link("")
            .unwrap_err()
            .to_string()
            .contains("no body has this inertia")
    );
    assert_eq!(link("inertiafromgeom=\"true\"").unwrap().mass_kg, 2.0);
    let balanced = link("balanceinertia=\"true\"").unwrap().inertia_kg_m2;
    assert!((balanced[(2, 2)] - 5.0 / 3.0).abs() < 1e-12);
    let bounded = link("boundmass=\"4\" boundinertia=\"2\"").unwrap();
    assert_eq!((bounded.mass_kg, bounded.inertia_kg_m2[(0, 0)]), (4.0, 2.0));
    let scaled = link("inertiafromgeom=\"true\" settotalmass=\"6\"").unwrap();
    assert!((scaled.mass_kg - 6.0).abs() < 1e-12);
    assert!((scaled.inertia_kg_m2[(0, 0)] - 6.0 * 0.4 * 0.01).abs() < 1e-12);
}

#[test]
fn files_are_included() {
    let folder = tempfile::tempdir().unwrap();
    let parts = folder.path().join("parts");
    fs::create_dir(&parts).unwrap();
    let body = "<mujocoinclude><body><joint name=\"a\"/>\n<inertial pos=\"0 0 0\" mass=\"-1\"/></body></mujocoinclude>";
    fs::write(parts.join("body.xml"), body.replace("-1", "1")).unwrap();
    let main = model(
        "<include file=\"parts/more.xml\"/>",
        "<include file=\"parts/body.xml\"/>",
    );
    fs::write(
        parts.join("more.xml"),
        "<m><option gravity=\"0 0 -1\"/></m>",
    )
    .unwrap();
    let robot = load_from(folder.path(), &main).unwrap();
    assert_eq!(
        (robot.joints.len(), robot.chain.gravity_m_s2().z),
        (1, -1.0)
    );
    fs::write(parts.join("body.xml"), body).unwrap();
    let message = load_from(folder.path(), &main).unwrap_err().to_string();
    assert!(message.contains("body.xml, line 2, inertial"), "{message}");
    fs::write(parts.join("more.xml"), "<m><include file=\"arm.xml\"/></m>").unwrap();
    let message = load_from(folder.path(), &main).unwrap_err().to_string();
    assert!(message.contains("arm.xml is included twice"), "{message}");
    refused(
        &model("<include file=\"none.xml\"/>", ""),
        "none.xml: cannot be read",
    );
}

#[test]
fn coupled_joints_are_held_and_loops_are_said() {
    let inertial = "<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>";
    let world = format!(
        "<body><joint name=\"a\"/>{inertial}</body><body><joint name=\"b.1\" type=\"slide\"/>{inertial}</body>"
    );
    let equality = |entries: &str| {
        let before = format!("<equality>{entries}</equality><tendon/>");
        read(&model(&before, &world))
    };
    let robot = equality("<joint joint1=\"b.1\" joint2=\"a\" polycoef=\"0.1 -1 0 0 0\"/>").unwrap();
    assert_eq!(robot.joint_names(), ["a"]);
    assert!(
        robot
            .notes
            .iter()
            .any(|note| note.ends_with("tendon: <tendon> is not read"))
    );
    assert!(
        robot
            .notes
            .iter()
            .any(|note| note.starts_with("joint \"b.1\" is called `b_1`"))
    );
    assert!(
        robot
            .notes
            .last()
            .unwrap()
            .contains("`b_1` at 0.1 (mimics `a`, which moves: its mass stays")
    );
    let robot =
        equality("<weld name=\"w\" body1=\"x\"/><joint joint1=\"a\" polycoef=\"0 0 1\"/>").unwrap();
    assert_eq!(robot.joint_names(), ["a", "b_1"]);
    assert!(robot.notes[0].contains("weld `w`: not read: it closes a loop"));
    assert!(
        equality("<joint joint1=\"c\"/>")
            .unwrap_err()
            .to_string()
            .contains("unknown joint `c`")
    );
}

#[test]
fn actuators_of_other_laws_leave_the_controller_unknown() {
    let inertial = "<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>";
    let world = format!(
        "<body><joint name=\"a\"/>{inertial}</body><body><joint name=\"b\"/>{inertial}</body>"
    );
    let control = |actuators: &str| {
        let before = format!("<actuator>{actuators}</actuator>");
        read(&model(&before, &world)).unwrap()
    };
    let general =
        "<general joint=\"a\" gear=\"2\" gainprm=\"50\" biastype=\"affine\" biasprm=\"0 -50 -5\"/>";
    let robot = control(&format!("{general}<position joint=\"b\" kp=\"7\"/>"));
    let law = robot.control.unwrap();
    assert_eq!(law.proportional_nm_rad, [200.0, 7.0]);
    assert_eq!(law.derivative_nm_s_rad, [20.0, 0.0]);
    let robot = control(&format!("{general}<motor joint=\"b\"/>"));
    assert!(robot.control.is_none());
    assert!(
        robot
            .notes
            .iter()
            .any(|note| note.contains("actuators of several kinds"))
    );
    let robot = control("<muscle joint=\"a\"/><motor tendon=\"t\"/>");
    assert!(robot.control.is_none());
    assert!(robot.notes[0].contains("its law is not one that is read"));
    assert!(robot.notes[1].contains("it drives no joint by itself"));
    // of a joint whose law is not known the gains are not zero
    let mixed = control("<muscle joint=\"a\"/><motor joint=\"b\"/><motor joint=\"b\"/>");
    assert!(mixed.control.is_none());
    assert!(mixed.notes[1].contains("its joint has another actuator"));
    let velocity = control("<velocity joint=\"a\" kv=\"3\"/>").control.unwrap();
    assert_eq!(velocity.kind, ControlKind::VelocityPi);
    assert_eq!(velocity.derivative_nm_s_rad, [3.0, 0.0]);
}

#[test]
fn slips_are_named_with_their_line() {
    let body = |inside: &str| model("", &format!("\n<body name=\"l\">{inside}</body>"));
    refused(&model("", ""), "no hinge or slide joint");
    refused(
        &body("<joint type=\"screw\"/>"),
        "line 2, joint in body `l`: type \"screw\"",
    );
    refused(
        &body("<joint name=\"a\" axis=\"0 0 0\"/>"),
        "axis [0.0, 0.0, 0.0] must not be zero",
    );
    refused(
        &body("<joint name=\"a\" damping=\"-1\"/>"),
        "damping = -1 must be zero or above",
    );
    refused(
        &body("<joint name=\"a\"/><inertial pos=\"0 0 0\"/>"),
        "mass is missing",
    );
    refused(
        &body("<joint name=\"a\"/><body><joint name=\"a\"/></body>"),
        "two joints are called `a`",
    );
    refused(
        &model("<compiler coordinate=\"global\"/>", ""),
        "coordinate = \"global\" is not read",
    );
    refused(
        &model("<compiler eulerseq=\"xy\"/>", ""),
        "eulerseq = \"xy\" must be three",
    );
    let deep = "<body>".repeat(100_000);
    refused(&format!("<mujoco><worldbody>{deep}"), "not valid XML");
    let closed = "</body>".repeat(100_000);
    refused(
        &model("", &format!("{deep}{closed}")),
        "nested deeper than 200",
    );
    refused("<sdf/>", "the first element is <sdf>");
}
