//! What is done with a diagnosis: the next experiment, the live watch, the round of inject, diagnose, apply and run.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod support;

use std::fs;

use serde_json::Value;
use support::{Bench, output, text};

/// The single test joint on a plant that nobody tuned: another name has no plant file.
fn bench(name: &str) -> Bench {
    let bench = Bench::new(name);
    let robot = fs::read_to_string("robots/shd17.toml").unwrap();
    let robot = robot.replace("name = \"shd17\"", "name = \"bench\"");
    fs::write(bench.file("bench.toml"), robot).unwrap();
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

const SPRING: &str = "[[effect]]\njoint = \"joint1\"\neffect = \"joint_spring\"\nstiffness_nm_rad = 6.0\nrest_rad = 0.4\n";

/// Runs a trajectory on the plant with the effect and diagnoses the recording: the joint's part of the report.
fn diagnosed(bench: &Bench, trajectory: &str, duration: &str, out: &str) -> Value {
    let arguments = [
        "--mode",
        "lockstep",
        "--robot",
        "bench.toml",
        "--trajectory",
        trajectory,
        "--duration",
        duration,
        "--inject",
        "gap.toml",
        "--estimators",
        "residual",
    ];
    let mut run = bench.run(&arguments);
    run.current_dir(bench.directory.path());
    let ran = output(run);
    assert!(ran.status.success(), "{}", text(&ran));
    flexspline(
        bench,
        &format!("gap diagnose --robot bench.toml --recording run.mcap --out {out}"),
    );
    json(bench, &format!("{out}/report.json"))["joints"][0].clone()
}

/// Whether the report takes the two for each other.
fn confuses(joint: &Value, one: &str) -> bool {
    joint["confusable"].as_array().unwrap().iter().any(|pair| {
        pair["effects"].as_array().unwrap().contains(&one.into())
            && pair["distance"].as_f64().unwrap() < 9.0
    })
}

#[test]
fn the_suggested_trajectory_tells_apart_what_the_data_could_not() {
    let bench = bench("suggest");
    fs::write(bench.file("gap.toml"), SPRING).unwrap();
    let small = "[[joint]]\nkind = \"multi_sine\"\nname = \"joint1\"\namplitude_rad = 0.12\n";
    fs::write(bench.file("small.toml"), small).unwrap();
    let before = diagnosed(&bench, "small.toml", "15s", "before");
    assert_eq!(before["verdict"], "ambiguous", "{before}");
    let told = flexspline(
        &bench,
        "gap suggest --report before/report.json --robot bench.toml --out next.csv --duration 20s",
    );
    assert!(told.contains("best: "), "{told}");
    let after = diagnosed(&bench, "next.csv", "20s", "after");
    assert_eq!(after["effects"][0]["effect"], "joint_spring", "{after}");
    assert!(!confuses(&after, "joint_spring"), "{after}");
}
