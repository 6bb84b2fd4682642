//! What is done with a diagnosis: the next experiment, the live watch, the round of inject, diagnose, apply and run.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod support;

use std::fs;
use std::io::{BufRead, BufReader};

use recording::Signal;
use robot::Effect;
use serde_json::Value;
use support::{Bench, kill, output, spawn, text};

/// With the examples' robot, whose plant is one of its tolerance.
fn bench(name: &str) -> Bench {
    let bench = Bench::new(name);
    fs::copy("examples/bench.toml", bench.file("bench.toml")).unwrap();
    bench
}

fn flexspline(bench: &Bench, arguments: &str) -> String {
    let mut command = bench.flexspline();
    command.args(arguments.split_whitespace());
    let output = output(command);
    assert!(output.status.success(), "{arguments}: {}", text(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn json(bench: &Bench, name: &str) -> Value {
    serde_json::from_slice(&fs::read(bench.file(name)).unwrap()).unwrap()
}

/// Runs a trajectory on the plant with the effects of a file: leaves `run.mcap`.
fn run(bench: &Bench, trajectory: &str, duration: &str, inject: &str) {
    let mut run = bench.run(&["--mode", "lockstep", "--robot", "bench.toml"]);
    run.args(["--trajectory", trajectory, "--duration", duration])
        .args(["--inject", inject, "--estimators", "residual"]);
    let ran = output(run);
    assert!(ran.status.success(), "{}", text(&ran));
}

/// The joint's part of the report on such a run.
fn diagnosed(bench: &Bench, trajectory: &str, duration: &str, out: &str) -> Value {
    run(bench, trajectory, duration, "gap.toml");
    flexspline(
        bench,
        &format!("gap diagnose --robot bench.toml --recording run.mcap --out {out}"),
    );
    json(bench, &format!("{out}/report.json"))["joints"][0].clone()
}

/// Whether an effect is taken for another.
fn is_confused(joint: &Value, effect: &str) -> bool {
    let pairs = joint["confusable"].as_array().unwrap();
    pairs.iter().any(|pair| {
        let effects = pair["effects"].as_array().unwrap();
        effects.contains(&effect.into())
    })
}

#[test]
fn the_suggested_trajectory_tells_apart_what_the_data_could_not() {
    let bench = bench("suggest");
    let spring = "[[effect]]\njoint = \"joint1\"\neffect = \"joint_spring\"\nstiffness_nm_rad = 6.0\nrest_rad = 0.4\n";
    fs::write(bench.file("gap.toml"), spring).unwrap();
    let small = "[[joint]]\nkind = \"multi_sine\"\nname = \"joint1\"\namplitude_rad = 0.05\n";
    fs::write(bench.file("small.toml"), small).unwrap();
    // a spring, a link's weight and an offset of the encoder: all are a torque and a slope over so small a range
    let before = diagnosed(&bench, "small.toml", "12s", "before");
    assert!(is_confused(&before, "joint_spring"), "{before}");
    let told = flexspline(
        &bench,
        "gap suggest --report before/report.json --robot bench.toml --out next.toml --duration 15s",
    );
    assert!(told.contains("best: "), "{told}");
    let after = diagnosed(&bench, "next.toml", "15s", "after");
    let effects = after["effects"].as_array().unwrap();
    let named = effects
        .iter()
        .find(|found| found["effect"] == "joint_spring");
    assert!(
        named.unwrap()["probability"].as_f64().unwrap() > 0.9,
        "{after}"
    );
    assert!(!is_confused(&after, "joint_spring"), "{after}");
}

#[test]
fn two_friction_laws_at_once_are_both_named() {
    let bench = bench("two_laws");
    // a robot file without a law that could bend to what is missing
    fs::copy("benches/peers/joint.toml", bench.file("bench.toml")).unwrap();
    let laws = [
        "effect = \"coulomb_friction\"\ncoulomb_nm = 1.0\n",
        "effect = \"viscous_friction\"\nviscous_nm_s_rad = 1.5\n",
    ];
    let laws = laws.map(|law| format!("[[effect]]\njoint = \"joint1\"\n{law}"));
    fs::write(bench.file("gap.toml"), laws.concat()).unwrap();
    let course = "[[joint]]\nkind = \"multi_sine\"\nname = \"joint1\"\namplitude_rad = 1.0\nspeed_rad_s = 1.5\nband_hz = [0.05, 1.0]\n";
    fs::write(bench.file("course.toml"), course).unwrap();
    let joint = diagnosed(&bench, "course.toml", "20s", "two");
    let effects = joint["effects"].as_array().unwrap();
    let value = |effect: &str, parameter: &str| {
        let found = effects.iter().find(|found| found["effect"] == effect);
        found.and_then(|found| found["parameters"][parameter]["value"].as_f64())
    };
    let coulomb_nm = value("coulomb_friction", "coulomb_nm").unwrap_or(0.0);
    let viscous_nm_s_rad = value("viscous_friction", "viscous_nm_s_rad").unwrap_or(0.0);
    assert!((coulomb_nm - 1.0).abs() < 0.15, "{joint}");
    assert!((viscous_nm_s_rad / 1.5 - 1.0).abs() < 0.15, "{joint}");
    for imitator in ["stribeck_friction", "quadratic_friction"] {
        assert!(effects.iter().all(|found| found["effect"] != imitator));
    }
}

/// A pendulum behind a rigid gear, without the friction that it has.
const PENDULUM: &str = r#"name = "pendulum"
gravity_m_s2 = [0.0, 0.0, -9.81]
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

/// Its log on a sum of sines, in Hz and rad, with Coulomb and viscous friction, a torque over position that is on no list, and a motor
/// that is so many times as strong as recorded.
fn pendulum_log(sines: [[f64; 2]; 3], unlisted_nm: f64, gain: f64) -> String {
    const STEP_S: f64 = 0.002;
    const STEP_RAD: f64 = 1e-5;
    let inertia_kg_m2 = 0.025 + 2.0 * 0.25_f64.powi(2) + 1e-5 * 100.0_f64.powi(2);
    let mut log = "time_s,shoulder.link_position_rad,shoulder.motor_torque_nm\n".to_owned();
    for row in 0..6000 {
        let time_s = STEP_S * f64::from(row);
        let [mut q, mut v, mut a] = [0.0; 3];
        for (place, [hz, rad]) in sines.into_iter().enumerate() {
            let rate = std::f64::consts::TAU * hz;
            let (sin, cos) = (rate * time_s + place as f64).sin_cos();
            q += rad * sin;
            v += rad * rate * cos;
            a -= rad * rate * rate * sin;
        }
        let friction_nm = (v / 0.01).tanh() + v;
        let unlisted_nm = unlisted_nm * (6.0 * q).sin();
        // the golden ratio's multiples fill the unit evenly: noise without a generator
        let noise_nm = 0.07 * ((f64::from(row) * 0.618_034).fract() - 0.5);
        let torque_nm =
            inertia_kg_m2 * a + 2.0 * 9.81 * 0.25 * q.sin() + friction_nm + unlisted_nm + noise_nm;
        let shown_rad = (q / STEP_RAD).round() * STEP_RAD;
        log += &format!(
            "{time_s:.4},{shown_rad:.6},{:.9}\n",
            torque_nm / 100.0 / gain
        );
    }
    log
}

/// Its file, and its logs on one motion and on another.
fn pendulum_on_two_motions(name: &str, unlisted_nm: f64, gain: f64) -> Bench {
    let bench = bench(name);
    fs::write(bench.file("file.toml"), PENDULUM).unwrap();
    let motions = [
        ("first.csv", [[0.21, 0.6], [0.37, 0.25], [0.73, 0.1]]),
        ("other.csv", [[0.17, 0.5], [0.43, 0.3], [0.61, 0.12]]),
    ];
    for (log, sines) in motions {
        fs::write(bench.file(log), pendulum_log(sines, unlisted_nm, gain)).unwrap();
    }
    bench
}

#[test]
fn what_has_no_name_is_written_as_a_table_and_shrinks_the_gap_on_another_motion() {
    let bench = pendulum_on_two_motions("remaining", 1.5, 1.0);
    let diagnose = |robot: &str, recording: &str| {
        flexspline(
            &bench,
            &format!("gap diagnose --robot {robot} --recording {recording} --out gap"),
        );
        json(&bench, "gap/report.json")["joints"][0].clone()
    };
    let first = diagnose("file.toml", "first.csv");
    assert_eq!(first["remaining_over"][0]["over"], "position", "{first}");
    let apply = "gap apply --report gap/report.json --robot file.toml --out";
    flexspline(&bench, &format!("{apply} named.toml"));
    let told = flexspline(&bench, &format!("{apply} rest.toml --remaining"));
    assert!(
        told.contains("torque_table: added, over position"),
        "{told}"
    );
    let gap_nm = ["file.toml", "named.toml", "rest.toml"].map(|robot| {
        let joint = diagnose(robot, "other.csv");
        let before = &joint["gap"]["torque_rms_nm"]["before"];
        before.as_f64().unwrap()
    });
    let [by_file_nm, named_nm, with_rest_nm] = gap_nm;
    assert!(named_nm < 0.8 * by_file_nm, "{gap_nm:?}");
    assert!(with_rest_nm < 0.4 * named_nm, "{gap_nm:?}");
}

#[test]
fn friction_beside_a_torque_constant_is_written_as_the_motors() {
    let bench = pendulum_on_two_motions("constant", 0.0, 0.7);
    let diagnose = |robot: &str, recording: &str| {
        let command = "gap diagnose --out gap --robot";
        flexspline(
            &bench,
            &format!("{command} {robot} --recording {recording}"),
        );
        json(&bench, "gap/report.json")
    };
    let first = diagnose("file.toml", "first.csv");
    let factor = first["joints"][0]["torque"]["motor_per_recorded"].as_f64();
    assert!(
        factor.is_some_and(|factor| (factor - 0.7).abs() < 0.02),
        "{first}"
    );
    let is_told = |finding: &Value| {
        finding["what"]
            .as_str()
            .is_some_and(|what| what.contains("as recorded"))
    };
    assert!(
        first["data"].as_array().unwrap().iter().any(is_told),
        "{first}"
    );
    flexspline(
        &bench,
        "gap apply --report gap/report.json --robot file.toml --out new.toml",
    );
    let new = robot::load(&bench.file("new.toml").display().to_string()).unwrap();
    let coulomb_nm = new.joints[0]
        .effects
        .iter()
        .find_map(|effect| match effect {
            Effect::CoulombFriction { coulomb_nm } => Some(*coulomb_nm),
            _ => None,
        });
    // 1 Nm of the motor's is 1.43 Nm as recorded
    assert!(
        coulomb_nm.is_some_and(|nm| (nm - 1.0).abs() < 0.05),
        "{:?}",
        new.joints[0]
    );
    let gap_nm = ["file.toml", "new.toml"].map(|robot| {
        let told = diagnose(robot, "other.csv");
        let before = &told["joints"][0]["gap"]["torque_rms_nm"]["before"];
        before.as_f64().unwrap()
    });
    assert!(gap_nm[1] < 0.05 * gap_nm[0], "{gap_nm:?}");
}

#[test]
fn plant_and_simulation_have_a_table_alike() {
    const KEY: &str = "rotor_inertia_kg_m2 = 1.14e-5";
    const TABLES: &str = r#"torque_tables = [
  { over = "position", at = [-1.0, -0.3, 0.2, 0.8], torque_nm = [1.0, -1.5, 1.2, -1.0] },
  { over = "velocity", at = [-1.0, 0.0, 1.0], torque_nm = [-0.2, 0.3, 1.5] },
]
"#;
    let bench = bench("tables");
    let without = fs::read_to_string(bench.file("bench.toml")).unwrap();
    fs::write(bench.file("without.toml"), &without).unwrap();
    let with = without.replacen(KEY, &format!("{TABLES}{KEY}"), 1);
    assert_ne!(with, without);
    fs::write(bench.file("bench.toml"), with).unwrap();
    let mut run = bench.run(&["--mode", "lockstep", "--robot", "bench.toml"]);
    run.args(["--trajectory", "multi_sine", "--duration", "20s"]);
    let ran = output(run);
    assert!(ran.status.success(), "{}", text(&ran));
    let torque_rms = |robot: &str, which: &str| {
        flexspline(
            &bench,
            &format!("gap diagnose --robot {robot} --recording run.mcap --out tables"),
        );
        let joint = &json(&bench, "tables/report.json")["joints"][0];
        joint["gap"]["torque_rms_nm"][which].as_f64().unwrap()
    };
    let floor_nm = torque_rms("bench.toml", "noise_floor");
    let (known_nm, unknown_nm) = (
        torque_rms("bench.toml", "before"),
        torque_rms("without.toml", "before"),
    );
    assert!(known_nm < 2.0 * floor_nm, "{known_nm} {floor_nm}");
    assert!(unknown_nm > 20.0 * floor_nm, "{unknown_nm} {floor_nm}");
}

#[test]
fn encoders_that_are_read_apart_are_told_and_no_effect_is_named_for_it() {
    const EARLIER_MS: f64 = 0.3;
    const ZERO_RAD: f64 = 2e-3;
    let bench = bench("read_apart");
    let more = "[[effect]]\njoint = \"joint1\"\neffect = \"coulomb_friction\"\ncoulomb_nm = 0.5\n";
    fs::write(bench.file("gap.toml"), more).unwrap();
    run(&bench, "multi_sine", "20s", "gap.toml");
    let mut recording = recording::read(&bench.file("run.mcap")).unwrap();
    let rate_hz = recording.sample_rate_hz;
    let signals = &mut recording.joints[0].signals;
    let link_rad = signals.get_mut(&Signal::LinkPositionRad).unwrap();
    let shown = link_rad.clone();
    for k in 1..shown.len() - 1 {
        let velocity_rad_s = 0.5 * rate_hz * (shown[k + 1] - shown[k - 1]);
        link_rad[k] = shown[k] - 1e-3 * EARLIER_MS * velocity_rad_s + ZERO_RAD;
    }
    recording::write_csv(&recording, &bench.file("apart.csv")).unwrap();
    flexspline(
        &bench,
        "gap diagnose --robot bench.toml --recording apart.csv --out apart",
    );
    let report = json(&bench, "apart/report.json");
    let effects = report["joints"][0]["effects"].as_array().unwrap();
    let names: Vec<&str> = effects
        .iter()
        .filter_map(|found| found["effect"].as_str())
        .collect();
    assert_eq!(names, ["coulomb_friction"], "{report}");
    let notes = report["data"].to_string();
    let told = |before: &str, after: &str| -> f64 {
        let rest = notes.split(before).nth(1).expect("it is told");
        assert!(rest.contains(after), "{after}: {notes}");
        rest.split(' ').next().unwrap().parse().unwrap()
    };
    let earlier_ms = told("encoder is read ", "ms earlier");
    assert!((earlier_ms - EARLIER_MS).abs() < 0.05, "{notes}");
    let zero_mrad = told("encoder shows ", "mrad more than the motor's");
    assert!((1e-3 * zero_mrad - ZERO_RAD).abs() < 1e-4, "{notes}");
}

#[test]
fn effects_of_a_file_may_be_asked_about_and_what_no_motion_tells_apart_is_said() {
    let bench = bench("delays");
    let delays = ["command_delay", "sensor_delay"].map(|effect| {
        format!("[[effect]]\njoint = \"joint1\"\neffect = \"{effect}\"\ndelay_s = 0.002\n")
    });
    fs::write(bench.file("two.toml"), delays.concat()).unwrap();
    let mut command = bench.flexspline();
    command.args([
        "gap",
        "suggest",
        "--effects",
        "two.toml",
        "--out",
        "next.toml",
    ]);
    command.args(["--robot", "bench.toml", "--duration", "4s"]);
    let output = output(command);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    assert!(
        text(&output).contains("sum of both delays"),
        "{}",
        text(&output)
    );
    assert!(!bench.file("next.toml").exists());
}

/// What is told along the run, the joint learnt from its first 14 s.
fn watched(bench: &Bench) -> Vec<Value> {
    flexspline(
        bench,
        "gap watch --robot bench.toml --recording run.mcap --window 14s --json events.json",
    );
    let events = json(bench, "events.json");
    let events = events.as_array().unwrap();
    assert_eq!(events[0]["event"], "watching", "{events:?}");
    events.clone()
}

#[test]
fn a_gap_is_named_when_it_appears_and_not_before() {
    let bench = bench("watch");
    let later = "[[effect]]\njoint = \"joint1\"\neffect = \"coulomb_friction\"\ncoulomb_nm = 1.0\nstart_s = 18.0\n";
    fs::write(bench.file("later.toml"), later).unwrap();
    run(&bench, "multi_sine", "26s", "later.toml");
    let events = watched(&bench);
    let gap = events.iter().find(|event| event["event"] == "gap").unwrap();
    let appeared_s = gap["appeared_s"].as_f64().unwrap();
    assert!((17.5..20.0).contains(&appeared_s), "{gap}");
    assert_eq!(gap["candidates"][0]["effect"], "coulomb_friction", "{gap}");
}

#[test]
fn what_was_there_but_could_not_show_is_no_gap_when_it_does() {
    let bench = bench("watch-faster");
    let always = "[[effect]]\njoint = \"joint1\"\neffect = \"quadratic_friction\"\nquadratic_nm_s2_rad2 = 0.5\n";
    fs::write(bench.file("always.toml"), always).unwrap();
    // slow while the joint is learnt, then six times as fast
    let mut waypoints = "time_s,joint1.reference_position_rad\n".to_owned();
    let mut turned_rad = 0.0_f64;
    for step in 0..=500 {
        let time_s = 0.05 * f64::from(step);
        waypoints += &format!("{time_s},{}\n", 0.6 * turned_rad.sin());
        turned_rad += if time_s < 16.0 { 0.025 } else { 0.15 };
    }
    fs::write(bench.file("faster.csv"), waypoints).unwrap();
    run(&bench, "faster.csv", "25s", "always.toml");
    let events = watched(&bench);
    assert!(
        events.iter().all(|event| event["event"] != "gap"),
        "{events:?}"
    );
}

#[test]
fn a_running_instance_is_watched_through_its_relay() {
    let bench = bench("live");
    let mut run = bench.run(&["--robot", "bench.toml", "--trajectory", "multi_sine"]);
    run.args(["--duration", "60s", "--estimators", "residual"]);
    let run = spawn(run);
    bench.await_process("loop");
    let mut watch = bench.flexspline();
    watch.args([
        "gap",
        "watch",
        "--window",
        "7s",
        "--instance",
        &bench.instance,
    ]);
    let mut watch = spawn(watch);
    let heard = BufReader::new(watch.stdout.take().unwrap())
        .lines()
        .map_while(Result::ok)
        .find(|line| line.contains("joint1: "));
    assert!(heard.is_some());
    kill(watch.id(), libc::SIGINT);
    assert!(watch.wait().unwrap().success());
    kill(run.id(), libc::SIGINT);
    let output = run.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
}

#[test]
fn with_the_mended_file_the_robot_follows_better_for_eight_effects() {
    let bench = bench("round");
    let effects = fs::read_to_string("examples/gap-round.toml").unwrap();
    let chosen = effects.split("[[effect]]").filter(|entry| {
        EIGHT
            .iter()
            .any(|effect| entry.contains(&format!("\"{effect}\"")))
    });
    let chosen: Vec<String> = chosen.map(|entry| format!("[[effect]]{entry}")).collect();
    assert_eq!(chosen.len(), EIGHT.len());
    fs::write(bench.file("gap.toml"), chosen.concat()).unwrap();
    flexspline(
        &bench,
        "gap round --robot bench.toml --inject gap.toml --duration 10s --json rounds.json",
    );
    for round in json(&bench, "rounds.json").as_array().unwrap() {
        let error = |which: &str| round["position_rms_rad"][which].as_f64().unwrap();
        let (before, after) = (error("before"), error("after"));
        assert!(after < 0.5 * before, "{round}");
    }
}

const EIGHT: [&str; 8] = [
    "coulomb_friction",
    "viscous_friction",
    "asymmetric_friction",
    "load_dependent_friction",
    "torque_offset",
    "torque_constant_error",
    "gravity_torque",
    "joint_spring",
];
