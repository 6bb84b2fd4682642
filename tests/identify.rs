//! `flexspline identify`: from the emulated arm's recordings to a robot file that controls it better.

mod support;

use std::fs;
use std::path::Path;
use std::process::Output;
use std::time::SystemTime;

use serde_json::Value;
use support::{Bench, output, text};

fn identify(bench: &Bench, what: &str, arguments: &[&str]) -> Output {
    let mut command = bench.flexspline();
    command.args(["identify", what, "--out", "out"]);
    command.args(arguments);
    output(command)
}

fn written_at(path: &Path) -> SystemTime {
    let metadata = fs::metadata(path).expect("it was written");
    metadata.modified().expect("file systems know that")
}

#[test]
fn a_joint_is_identified_once_and_then_tracks_better() {
    let bench = Bench::new("identify");
    let first = identify(&bench, "all", &["--joint", "joint3"]);
    assert!(first.status.success(), "{}", text(&first));
    let printed = String::from_utf8_lossy(&first.stdout).into_owned();
    for title in ["Table I", "Table II", "Table III"] {
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

    let recording = bench.file("out/recordings/periodic-joint3.mcap");
    let recorded_at = written_at(&recording);
    let second = identify(&bench, "periodic", &["--joint", "joint3"]);
    assert!(second.status.success(), "{}", text(&second));
    assert_eq!(written_at(&recording), recorded_at, "not run again");
    let other_seed = identify(&bench, "periodic", &["--joint", "joint3", "--seed", "2"]);
    assert!(other_seed.status.success(), "{}", text(&other_seed));
    assert_ne!(written_at(&recording), recorded_at, "another arm");
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
        let refused = output(command);
        assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
        let message = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(
            message.contains(told) && message.trim_end().lines().count() == 1,
            "{message}"
        );
    }
}
