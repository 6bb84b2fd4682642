//! `flexspline estimate`: calibrated on one recording, judged on another, and clear where a signal is missing.

mod support;

use std::f64::consts::TAU;
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

/// A motor with Coulomb friction of 2 Nm that swings a load: what a foreign logger in degrees would write.
fn foreign_log(bench: &Bench, with_sensor: bool) {
    let mut rows = String::from("t,axis_deg,drive,sensor\n");
    for row in 0..6000 {
        let time_s = f64::from(row) / 1000.0;
        let angle = 0.8 * (TAU * 0.5 * time_s).sin();
        let velocity = 0.8 * TAU * 0.5 * (TAU * 0.5 * time_s).cos();
        let acceleration = -0.8 * (TAU * 0.5f64).powi(2) * (TAU * 0.5 * time_s).sin();
        let load = 6.0 * angle.sin();
        let drive = (load + 2.0 * velocity.signum() + 0.114 * acceleration) / 100.0;
        let _ = writeln!(
            rows,
            "{time_s},{},{drive},{load}",
            angle.to_degrees() * 100.0
        );
    }
    fs::write(bench.file("log.csv"), rows).expect("written");
    let sensor = if with_sensor {
        "joint_torque_nm = \"sensor\"\n"
    } else {
        ""
    };
    let mapping = format!(
        "[columns]\ntime_s = \"t\"\n[joint.joint1]\nmotor_position_rad = {{ column = \"axis_deg\", scale = {} }}\n\
         motor_torque_nm = \"drive\"\n{sensor}",
        1.0f64.to_radians()
    );
    fs::write(bench.file("log.toml"), mapping).expect("written");
}

#[test]
fn a_foreign_log_calibrates_what_it_has_signals_for_and_names_what_is_missing() {
    let bench = Bench::new("estimate-foreign");
    let arguments = [
        "calibrate",
        "--robot",
        "shd17",
        "--recording",
        "log.csv",
        "--out",
        "new.toml",
    ];
    foreign_log(&bench, true);
    let calibrated = estimate(&bench, &[&arguments[..], &["--json", "out.json"]].concat());
    assert!(calibrated.status.success(), "{}", text(&calibrated));
    let printed = String::from_utf8_lossy(&calibrated.stdout).into_owned();
    assert!(printed.contains("no link_position_rad"), "{printed}");
    let results = json(&bench, "out.json");
    let fits = results["joints"][0]["fits"].as_array().expect("fits");
    assert_eq!(fits.len(), 1, "{results}");
    let coulomb_nm = fits[0]["fitted"][0]["value"].as_f64().expect("a value");
    assert!((coulomb_nm - 2.0).abs() < 0.1, "{results}");

    foreign_log(&bench, false);
    let refused = estimate(&bench, &[&arguments[..], &["--joint", "joint1"]].concat());
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        said.contains("joint_torque_nm") && said.contains("log.csv"),
        "{said}"
    );
    assert!(
        said.contains("--reference gravity") && said.lines().count() == 1,
        "{said}"
    );
}
