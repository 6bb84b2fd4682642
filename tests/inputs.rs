//! Robots and logs as people have them, from the command line: each kind that once went wrong, with the right answer.
//!
//! The pendulum has 2 kg at 0.25 m, 0.025 kg m² about its centre, a rotor of 1e-5 kg m² behind 100:1, and 3.0 Nm of Coulomb and
//! 2.0 Nm s/rad of viscous friction, which no robot file here knows unless it says so.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod support;

use std::fmt::Write;
use std::fs;

use serde_json::Value;
use support::{Bench, output, text};

const PENDULUM: &str = r#"name = "pendulum"
[[link]]
joint = "shoulder"
axis = [0.0, 1.0, 0.0]
mass_kg = 2.0
centre_of_mass_m = [0.0, 0.0, -0.25]
inertia_kg_m2 = { xx = 0.025, yy = 0.025, zz = 0.004 }
[[joint]]
name = "shoulder"
gear_ratio = 100.0
rotor_inertia_kg_m2 = 1e-5
"#;

/// A motion and the torque at the joint that it takes without friction.
#[derive(Clone, Copy)]
struct Instant {
    time_s: f64,
    q: f64,
    v: f64,
    a: f64,
    /// Noise of 0.02 Nm at the joint.
    noise_nm: f64,
}

/// Three sines, `rate` rows a second.
fn motion(rows: usize, rate: f64) -> Vec<Instant> {
    let mut noise = 0.2_f64;
    let all = (0..rows).map(|row| {
        let time_s = row as f64 / rate;
        let [mut q, mut v, mut a] = [0.0; 3];
        for (place, [rate, rad]) in [[1.1, 0.6], [2.9, 0.3], [7.3, 0.1]].into_iter().enumerate() {
            let (sin, cos) = (rate * time_s + place as f64).sin_cos();
            q += rad * sin;
            v += rad * rate * cos;
            a -= rad * rate * rate * sin;
        }
        // chaos that fills the unit evenly
        noise = (noise * 997.0 + 0.137).fract();
        Instant {
            time_s,
            q,
            v,
            a,
            noise_nm: 0.07 * (noise - 0.5),
        }
    });
    all.collect()
}

fn friction_nm(v: f64) -> f64 {
    3.0 * (v / 0.01).tanh() + 2.0 * v
}

/// At the pendulum's joint; the rotor's inertia is 0.1 kg m² there.
fn torque_nm(at: &Instant) -> f64 {
    0.25 * at.a + 2.0 * 9.81 * 0.25 * at.q.sin() + friction_nm(at.v) + at.noise_nm
}

/// A table of the pendulum's position, velocity and torque on that side of the gear.
fn table(start_s: f64, ratio: f64) -> String {
    let mut log =
        "time_s,shoulder.link_position_rad,shoulder.link_velocity_rad_s,shoulder.motor_torque_nm\n"
            .to_owned();
    for at in motion(6000, 500.0) {
        let q = (at.q / 1e-5).round() * 1e-5;
        let _ = writeln!(
            log,
            "{:.9},{q:.5},{:.6},{:.9}",
            start_s + at.time_s,
            at.v,
            torque_nm(&at) / ratio
        );
    }
    log
}

fn plain() -> String {
    table(0.0, 100.0)
}

fn bench(name: &str, files: &[(&str, &str)]) -> Bench {
    let bench = Bench::new(name);
    for (name, text) in files {
        fs::write(bench.file(name), text).unwrap();
    }
    bench
}

/// Standard output and the first joint's report.
fn diagnosed(bench: &Bench, robot: &str, recording: &str) -> (String, Value) {
    let mut command = bench.flexspline();
    command.args([
        "gap",
        "diagnose",
        "--robot",
        robot,
        "--recording",
        recording,
        "--out",
        "gap",
    ]);
    let output = output(command);
    assert!(
        output.status.success(),
        "{robot} {recording}: {}",
        text(&output)
    );
    let report = fs::read(bench.file("gap/report.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    (told, report["joints"][0].clone())
}

fn names(joint: &Value) -> Vec<String> {
    let effects = joint["effects"].as_array().unwrap();
    effects
        .iter()
        .map(|effect| effect["effect"].as_str().unwrap().to_owned())
        .collect()
}

/// A parameter of an effect, a minor one too.
fn value(joint: &Value, effect: &str, parameter: &str) -> f64 {
    let lists = ["effects", "minor_effects"].map(|list| joint[list].as_array().unwrap());
    let mut all = lists.into_iter().flatten();
    let found = all.find(|found| found["effect"] == effect);
    let found = found.unwrap_or_else(|| panic!("no {effect} in {joint}"));
    found["parameters"][parameter]["value"].as_f64().unwrap()
}

#[track_caller]
fn near(found: f64, right: f64, within: f64) {
    assert!((found - right).abs() < within, "{found}, not {right}");
}

/// It is explained, most of it by Coulomb and viscous friction of this size.
#[track_caller]
fn friction_explains(joint: &Value, coulomb_nm: f64, viscous_nm_s_rad: f64) {
    assert_eq!(joint["verdict"], "explained", "{joint}");
    friction_is_most(joint, coulomb_nm, viscous_nm_s_rad);
}

fn friction_is_most(joint: &Value, coulomb_nm: f64, viscous_nm_s_rad: f64) {
    let mut largest = names(joint);
    largest.truncate(2);
    largest.sort();
    assert_eq!(largest, ["coulomb_friction", "viscous_friction"], "{joint}");
    near(
        value(joint, "coulomb_friction", "coulomb_nm"),
        coulomb_nm,
        0.2,
    );
    near(
        value(joint, "viscous_friction", "viscous_nm_s_rad"),
        viscous_nm_s_rad,
        0.2,
    );
}

#[test]
fn a_robot_file_beside_its_log_is_no_mapping() {
    let bench = bench("named", &[("arm.toml", PENDULUM), ("arm.csv", &plain())]);
    let (_, joint) = diagnosed(&bench, "arm.toml", "arm.csv");
    friction_explains(&joint, 3.0, 2.0);
}

#[test]
fn a_spreadsheet_with_decimal_commas_is_the_same_log() {
    let german = plain().replace(',', ";").replace('.', ",");
    let (heading, rows) = german.split_once('\n').unwrap();
    let german = format!("{}\n{rows}", heading.replace(',', "."));
    let bench = bench("comma", &[("arm.toml", PENDULUM), ("log.csv", &german)]);
    let (_, joint) = diagnosed(&bench, "arm.toml", "log.csv");
    friction_explains(&joint, 3.0, 2.0);
}

#[test]
fn time_may_be_since_1970() {
    let log = table(1_700_000_000.0, 100.0);
    let bench = bench("epoch", &[("arm.toml", PENDULUM), ("log.csv", &log)]);
    let (_, joint) = diagnosed(&bench, "arm.toml", "log.csv");
    friction_explains(&joint, 3.0, 2.0);
}

#[test]
fn a_controller_may_be_said_to_be_unknown_and_nothing_else() {
    let robot = format!("{PENDULUM}[control]\nkind = \"unknown\"\n");
    let bench = bench("unknown", &[("arm.toml", &robot), ("log.csv", &plain())]);
    let (_, joint) = diagnosed(&bench, "arm.toml", "log.csv");
    friction_explains(&joint, 3.0, 2.0);
}

/// The pendulum's URDF with something more in the joint, and more beside.
fn urdf(in_joint: &str, beside: &str) -> String {
    format!(
        r#"<robot name="r"><link name="base"/><link name="l1"><inertial><origin xyz="0 0 -0.25"/><mass value="2"/>
<inertia ixx="0.025" iyy="0.025" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 0"/>{in_joint}
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="100" velocity="3"/></joint>{beside}</robot>"#
    )
}

fn link(name: &str) -> String {
    format!(
        r#"<link name="{name}"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>"#
    )
}

#[test]
fn joints_that_nobody_recorded_are_held_and_said_once() {
    let finger = |name: &str, child: &str, more: &str| {
        format!(
            r#"{}<joint name="{name}" type="prismatic"><parent link="l1"/><child link="{child}"/><axis xyz="1 0 0"/>{more}</joint>"#,
            link(child)
        )
    };
    let gripper =
        finger("finger", "f1", "") + &finger("finger2", "f2", r#"<mimic joint="finger"/>"#);
    let branch = format!(
        r#"{}<joint name="other" type="revolute"><parent link="base"/><child link="l2"/><axis xyz="0 1 0"/></joint>"#,
        link("l2")
    );
    let log = table(0.0, 1.0);
    let files = [
        ("gripper.urdf", urdf("", &gripper)),
        ("tree.urdf", urdf("", &branch)),
    ];
    let bench = bench(
        "held",
        &[
            ("log.csv", &log),
            (files[0].0, &files[0].1),
            (files[1].0, &files[1].1),
        ],
    );
    for (file, held) in [
        ("gripper.urdf", "`finger` at 0"),
        ("tree.urdf", "`other` at 0"),
    ] {
        let (told, joint) = diagnosed(&bench, file, "log.csv");
        friction_explains(&joint, 3.0, 2.0);
        near(value(&joint, "rotor_inertia", "inertia_kg_m2"), 0.1, 0.01);
        assert_eq!(told.matches(held).count(), 1, "{told}");
    }
    // as a file says where
    let robot = "name = \"r\"\nurdf = \"gripper.urdf\"\nheld = { finger = 0.02 }\n";
    fs::write(bench.file("arm.toml"), robot).unwrap();
    let (told, _) = diagnosed(&bench, "arm.toml", "log.csv");
    assert!(
        told.contains("`finger` at 0.02") && told.contains("`finger2` at 0.02"),
        "{told}"
    );
}

#[test]
fn a_repeated_element_is_read_as_ros_reads_it() {
    let robot = urdf(r#"<origin xyz="0 0 9"/>"#, "");
    let bench = bench(
        "repeated",
        &[("arm.urdf", &robot), ("log.csv", &table(0.0, 1.0))],
    );
    let (told, joint) = diagnosed(&bench, "arm.urdf", "log.csv");
    friction_explains(&joint, 3.0, 2.0);
    assert!(told.contains("repeated; the first one counts"), "{told}");
}

#[test]
fn friction_of_a_urdf_is_known() {
    let robot = urdf(r#"<dynamics damping="2.0" friction="3.0"/>"#, "");
    let bench = bench(
        "dynamics",
        &[("arm.urdf", &robot), ("log.csv", &table(0.0, 1.0))],
    );
    let (_, joint) = diagnosed(&bench, "arm.urdf", "log.csv");
    assert_eq!(names(&joint), ["rotor_inertia"], "{joint}");
    near(value(&joint, "rotor_inertia", "inertia_kg_m2"), 0.1, 0.01);
}

#[test]
fn a_mujoco_model_tells_friction_and_controller_so_that_positions_are_enough() {
    let model = r#"<mujoco model="pendulum"><compiler angle="radian"/><option gravity="0 0 -9.81" timestep="0.002"/>
<default><joint armature="0.1" damping="0.5" frictionloss="0.2"/></default>
<worldbody><body name="l1"><joint name="shoulder" type="hinge" axis="0 1 0" range="-2 2"/>
<inertial pos="0 0 -0.25" mass="2" diaginertia="0.025 0.025 0.004"/></body></worldbody>
<actuator><position name="shoulder" joint="shoulder" kp="300" kv="30"/></actuator></mujoco>"#;
    let mut log = "time_s,shoulder.reference_position_rad,shoulder.link_position_rad\n".to_owned();
    let (mut q, mut v) = (0.0_f64, 0.0_f64);
    for at in motion(6000, 500.0) {
        let shown = (q / 1e-5).round() * 1e-5;
        let _ = writeln!(log, "{:.4},{:.9},{shown:.5}", at.time_s, at.q);
        let command_nm = 300.0 * (at.q - q) + 30.0 * (at.v - v);
        for _ in 0..20 {
            let a = (command_nm - friction_nm(v) - 2.0 * 9.81 * 0.25 * q.sin()) / 0.25;
            v += a * 1e-4;
            q += v * 1e-4;
        }
    }
    let bench = bench("mjcf", &[("arm.xml", model), ("log.csv", &log)]);
    let (_, joint) = diagnosed(&bench, "arm.xml", "log.csv");
    friction_is_most(&joint, 2.8, 1.5);
    // how friction turns round in this motion is a law of its own
    let left = joint["remaining_share"].as_f64().unwrap();
    assert!(left < 0.001, "{left}");
}

#[test]
fn an_axis_that_slides_without_gear_and_rotor_is_told_in_newton_and_metres() {
    let robot = r#"name = "axis"
gravity_m_s2 = [0, 0, 0]
[[link]]
joint = "slide"
axis = [0, 0, 1]
mass_kg = 90.0
centre_of_mass_m = [0, 0, 0]
inertia_kg_m2 = { xx = 90.0, yy = 90.0, zz = 90.0 }
[[joint]]
name = "slide"
"#;
    let mut log = "time_s,slide.motor_position_rad,slide.motor_torque_nm\n".to_owned();
    for at in motion(12000, 1000.0) {
        let friction = 20.0 * (at.v / 0.01).tanh() + 200.0 * at.v - 3.0;
        let _ = writeln!(
            log,
            "{:.4},{:.9},{:.6}",
            at.time_s,
            at.q,
            90.0 * at.a + friction + 5.0 * at.noise_nm
        );
    }
    let slides = robot.replace(
        "joint = \"slide\"",
        "joint = \"slide\"\nkind = \"prismatic\"",
    );
    let files = [
        ("axis_robot.toml", robot),
        ("slide_robot.toml", &slides),
        ("axis.csv", &log),
    ];
    let bench = bench("axis", &files);
    for (file, has_units) in [("axis_robot.toml", false), ("slide_robot.toml", true)] {
        let (told, joint) = diagnosed(&bench, file, "axis.csv");
        near(
            value(&joint, "viscous_friction", "viscous_nm_s_rad"),
            200.0,
            20.0,
        );
        near(value(&joint, "coulomb_friction", "coulomb_nm"), 20.0, 2.0);
        assert!(
            !names(&joint).contains(&"structural_damping".to_owned()),
            "{joint}"
        );
        assert_eq!(
            told.contains("it slides: read N for Nm"),
            has_units,
            "{told}"
        );
    }
}

#[test]
fn a_bare_gear_turned_by_hand_has_the_friction_that_it_has() {
    let robot = r#"name = "gear"
gravity_m_s2 = [0, 0, 0]
[[link]]
joint = "knee"
axis = [0, 0, 1]
mass_kg = 1e-6
centre_of_mass_m = [0, 0, 0]
inertia_kg_m2 = { xx = 1e-6, yy = 1e-6, zz = 1e-6 }
[[joint]]
name = "knee"
gear_ratio = 100
"#;
    let mut log =
        "time_s,knee.link_position_rad,knee.link_velocity_rad_s,knee.motor_torque_nm\n".to_owned();
    for at in motion(4000, 100.0) {
        let friction_nm = 1.5 * (at.v / 0.01).tanh() + 4.0 * at.v + 0.8 + 0.15 * (9.0 * at.q).sin();
        let _ = writeln!(
            log,
            "{:.3},{:.6},{:.6},{:.9}",
            at.time_s,
            at.q,
            at.v,
            (friction_nm + at.noise_nm) / 100.0
        );
    }
    let bench = bench("hand", &[("gear_robot.toml", robot), ("gear.csv", &log)]);
    let (_, joint) = diagnosed(&bench, "gear_robot.toml", "gear.csv");
    near(
        value(&joint, "viscous_friction", "viscous_nm_s_rad"),
        4.0,
        0.5,
    );
    near(value(&joint, "coulomb_friction", "coulomb_nm"), 1.5, 0.2);
    near(value(&joint, "torque_offset", "offset_nm").abs(), 0.8, 0.2);
}
