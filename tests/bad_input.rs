//! Bad input ends with one clear line and exit code 2, before anything is started.

mod support;

use std::fs;

use support::{Bench, output, text};

fn refused(bench: &Bench, arguments: &[&str], expected: &[&str]) {
    let output = output(bench.run(arguments));
    assert_eq!(
        output.status.code(),
        Some(2),
        "{arguments:?}: {}",
        text(&output)
    );
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(message.trim_end().lines().count(), 1, "one line: {message}");
    for part in expected {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
    assert_eq!(bench.left_behind(), Vec::<String>::new());
}

#[test]
fn each_wrong_argument_is_named_with_its_remedy() {
    let bench = Bench::new("bad");
    refused(&bench, &["--robot", "pa11"], &["pa11", "pa10"]);
    refused(&bench, &["--robot", "missing.toml"], &["missing.toml"]);
    refused(
        &bench,
        &["--trajectory", "lemniskate"],
        &["lemniskate", "lemniscate"],
    );
    refused(
        &bench,
        &["--robot", "shd17", "--trajectory", "lemniscate"],
        &["lemniscate"],
    );
    refused(
        &bench,
        &["--driver", "can"],
        &["`can`", "emulator, process, ethercat, moteus"],
    );
    refused(&bench, &["--duration", "1us"], &["--duration", "667 µs"]);
    refused(&bench, &["--inject", "missing.toml"], &["missing.toml"]);
    refused(
        &bench,
        &["--mode", "warp"],
        &["warp", "realtime", "lockstep"],
    );
    refused(
        &bench,
        &["--stiffness-torque", "torsion"],
        &["pa10", "joint1", "link_encoder_resolution_rad"],
    );
    refused(&bench, &["--correction", "1.5"], &["1.5", "between 0"]);
    refused(
        &bench,
        &["--correction", "1", "--control", "velocity"],
        &["--correction", "--control torque"],
    );
    refused(&bench, &["--duraton", "1s"], &["--duraton", "--duration"]);
    let escaping = Bench {
        instance: "../escape".to_owned(),
        ..Bench::new("escape")
    };
    refused(&escaping, &[], &["../escape"]);
}

#[test]
fn malformed_files_are_named_with_line_and_key() {
    let bench = Bench::new("files");
    let robot = bench.file("robot.toml");
    fs::write(&robot, "name = \"x\"\ngravity_m_s2 = [0.0, 0.0\n").expect("written");
    refused(
        &bench,
        &["--robot", robot.to_str().expect("a path")],
        &["robot.toml", "line"],
    );
    let inject = bench.file("gap.toml");
    fs::write(
        &inject,
        "[[effect]]\njoint = \"joint22\"\neffect = \"coulomb_friction\"\ncoulomb_nm = 1.0\n",
    )
    .expect("written");
    refused(
        &bench,
        &["--inject", inject.to_str().expect("a path")],
        &["gap.toml", "joint22", "joint2"],
    );
    fs::write(
        &inject,
        "[[effect]]\njoint = \"joint2\"\neffect = \"coulomb_fricton\"\ncoulomb_nm = 1.0\n",
    )
    .expect("written");
    refused(
        &bench,
        &["--inject", inject.to_str().expect("a path")],
        &["coulomb_fricton", "coulomb_friction"],
    );
}

#[test]
fn a_recording_that_cannot_be_written_is_refused_at_once() {
    let bench = Bench::new("record");
    let nowhere = bench.file("no/such/place.mcap");
    let mut command = bench.flexspline();
    command
        .args(["run", "--instance", &bench.instance, "--record"])
        .arg(&nowhere);
    let output = output(command);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(
        String::from_utf8_lossy(&output.stderr).contains("--record"),
        "{}",
        text(&output)
    );
}
