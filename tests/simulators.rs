//! Robots and effects in the formats of other simulators: `robot init|check|convert`, `gap apply --format`, and the simulator
//! beside the robot.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod support;

use std::fs;

use serde_json::Value;
use support::{Bench, output, text};

const MODEL: &str = r#"<mujoco model="arm">
  <compiler angle="radian"/>
  <!-- the user's own words -->
  <worldbody>
    <body name="upper">
      <joint name="shoulder" type="hinge" axis="0 1 0" armature="0.1" damping="0.5"/>
      <inertial pos="0 0 -0.25" mass="2" diaginertia="0.025 0.025 0.004"/>
    </body>
  </worldbody>
  <actuator><motor name="m" joint="shoulder"/></actuator>
</mujoco>
"#;

const URDF: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <inertial>
      <origin xyz="0 0 -0.25"/><mass value="2.0"/>
      <inertia ixx="0.025" iyy="0.025" izz="0.004" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/>
  </joint>
</robot>
"#;

fn bench(name: &str) -> Bench {
    let bench = Bench::new(name);
    fs::write(bench.file("arm.xml"), MODEL).unwrap();
    fs::write(bench.file("arm.urdf"), URDF).unwrap();
    bench
}

/// What a command says on each of its outputs, and how it ends.
fn says(bench: &Bench, arguments: &str) -> (i32, String, String) {
    let mut command = bench.flexspline();
    command.args(arguments.split_whitespace());
    let output = output(command);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.code().unwrap(),
        text(&output.stdout),
        text(&output.stderr),
    )
}

fn works(bench: &Bench, arguments: &str) -> String {
    let mut command = bench.flexspline();
    command.args(arguments.split_whitespace());
    let output = output(command);
    assert!(output.status.success(), "{arguments}: {}", text(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Ends with this code and one line that has these words.
fn ends(bench: &Bench, arguments: &str, code: i32, words: &[&str]) {
    let (ended, _, message) = says(bench, arguments);
    assert_eq!(ended, code, "{arguments}: {message}");
    assert_eq!(message.trim_end().lines().count(), 1, "one line: {message}");
    for part in words {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

fn json(bench: &Bench, name: &str) -> Value {
    serde_json::from_slice(&fs::read(bench.file(name)).unwrap()).unwrap()
}

/// A report that names these effects of the shoulder with their shares, and leaves a rest.
fn report(bench: &Bench, effects: &[(&str, &str, f64, f64)], rest: f64) {
    let effects: Vec<Value> = effects
        .iter()
        .map(|(effect, parameter, value, share)| {
            serde_json::json!({
                "effect": effect, "probability": 0.9, "share": share, "share_low": share, "share_high": share,
                "parameters": { *parameter: { "value": value, "std": 0.1, "at_bound": false } }, "shrink_alone": 0.5
            })
        })
        .collect();
    let size =
        serde_json::json!({ "before": 1.0, "after": 0.1, "noise_floor": 0.1, "held_out": true });
    let report = serde_json::json!({
        "schema": 2, "robot": "arm", "recordings": [], "samples": 1, "seconds": 1.0, "sample_rate_hz": 500.0,
        "twin": "follows_motion", "compute_seconds": 1.0, "shared_effects": [],
        "joints": [{
            "joint": "shoulder", "verdict": "explained", "effects": effects, "candidates": [], "confusable": [],
            "where": { "stage": null, "signals": [], "regimes": [], "bands": [] },
            "gap": { "torque_rms_nm": size, "position_rms_rad": size, "shrink": 1.0, "shrink_low": 0.9, "shrink_high": 1.0 },
            "remaining": "white", "remaining_share": rest
        }]
    });
    fs::write(bench.file("report.json"), report.to_string()).unwrap();
}

#[test]
fn effects_are_written_where_a_simulator_reads_them_and_the_rest_is_told_with_its_share() {
    let bench = bench("apply");
    let effects = [
        ("coulomb_friction", "coulomb_nm", 3.0, 0.7),
        ("rotor_inertia", "inertia_kg_m2", 0.05, 0.1),
        ("backlash", "gap_rad", 0.001, 0.15),
    ];
    report(&bench, &effects, 0.05);
    let apply = "gap apply --report report.json --robot";
    let told = works(
        &bench,
        &format!("{apply} arm.xml --format mjcf --out new.xml --json applied.json"),
    );
    assert!(
        told.contains("frictionloss 0 -> 3 (70 % of the gap)"),
        "{told}"
    );
    assert!(
        told.contains("backlash: not in MJCF (15 % of the gap)"),
        "{told}"
    );
    assert!(
        told.contains(
            "shoulder: 80 % of the gap is written, 15 % cannot be said in MJCF, 5.0 % has no name"
        ),
        "{told}"
    );
    let new = fs::read_to_string(bench.file("new.xml")).unwrap();
    let expected = MODEL.replace(
        "armature=\"0.1\" damping=\"0.5\"",
        "armature=\"0.15\" damping=\"0.5\" frictionloss=\"3\"",
    );
    assert_eq!(new, expected, "everything else is as it was");
    let applied = json(&bench, "applied.json");
    assert_eq!(applied["format"], "MJCF");
    assert!((applied["joints"][0]["written"].as_f64().unwrap() - 0.8).abs() < 1e-12);
    assert_eq!(applied["effects"][2]["effect"], "backlash");
    assert!(applied["effects"][2]["cannot_say"].is_string());

    works(
        &bench,
        &format!("{apply} arm.urdf --format urdf --out new.urdf"),
    );
    let new = fs::read_to_string(bench.file("new.urdf")).unwrap();
    assert!(new.contains("<dynamics friction=\"3\"/>"), "{new}");
    works(
        &bench,
        &format!("{apply} arm.xml --format isaaclab --out actuators.py"),
    );
    let new = fs::read_to_string(bench.file("actuators.py")).unwrap();
    assert!(new.contains("\"shoulder\": 3.0"), "{new}");
}

#[test]
fn friction_is_what_the_format_can_say_where_it_cannot_say_all() {
    let bench = bench("plain_friction");
    let effects = [
        ("coulomb_friction", "coulomb_nm", 3.0, 0.4),
        ("viscous_friction", "viscous_nm_s_rad", 4.0, 0.3),
        ("quadratic_friction", "quadratic_nm_s2_rad2", -0.5, 0.2),
    ];
    report(&bench, &effects, 0.1);
    let mut with_plain = json(&bench, "report.json");
    with_plain["joints"][0]["plain_friction"] = serde_json::json!({
        "coulomb_nm": 3.5, "viscous_nm_s_rad": 2.5, "torque_rms_nm": 0.25
    });
    fs::write(bench.file("report.json"), with_plain.to_string()).unwrap();
    let apply = "gap apply --report report.json --robot";
    let told = works(
        &bench,
        &format!("{apply} arm.urdf --format urdf --out new.urdf"),
    );
    assert!(told.contains("0.250 Nm rms instead of 0.100 Nm"), "{told}");
    // 0.25 and 0.1 of 1 Nm rms
    assert!(
        told.contains("shoulder: 85 % of the gap is written, 5.2 % cannot be said in URDF"),
        "{told}"
    );
    let new = fs::read_to_string(bench.file("new.urdf")).unwrap();
    assert!(
        new.contains("damping=\"2.5\"") && new.contains("friction=\"3.5\""),
        "{new}"
    );
    // MuJoCo has a second number of damping
    works(
        &bench,
        &format!("{apply} arm.xml --format mjcf --out new.xml"),
    );
    let new = fs::read_to_string(bench.file("new.xml")).unwrap();
    assert!(new.contains("frictionloss=\"3\""), "{new}");
}

#[test]
fn friction_below_zero_is_not_written_by_halves() {
    let bench = bench("friction_below_zero");
    let effects = [
        ("coulomb_friction", "coulomb_nm", 3.0, 0.9),
        ("viscous_friction", "viscous_nm_s_rad", -0.5, 0.05),
    ];
    report(&bench, &effects, 0.05);
    let mut with_plain = json(&bench, "report.json");
    with_plain["joints"][0]["plain_friction"] = serde_json::json!({
        "coulomb_nm": 2.4, "viscous_nm_s_rad": 0.0, "torque_rms_nm": 0.2
    });
    fs::write(bench.file("report.json"), with_plain.to_string()).unwrap();
    let apply = "gap apply --report report.json --robot arm.urdf --out";
    for format in ["urdf", "mjcf", "isaaclab"] {
        let told = works(&bench, &format!("{apply} new.{format} --format {format}"));
        assert!(
            told.contains("shoulder: coulomb_friction: ") && told.contains("friction"),
            "{told}"
        );
        assert!(told.contains(" 0 -> 2.4 "), "{format}: {told}");
        assert!(!told.contains("below zero"), "{format}: {told}");
    }
    // a correction of which the format has no words, and that takes less than the others lose without it
    with_plain["joints"][0]["effects"][1] = serde_json::json!({
        "effect": "stribeck_friction", "probability": 1.0, "share": 0.05, "share_low": 0.0,
        "share_high": 0.1, "shrink_alone": 0.0,
        "parameters": {
            "stribeck_nm": { "value": 1.0, "std": 0.1, "at_bound": false },
            "stribeck_velocity_rad_s": { "value": 0.1, "std": 0.0, "at_bound": false }
        }
    });
    with_plain["joints"][0]["plain_friction"]["torque_rms_nm"] = 2.0.into();
    fs::write(bench.file("report.json"), with_plain.to_string()).unwrap();
    let told = works(&bench, &format!("{apply} less.urdf --format urdf"));
    assert!(
        told.contains("shoulder: 0 % of the gap is written, 95 % cannot be said in URDF"),
        "{told}"
    );
}

#[test]
fn a_robot_file_that_leaves_the_joints_to_its_description_gets_their_tables() {
    let bench = bench("no_tables");
    report(&bench, &[("coulomb_friction", "coulomb_nm", 3.0, 0.9)], 0.1);
    let own = "# on its side\nname = \"arm\"\nurdf = \"arm.urdf\"\ngravity_m_s2 = [9.81, 0.0, 0.0]   # as mounted\n";
    fs::write(bench.file("side.toml"), own).unwrap();
    let apply = "gap apply --report report.json --robot side.toml --out new.toml";
    works(&bench, apply);
    let new = fs::read_to_string(bench.file("new.toml")).unwrap();
    assert!(new.starts_with(own), "{new}");
    let load = |name: &str| robot::load(bench.file(name).to_str().unwrap()).unwrap();
    let (before, after) = (load("side.toml"), load("new.toml"));
    assert_eq!(after.chain.gravity_m_s2(), before.chain.gravity_m_s2());
    let coulomb = robot::Effect::CoulombFriction { coulomb_nm: 3.0 };
    for (joint, as_it_was) in after.joints.iter().zip(&before.joints) {
        let mut expected = as_it_was.clone();
        if joint.name == "shoulder" {
            expected.effects.push(coulomb);
        }
        assert_eq!(*joint, expected);
    }
}

#[test]
fn what_a_joints_table_leaves_to_the_description_stays_with_it() {
    let bench = bench("own_tables");
    report(
        &bench,
        &[("viscous_friction", "viscous_nm_s_rad", 0.3, 0.9)],
        0.1,
    );
    let own = "name = \"arm\"\nurdf = \"arm.urdf\"\n\n[[joint]]\nname = \"shoulder\"\nmotor_encoder_resolution_rad = 1e-4\n";
    fs::write(bench.file("own.toml"), own).unwrap();
    let damped = URDF.replace("<limit", "<dynamics damping=\"0.5\"/><limit");
    fs::write(bench.file("arm.urdf"), damped).unwrap();
    works(
        &bench,
        "gap apply --report report.json --robot own.toml --out new.toml",
    );
    works(
        &bench,
        "gap apply --report report.json --robot arm.urdf --out bare.toml",
    );
    let viscous = |name: &str| {
        let robot = robot::load(bench.file(name).to_str().unwrap()).unwrap();
        let shoulder = robot.joints.iter().find(|joint| joint.name == "shoulder");
        let mut effects = shoulder.unwrap().effects.iter();
        effects.find_map(|effect| match effect {
            robot::Effect::ViscousFriction { viscous_nm_s_rad } => Some(*viscous_nm_s_rad),
            _ => None,
        })
    };
    assert!(viscous("own.toml").is_some_and(|before| before > 0.0));
    assert_eq!(viscous("new.toml"), viscous("bare.toml"));
}

#[test]
fn what_cannot_be_applied_is_one_line() {
    let bench = bench("refuse");
    let apply = "gap apply --report report.json --robot arm.xml --out new.xml --format";
    report(&bench, &[("backlash", "gap_rad", 0.001, 0.9)], 0.1);
    ends(
        &bench,
        &format!("{apply} mjcf"),
        1,
        &["nothing of what it names", "MJCF", "gear"],
    );
    ends(
        &bench,
        &format!("{apply} mjcf --remaining"),
        2,
        &["--remaining", "--format toml"],
    );
    ends(&bench, &format!("{apply} sdf"), 2, &["sdf", "mjcf"]);
    report(&bench, &[], 1.0);
    ends(&bench, &format!("{apply} urdf"), 1, &["names no effect"]);
    assert!(!bench.file("new.xml").exists());
}

#[test]
fn a_starter_file_is_the_robot_that_the_description_is() {
    let bench = bench("init");
    for description in ["arm.urdf", "arm.xml"] {
        let _ = fs::remove_file(bench.file("arm.toml"));
        works(&bench, &format!("robot init {description} --out arm.toml"));
        let text = fs::read_to_string(bench.file("arm.toml")).unwrap();
        assert!(text.contains("# gear_ratio = 100.0"), "{text}");
        let load = |name: &str| robot::load(bench.file(name).to_str().unwrap()).unwrap();
        let (ours, theirs) = (load("arm.toml"), load(description));
        assert_eq!(ours.joints, theirs.joints);
        assert_eq!(ours.control, theirs.control);
        assert_eq!(
            ours.chain.links()[0].mass_kg,
            theirs.chain.links()[0].mass_kg
        );
    }
    ends(
        &bench,
        "robot init arm.urdf --out arm.toml",
        2,
        &["arm.toml", "is there already"],
    );
    ends(
        &bench,
        "robot init arm.toml --out other.toml",
        2,
        &["arm.toml", "already", "robot check"],
    );
    ends(
        &bench,
        "robot init none.urdf --out other.toml",
        2,
        &["none.urdf"],
    );
    works(&bench, "robot init --out bench.toml");
    // every comment that shows a key is a line that the file takes
    let text = fs::read_to_string(bench.file("bench.toml")).unwrap();
    let keys = [
        "# gear",
        "# rotor",
        "# torque",
        "# motor",
        "# link",
        "# position",
        "# velocity",
        "# effects",
        "#   {",
        "# ]",
        "# [control",
        "# kind = \"pd\"",
        "# rate",
        "# prop",
        "# deriv",
    ];
    let full: Vec<String> = text
        .lines()
        .map(|line| match keys.iter().any(|key| line.starts_with(key)) {
            true => line.trim_start_matches("# ").to_owned(),
            false => line.to_owned(),
        })
        .collect();
    fs::write(bench.file("full.toml"), full.join("\n")).unwrap();
    let full = robot::load(bench.file("full.toml").to_str().unwrap()).unwrap();
    assert_eq!(
        (full.joints[0].gear_ratio, full.joints[0].effects.len()),
        (100.0, 3)
    );
    assert!(full.control.is_some());
}

#[test]
fn a_check_tells_what_is_known_unknown_and_doubtful() {
    let bench = bench("check");
    let told = works(&bench, "robot check arm.urdf --json check.json");
    assert!(told.contains("known\n  1 joint, 2.000 kg"), "{told}");
    assert!(told.contains("shoulder: gear ratio (taken as 1)"), "{told}");
    assert_eq!(
        json(&bench, "check.json")["doubtful"],
        Value::Array(Vec::new())
    );
    let doubtful = URDF
        .replace("ixx=\"0.025\"", "ixx=\"25\"")
        .replace("iyy=\"0.025\"", "iyy=\"25\"")
        .replace("</robot>", "<link name=\"tip\"/><joint name=\"wrist\" type=\"revolute\"><parent link=\"upper\"/><child link=\"tip\"/><limit lower=\"0\" upper=\"1\"/></joint></robot>");
    fs::write(bench.file("odd.urdf"), doubtful).unwrap();
    let (code, told, message) = says(&bench, "robot check odd.urdf");
    assert_eq!(code, 1, "{told}{message}");
    assert!(
        told.contains("odd.urdf, line 3, link `upper`: 2 kg with 25 kg m²"),
        "{told}"
    );
    assert!(
        told.contains("line 13, joint `wrist`: nothing that it moves has mass"),
        "{told}"
    );
    assert!(message.contains("and 1 more"), "{message}");
    let undriven = MODEL.replace(
        "<inertial",
        "<joint name=\"other\" axis=\"1 0 0\"/><inertial",
    );
    fs::write(bench.file("odd.xml"), undriven).unwrap();
    let (code, told, _) = says(&bench, "robot check odd.xml");
    assert_eq!(code, 1);
    assert!(
        told.contains("odd.xml, line 7, joint `other`: no actuator turns it"),
        "{told}"
    );
    ends(&bench, "robot check none.urdf", 2, &["none.urdf"]);
    works(&bench, "robot check pa10");
}

#[test]
fn robots_are_converted_by_the_name_of_the_file_and_what_is_lost_is_told() {
    let bench = bench("convert");
    works(&bench, "robot convert arm.urdf --out converted.xml");
    works(&bench, "robot convert converted.xml --out back.urdf");
    let load = |name: &str| robot::load(bench.file(name).to_str().unwrap()).unwrap();
    let (first, back) = (load("arm.urdf"), load("back.urdf"));
    assert_eq!(
        first.chain.links()[0].inertia_kg_m2,
        back.chain.links()[0].inertia_kg_m2
    );
    assert_eq!(
        first.joints[0].torque_limit_nm,
        back.joints[0].torque_limit_nm
    );
    let told = works(
        &bench,
        "robot convert pa10 --out pa10.urdf --json lost.json",
    );
    assert!(
        told.contains("left out: control: URDF has no controller"),
        "{told}"
    );
    assert!(
        json(&bench, "lost.json")["left_out"]
            .as_array()
            .unwrap()
            .len()
            > 1
    );
    works(&bench, "robot convert pa10 --out pa10.txt --format toml");
    ends(
        &bench,
        "robot convert pa10 --out pa10.sdf",
        2,
        &["pa10.sdf", "--format"],
    );
    ends(
        &bench,
        "robot convert none.xml --out a.urdf",
        2,
        &["none.xml"],
    );
}

/// The pendulum of `arm.xml` on three sines, with friction beside that of the model.
fn log(coulomb_nm: f64, viscous_nm_s_rad: f64) -> String {
    let mut log =
        "time_s,shoulder.link_position_rad,shoulder.link_velocity_rad_s,shoulder.motor_torque_nm\n"
            .to_owned();
    for row in 0..6000 {
        let time_s = 0.002 * f64::from(row);
        let [mut q, mut v, mut a] = [0.0; 3];
        for (place, [rate, rad]) in [[1.1, 0.6], [2.9, 0.3], [7.3, 0.1]].into_iter().enumerate() {
            let (sin, cos) = (rate * time_s + place as f64).sin_cos();
            q += rad * sin;
            v += rad * rate * cos;
            a -= rad * rate * rate * sin;
        }
        // the golden ratio's multiples fill the unit evenly: noise without a generator
        let noise_nm = 0.07 * ((f64::from(row) * 0.618_034).fract() - 0.5);
        let friction_nm = coulomb_nm * (v / 0.01).tanh() + (0.5 + viscous_nm_s_rad) * v;
        let torque_nm = 0.25 * a + 2.0 * 9.81 * 0.25 * q.sin() + friction_nm + noise_nm;
        log += &format!("{time_s:.4},{q:.7},{v:.6},{torque_nm:.6}\n");
    }
    log
}

#[test]
fn what_the_robot_has_and_the_simulator_has_not_is_told() {
    let bench = bench("beside");
    fs::write(bench.file("real.csv"), log(3.0, 2.0)).unwrap();
    fs::write(bench.file("sim.csv"), log(0.0, 2.0)).unwrap();
    let diagnose =
        "gap diagnose --robot arm.xml --recording real.csv --simulated sim.csv --out gap";
    let told = works(&bench, diagnose);
    assert!(
        told.contains("shoulder: only the robot has: Coulomb friction 3.0"),
        "{told}"
    );
    assert!(
        told.contains("shoulder: both have: viscous friction"),
        "{told}"
    );
    let report = json(&bench, "gap/report.json");
    let effects = report["joints"][0]["effects"].as_array().unwrap();
    let viscous = effects
        .iter()
        .find(|effect| effect["effect"] == "viscous_friction")
        .unwrap();
    let told_nm_s_rad = viscous["parameters"]["viscous_nm_s_rad"]["value"]
        .as_f64()
        .unwrap();
    assert!((told_nm_s_rad - 2.0).abs() < 0.02, "{viscous}");
    let joint = &report["beside_simulator"]["joints"][0];
    assert_eq!(joint["only_robot"][0]["effect"], "coulomb_friction");
    assert_eq!(joint["both"][0]["is_same"], true);
    assert_eq!(joint["only_simulator"], Value::Array(Vec::new()));
    assert_eq!(
        json(&bench, "gap/simulated.json")["recordings"][0],
        "sim.csv"
    );
    let page = fs::read_to_string(bench.file("gap/report.html")).unwrap();
    assert!(page.contains("The simulator beside the robot"));
    // the report is still one that other commands take
    works(
        &bench,
        "gap apply --report gap/report.json --robot arm.xml --format mjcf --out new.xml",
    );
    ends(
        &bench,
        "gap diagnose --robot arm.xml --recording real.csv --simulated none.csv",
        2,
        &["none.csv"],
    );
}
