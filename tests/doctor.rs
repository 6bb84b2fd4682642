//! `flexspline doctor` on this machine, whatever it grants, and the files it sends people to.

mod support;

use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use support::{Bench, for_everybody, output, text};

fn deploy(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("deploy")
        .join(path)
}

#[test]
fn the_answer_is_no_exactly_if_something_is_missing() {
    let bench = Bench::new("doctor");
    let mut doctor = bench.flexspline();
    doctor.args(["doctor", "--probe", "200ms", "--json", "-"]);
    let output = output(doctor);
    let report: Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", text(&output)));
    let findings = report["findings"].as_array().expect("a list");
    let missing = findings
        .iter()
        .any(|finding| finding["verdict"] == "missing");
    assert_eq!(
        output.status.code(),
        Some(i32::from(missing)),
        "{}",
        text(&output)
    );
    assert_eq!(report["probe"]["wakeup_lateness"]["count"], 299, "{report}");
    for finding in findings {
        assert!(
            finding["is"].is_string() && finding["cost"].is_string(),
            "{finding}"
        );
    }
}

#[test]
fn bad_input_is_one_line_and_exit_code_two() {
    let bench = Bench::new("doctor2");
    for arguments in [
        ["--probe", "1us"],
        ["--probe", "soon"],
        ["--probe", "400days"],
    ] {
        let mut doctor = bench.flexspline();
        doctor.arg("doctor").args(arguments);
        let output = output(doctor);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(message.lines().count(), 1, "{message}");
        assert!(message.contains("--probe"), "{message}");
    }
}

#[test]
fn a_user_without_rights_is_told_what_to_do() {
    if realtime::process::user_id() != 0 {
        println!("skipped: becoming a user without rights needs root");
        return;
    }
    let directory = tempfile::tempdir().expect("a temporary directory");
    let program = for_everybody(Path::new(env!("CARGO_BIN_EXE_flexspline")), &directory);
    let mut doctor = Command::new(program);
    doctor
        .args(["doctor", "--probe", "100ms"])
        .uid(65_534)
        .gid(65_534);
    let output = output(doctor);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    let shown = String::from_utf8_lossy(&output.stdout).into_owned();
    for part in [
        "rtprio 0",
        "deploy/limits",
        "ordinary scheduler",
        "refused: ",
    ] {
        assert!(shown.contains(part), "`{part}` is missing in: {shown}");
    }
}

#[test]
fn systemd_understands_the_unit() {
    let found = Command::new("systemd-analyze").arg("--version").output();
    if !found.is_ok_and(|found| found.status.success()) {
        println!("skipped: no systemd-analyze here");
        return;
    }
    // The unit names the installed program, which is not there: this one stands in.
    let directory = tempfile::tempdir().expect("a temporary directory");
    let unit = fs::read_to_string(deploy("systemd/flexspline@.service")).expect("shipped");
    let unit = unit.replace(
        "/usr/local/bin/flexspline",
        env!("CARGO_BIN_EXE_flexspline"),
    );
    let path = directory.path().join("flexspline@arm1.service");
    fs::write(&path, unit).expect("written");
    let mut verify = Command::new("systemd-analyze");
    verify.args(["verify", "--man=no"]).arg(&path);
    let output = output(verify);
    assert!(output.status.success(), "{}", text(&output));
    assert!(output.stderr.is_empty(), "{}", text(&output));
}

#[test]
fn every_file_the_doctor_names_is_shipped() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/doctor");
    let mut named = 0;
    for entry in fs::read_dir(sources).expect("the sources").flatten() {
        let source = fs::read_to_string(entry.path()).expect("text");
        for (place, _) in source.match_indices("deploy/") {
            let path: String = source[place + "deploy/".len()..]
                .chars()
                .take_while(|letter| !letter.is_whitespace() && !",;\"".contains(*letter))
                .collect();
            assert!(deploy(&path).is_file(), "deploy/{path}");
            named += 1;
        }
    }
    assert!(named > 4, "{named}");
}
