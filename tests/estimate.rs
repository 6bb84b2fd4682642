//! `flexspline estimate`: calibrated on one recording, judged on another, and clear where a signal is missing.

mod support;

use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::fs;
use std::process::Output;

use serde_json::Value;
use support::{Bench, output, text};

fn record(bench: &Bench, trajectory: &str, duration: &str, name: &str) {
    let mut command = bench.flexspline();
    command.args(["run", "--robot", "shd17", "--mode", "lockstep"]);
    command.args(["--instance", &bench.instance, "--seed", "3"]);
    command.args([
        "--trajectory",
        trajectory,
        "--duration",
        duration,
        "--record",
        name,
    ]);
    let ran = output(command);
    assert!(ran.status.success(), "{}", text(&ran));
}

fn estimate(bench: &Bench, arguments: &[&str]) -> Output {
    let mut command = bench.flexspline();
    command.arg("estimate").args(arguments);
    output(command)
}

fn json(bench: &Bench, name: &str) -> Value {
    serde_json::from_slice(&fs::read(bench.file(name)).expect("written")).expect("JSON")
}

#[test]
fn fusion_beats_the_published_estimators_on_a_motion_it_was_not_calibrated_on() {
    let bench = Bench::new("estimate");
    record(&bench, "multi_sine", "12s", "first.mcap");
    record(&bench, "sine", "8s", "second.mcap");
    let calibrated = estimate(
        &bench,
        &[
            "calibrate",
            "--robot",
            "shd17",
            "--recording",
            "first.mcap",
            "--out",
            "new.toml",
        ],
    );
    assert!(calibrated.status.success(), "{}", text(&calibrated));
    let compared = estimate(
        &bench,
        &[
            "compare",
            "--robot",
            "new.toml",
            "--recording",
            "second.mcap",
            "--json",
            "out.json",
            "--report",
            "report.html",
        ],
    );
    assert!(compared.status.success(), "{}", text(&compared));
    let results = json(&bench, "out.json");
    let estimators = results["joints"][0]["estimators"]
        .as_array()
        .expect("scores");
    assert_eq!(estimators.len(), 7, "{results}");
    let rms = |kind: &str| {
        let found = estimators.iter().find(|found| found["kind"] == kind);
        found
            .and_then(|found| found["dynamic"]["rms_nm"].as_f64())
            .expect(kind)
    };
    for kind in [
        "structural_damping",
        "compliance",
        "taghirad",
        "disturbance_observer",
        "gaussian_process",
    ] {
        assert!(rms("fusion") < rms(kind), "{kind}: {results}");
    }
    let page = fs::read_to_string(bench.file("report.html")).expect("a page");
    assert!(page.contains("SD Figs. 8 and 10"));
}

/// Signals of a foreign log, with the column and its factor in the mapping.
const FOREIGN: [(&str, &str, f64); 4] = [
    ("motor_position_rad", "axis_deg", PI / 180.0),
    ("link_position_rad", "arm_deg", PI / 180.0),
    ("motor_torque_nm", "drive_mnm", 1e-3),
    ("joint_torque_nm", "sensor", 1.0),
];

/// A motor with Coulomb friction of 2 Nm that swings a load through a spring: what a foreign logger in degrees would write.
/// One signal may be missing from it.
fn foreign_log(bench: &Bench, missing: &str) {
    let mut rows = String::from("t,axis_deg,arm_deg,drive_mnm,sensor\n");
    for row in 0..6000 {
        let time_s = f64::from(row) / 1000.0;
        let angle = 0.8 * (TAU * 0.5 * time_s).sin();
        let velocity = 0.8 * TAU * 0.5 * (TAU * 0.5 * time_s).cos();
        let acceleration = -0.8 * (TAU * 0.5f64).powi(2) * (TAU * 0.5 * time_s).sin();
        let load = 6.0 * angle.sin();
        let drive = (load + 2.0 * velocity.signum() + 0.114 * acceleration) / 100.0;
        let _ = writeln!(
            rows,
            "{time_s},{},{},{},{load}",
            angle.to_degrees() * 100.0,
            (angle - load / 8333.0).to_degrees(),
            1e3 * drive
        );
    }
    fs::write(bench.file("log.csv"), rows).expect("written");
    let mut mapping = String::from("[columns]\ntime_s = \"t\"\n[joint.joint1]\n");
    for (signal, column, scale) in FOREIGN.iter().filter(|(signal, ..)| *signal != missing) {
        let _ = writeln!(
            mapping,
            "{signal} = {{ column = \"{column}\", scale = {scale} }}"
        );
    }
    fs::write(bench.file("log.toml"), mapping).expect("written");
}

fn calibrate(bench: &Bench) -> Output {
    let arguments =
        "calibrate --robot shd17 --recording log.csv --joint joint1 --out new.toml --json out.json";
    estimate(bench, &arguments.split(' ').collect::<Vec<_>>())
}

fn compare(bench: &Bench) -> Output {
    let arguments = "compare --robot shd17 --recording log.csv --joint joint1";
    estimate(bench, &arguments.split(' ').collect::<Vec<_>>())
}

#[test]
fn a_foreign_log_calibrates_what_it_has_signals_for() {
    let bench = Bench::new("estimate-foreign");
    foreign_log(&bench, "link_position_rad");
    let calibrated = calibrate(&bench);
    assert!(calibrated.status.success(), "{}", text(&calibrated));
    let results = json(&bench, "out.json");
    let fits = results["joints"][0]["fits"].as_array().expect("fits");
    assert_eq!(fits.len(), 1, "{results}");
    let coulomb_nm = fits[0]["fitted"][0]["value"].as_f64().expect("a value");
    assert!((coulomb_nm - 2.0).abs() < 0.1, "{results}");
}

/// For each missing signal: how the command ends, and what its one line, or its finding, says.
#[test]
fn both_commands_name_the_signal_that_a_log_lacks() {
    let bench = Bench::new("estimate-missing");
    type Command = fn(&Bench) -> Output;
    let calibrate_any: Command = |bench| {
        let arguments = "calibrate --robot shd17 --recording log.csv --out new.toml";
        estimate(bench, &arguments.split(' ').collect::<Vec<_>>())
    };
    let table: [(&str, Command, i32, &str); 9] = [
        ("motor_position_rad", calibrate, 2, "motor_position_rad"),
        ("motor_position_rad", compare, 2, "motor_position_rad"),
        (
            "link_position_rad",
            calibrate,
            0,
            "no link_position_rad: structural damping, compliance, Taghirad, Gaussian process, fusion",
        ),
        (
            "link_position_rad",
            compare,
            0,
            "structural damping: no estimate, needs link_position_rad",
        ),
        (
            "motor_torque_nm",
            calibrate,
            0,
            "no motor_torque_nm: compliance, disturbance observer, Gaussian process, fusion",
        ),
        (
            "motor_torque_nm",
            compare,
            0,
            "residual: no estimate, needs motor_torque_nm",
        ),
        ("joint_torque_nm", calibrate, 2, "--reference gravity"),
        ("joint_torque_nm", calibrate_any, 2, "--reference gravity"),
        ("joint_torque_nm", compare, 2, "joint_torque_nm"),
    ];
    for (missing, command, code, told) in table {
        foreign_log(&bench, missing);
        let ran = command(&bench);
        assert_eq!(ran.status.code(), Some(code), "{missing}: {}", text(&ran));
        assert!(text(&ran).contains(told), "{missing}: {}", text(&ran));
        if code == 2 {
            let said = String::from_utf8_lossy(&ran.stderr).into_owned();
            assert!(
                said.contains("log.csv") && said.contains(missing) && said.lines().count() == 1,
                "{said}"
            );
        }
    }
}
