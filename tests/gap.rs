//! The gap diagnosis as a user runs it: cases made, diagnosed and scored, and one of them applied.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;
use std::process::{Command, Output};

fn flexspline(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_flexspline"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn works(output: &Output) {
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {errors}", output.status);
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn cases_are_made_diagnosed_scored_and_applied() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let make = [
        "gap",
        "blind",
        "make",
        "--out",
        "cases",
        "--cases",
        "2",
        "--seed",
        "5",
        "--kind",
        "one_effect",
        "--seven-joints",
        "0",
        "--duration",
        "10s",
    ];
    works(&flexspline(at, &make));
    works(&flexspline(
        at,
        &["gap", "blind", "run", "--cases", "cases", "--out", "told"],
    ));
    let score = [
        "gap",
        "blind",
        "score",
        "--cases",
        "cases",
        "--predictions",
        "told",
        "--json",
        "score.json",
    ];
    works(&flexspline(at, &score));
    assert!(json(&at.join("score.json")).is_object());
    let report = json(&at.join("told/case-0001/report.json"));
    let candidates = report["joints"][0]["candidates"].as_array().unwrap();
    let sum: f64 = candidates
        .iter()
        .map(|candidate| candidate["probability"].as_f64().unwrap())
        .sum();
    assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    let apply = [
        "gap",
        "apply",
        "--report",
        "told/case-0001/report.json",
        "--robot",
        "cases/case-0001/robot.toml",
        "--out",
        "new.toml",
    ];
    works(&flexspline(at, &apply));
    let again = [
        "gap",
        "diagnose",
        "--robot",
        "new.toml",
        "--recording",
        "cases/case-0001/recording.mcap",
        "--out",
        "again",
    ];
    works(&flexspline(at, &again));
    assert!(at.join("again/report.html").is_file());
}

#[test]
fn a_sealed_label_that_was_changed_is_not_scored() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let make = [
        "gap",
        "blind",
        "make",
        "--out",
        "cases",
        "--cases",
        "1",
        "--seed",
        "6",
        "--kind",
        "no_gap",
        "--seven-joints",
        "0",
        "--duration",
        "5s",
    ];
    works(&flexspline(at, &make));
    let sealed = at.join("cases/labels.sealed");
    let mut bytes = std::fs::read(&sealed).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    std::fs::write(&sealed, bytes).unwrap();
    let score = flexspline(
        at,
        &[
            "gap",
            "blind",
            "score",
            "--cases",
            "cases",
            "--predictions",
            "cases",
        ],
    );
    assert_eq!(score.status.code(), Some(2));
}

#[test]
fn a_recording_of_another_robot_is_one_clear_line() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(
        at.join("log.csv"),
        "time_s,elbow.motor_position_rad\n0,0\n1,1\n",
    )
    .unwrap();
    let output = flexspline(
        at,
        &[
            "gap",
            "diagnose",
            "--robot",
            "shd17",
            "--recording",
            "log.csv",
        ],
    );
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{errors}");
    assert_eq!(errors.trim().lines().count(), 1, "{errors}");
}

#[test]
fn of_all_that_is_wrong_what_forbids_a_diagnosis_is_told() {
    use std::fmt::Write;
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut log = "time_s,joint1.motor_position_rad,joint1.motor_torque_nm\n".to_owned();
    for row in 0..2000 {
        // a hole after five seconds, and no motion
        let time_s = 0.01 * f64::from(row) + if row < 500 { 0.0 } else { 3.0 };
        writeln!(log, "{time_s},0.5,{}", 0.01 * f64::from(row % 3)).unwrap();
    }
    std::fs::write(at.join("log.csv"), log).unwrap();
    let diagnose = "gap diagnose --robot shd17 --recording log.csv";
    let output = flexspline(at, &diagnose.split(' ').collect::<Vec<_>>());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{errors}");
    assert_eq!(errors.trim().lines().count(), 1, "{errors}");
    assert!(errors.contains("stands still"), "{errors}");
}

#[test]
fn of_joints_that_stand_and_one_that_lacks_its_torque_the_lack_is_told() {
    use std::fmt::Write;
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut log =
        "time_s,joint1.motor_position_rad,joint1.motor_torque_nm,joint2.motor_position_rad\n"
            .to_owned();
    for row in 0..2000 {
        let time_s = 0.01 * f64::from(row);
        let still_nm = 0.01 * f64::from(row % 3);
        writeln!(
            log,
            "{time_s},0.5,{still_nm},{}",
            50.0 * (1.3 * time_s).sin()
        )
        .unwrap();
    }
    std::fs::write(at.join("log.csv"), log).unwrap();
    let diagnose = "gap diagnose --robot pa10 --recording log.csv";
    let output = flexspline(at, &diagnose.split(' ').collect::<Vec<_>>());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{errors}");
    assert_eq!(errors.trim().lines().count(), 1, "{errors}");
    assert!(
        errors.contains("joint2") && errors.contains("torque"),
        "{errors}"
    );
}
