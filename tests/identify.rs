//! `flexspline identify`: from recordings, the emulated arm's or any other, to a robot file that controls it better.

mod support;

use std::fs;
use std::path::Path;
use std::process::Output;
use std::time::SystemTime;

use identification::experiment::PA10_2005;
use serde_json::Value;
use support::{Bench, output, text};

fn identify(bench: &Bench, what: &str, arguments: &[&str]) -> Output {
    let mut command = bench.flexspline();
    command.args(["identify", what, "--out", "out"]);
    command.args(arguments);
    output(command)
}

/// A log of one joint at constant speeds there and back, as a foreign program would write it: 100 Hz, friction of 2 Nm and
/// 1 Nm s/rad, no gravity.
fn friction_log(speed_rad_s: f64, change: &dyn Fn(&mut [f64; 4], usize)) -> String {
    const RATE_HZ: f64 = 100.0;
    const GEAR_RATIO: f64 = 100.0;
    let mut text =
        "time_s,joint1.reference_velocity_rad_s,joint1.motor_position_rad,joint1.motor_torque_nm\n"
            .to_owned();
    let (mut angle_rad, mut row) = (0.0, 0);
    let stretch = |seconds: f64| (seconds * RATE_HZ) as usize;
    for velocity_rad_s in [0.0, speed_rad_s, -speed_rad_s, 0.0] {
        let rows = if velocity_rad_s == 0.0 {
            20
        } else {
            stretch(0.08 / speed_rad_s + 1.0)
        };
        for _ in 0..rows {
            angle_rad += velocity_rad_s / RATE_HZ;
            let sign = if velocity_rad_s == 0.0 {
                0.0
            } else {
                velocity_rad_s.signum()
            };
            let torque_nm = (2.0 * sign + velocity_rad_s) / GEAR_RATIO;
            let mut values = [
                row as f64 / RATE_HZ,
                velocity_rad_s,
                GEAR_RATIO * angle_rad,
                torque_nm,
            ];
            change(&mut values, row);
            text += &values.map(|value| value.to_string()).join(",");
            text += "\n";
            row += 1;
        }
    }
    text
}

/// A robot whose one joint turns about the vertical: no gravity.
fn upright(bench: &Bench) {
    let robot = include_str!("../robots/shd17.toml")
        .replace("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0, 1.0]");
    fs::write(bench.file("upright.toml"), robot).expect("written");
}

/// Lays foreign logs where `identify friction` looks for its recordings.
fn foreign_logs(bench: &Bench, change: &dyn Fn(&mut [f64; 4], usize)) {
    let folder = bench.file("out/recordings");
    fs::create_dir_all(&folder).expect("a folder");
    for speed_rad_s in PA10_2005.friction_rad_s {
        let path = folder.join(format!("friction-joint1-{speed_rad_s:.3}.csv"));
        fs::write(path, friction_log(*speed_rad_s, change)).expect("written");
    }
}

#[test]
fn recordings_made_by_other_means_are_taken() {
    let bench = Bench::new("id-foreign");
    upright(&bench);
    foreign_logs(&bench, &|_, _| ());
    let plan = identify(&bench, "friction", &["--robot", "upright.toml", "--plan"]);
    let printed = String::from_utf8_lossy(&plan.stdout).into_owned();
    assert!(plan.status.success(), "{}", text(&plan));
    let recorded = printed
        .lines()
        .filter(|line| line.trim_end().ends_with("recorded"));
    assert_eq!(recorded.count(), 8, "{printed}");
    let identified = identify(&bench, "friction", &["--robot", "upright.toml"]);
    assert!(identified.status.success(), "{}", text(&identified));
    let results: Value =
        serde_json::from_slice(&fs::read(bench.file("out/friction.json")).expect("results"))
            .expect("JSON");
    let models = &results["joints"][0]["friction"]["models"];
    let viscous = &models[0]["positive"]["parameters"];
    for (parameter, truth) in [(0, 2.0), (1, 1.0)] {
        let found = viscous[parameter]["value"].as_f64().expect("a number");
        assert!((found - truth).abs() < 0.01, "{viscous}");
    }
}

#[test]
fn bad_recordings_end_with_joint_and_signal_in_one_line() {
    type Change = fn(&mut [f64; 4], usize);
    let bad: [(Change, &str, &str); 4] = [
        (
            |values, row| values[1] *= if row % 10 < 5 { 1.0 } else { 0.5 },
            "reference_velocity_rad_s",
            "needed",
        ),
        (
            |values, _| values[2] = 1.0,
            "motor_position_rad",
            "never moved",
        ),
        (
            |values, row| values[3] = if row % 4 == 0 { values[3] } else { f64::NAN },
            "motor_torque_nm",
            "missing",
        ),
        (
            |values, _| values[3] = -values[3],
            "motor_torque_nm",
            "wrong sign",
        ),
    ];
    for (change, signal, what) in bad {
        let bench = Bench::new("id-recordings");
        upright(&bench);
        foreign_logs(&bench, &change);
        refused(
            &identify(&bench, "friction", &["--robot", "upright.toml"]),
            &["joint1", signal, what],
        );
    }
    let bench = Bench::new("id-damaged");
    upright(&bench);
    foreign_logs(&bench, &|_, _| ());
    fs::write(
        bench.file("out/recordings/friction-joint1-0.100.mcap"),
        "no recording",
    )
    .expect("written");
    refused(
        &identify(&bench, "friction", &["--robot", "upright.toml"]),
        &["friction-joint1-0.100.mcap"],
    );
}

fn refused(output: &Output, told: &[&str]) {
    assert_eq!(output.status.code(), Some(2), "{}", text(output));
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(message.trim_end().lines().count(), 1, "one line: {message}");
    for part in told {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

#[test]
fn what_is_missing_is_recorded_in_real_time_too_and_what_is_there_is_kept() {
    let bench = Bench::new("id-realtime");
    let arguments = ["--robot", "shd17", "--instance", &bench.instance];
    let first = identify(&bench, "friction", &arguments);
    assert!(first.status.success(), "{}", text(&first));
    let kept = bench.file("out/recordings/friction-joint1-0.100.mcap");
    let recorded_at = written_at(&kept);
    // The shortest of them once more, by the wall clock.
    let recording = bench.file("out/recordings/friction-joint1-0.400.mcap");
    fs::remove_file(&recording).expect("it was recorded");
    let second = identify(
        &bench,
        "friction",
        &[&arguments[..], &["--mode", "realtime"]].concat(),
    );
    assert!(second.status.success(), "{}", text(&second));
    let mode = recording::read(&recording).expect("a recording").metadata["mode"].clone();
    assert_eq!(mode, "realtime");
    assert_eq!(written_at(&kept), recorded_at, "not run again");
    let other_seed = [&arguments[..], &["--seed", "2"]].concat();
    let third = identify(&bench, "friction", &other_seed);
    assert!(third.status.success(), "{}", text(&third));
    assert_ne!(written_at(&kept), recorded_at, "another arm");
    assert_eq!(bench.left_behind(), Vec::<String>::new());
}

fn written_at(path: &Path) -> SystemTime {
    let metadata = fs::metadata(path).expect("it was written");
    metadata.modified().expect("file systems know that")
}

#[test]
fn a_joint_is_identified_as_in_the_paper_and_predicts_other_motion() {
    let bench = Bench::new("identify");
    let first = identify(&bench, "all", &["--joint", "joint3"]);
    assert!(first.status.success(), "{}", text(&first));
    let printed = String::from_utf8_lossy(&first.stdout).into_owned();
    for title in ["Table I", "Table II", "Table III", "not fitted"] {
        assert!(printed.contains(title), "{printed}");
    }
    let results: Value =
        serde_json::from_slice(&fs::read(bench.file("out/all.json")).expect("results"))
            .expect("JSON");
    let joint = &results["joints"][0];
    assert_eq!(joint["friction"]["chosen"], "stribeck", "{joint}");
    let measurements = joint["friction"]["measurements"].as_array();
    assert_eq!(measurements.map(Vec::len), Some(80), "as in the paper");
    // Table III: 39.65 and 238.9 cycles per joint radian, which is 5 and 30 per motor revolution.
    let cycles: Vec<f64> = joint["periodic"]["combined"]
        .as_array()
        .expect("harmonics")
        .iter()
        .filter_map(|harmonic| harmonic["cycles_per_motor_rev"].as_f64())
        .collect();
    for order in [5.0, 30.0] {
        assert!(
            cycles.iter().any(|found| (found - order).abs() < 0.1),
            "{cycles:?}"
        );
    }

    let report = fs::read_to_string(bench.file("out/report.html")).expect("a report");
    assert!(report.contains("PA10-05, Table III"));
    // Motion that was not fitted is predicted to a few percent, and better than by the file.
    let rms_nm = |by: &str| joint["held_out"][by]["rms_nm"].as_f64().expect("an error");
    let share = joint["held_out"]["identified"]["share"].as_f64();
    assert!(share.expect("a share") < 0.03, "{}", joint["held_out"]);
    assert!(rms_nm("identified") < 0.5 * rms_nm("file"));
}

#[test]
fn a_model_with_what_was_identified_needs_less_feedback() {
    let bench = Bench::new("model");
    let identified = identify(&bench, "all", &["--robot", "shd17"]);
    assert!(identified.status.success(), "{}", text(&identified));
    let feedback_nm = |robot: &str| {
        let arguments = [
            "--mode",
            "lockstep",
            "--duration",
            "10s",
            "--plant",
            "shd17",
        ];
        let run = output(bench.run(&[&arguments[..], &["--robot", robot]].concat()));
        assert!(run.status.success(), "{}", text(&run));
        bench.report()["tracking"]["joints"][0]["feedback_torque_nm"]["rms"]
            .as_f64()
            .expect("feedback")
    };
    let (before_nm, after_nm) = (feedback_nm("shd17"), feedback_nm("out/identified.toml"));
    assert!(after_nm < before_nm, "{before_nm} Nm, then {after_nm} Nm");
}

#[test]
fn bad_input_is_one_line_and_exit_code_two() {
    let bench = Bench::new("id-bad");
    fs::write(bench.file("occupied"), "").expect("written");
    for (arguments, told) in [
        (vec!["--driver", "can"], "emulator"),
        (vec!["--joint", "joint9"], "joint9"),
        (vec!["--robot", "missing.toml"], "missing.toml"),
        (vec!["--out", "occupied"], "occupied"),
    ] {
        let mut command = bench.flexspline();
        command.args(["identify", "friction"]);
        if !arguments.contains(&"--out") {
            command.args(["--out", "out"]);
        }
        command.args(&arguments);
        refused(&output(command), &[told]);
    }
}
