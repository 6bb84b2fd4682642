//! A driver that is not part of Flexspline: in a package outside its workspace, and in a process of its own.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::support::{Bench, output, spawn, text};

mod support;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Where cargo has put what it built for the tests.
fn built() -> PathBuf {
    let program = Path::new(env!("CARGO_BIN_EXE_flexspline"));
    program.parent().expect("a directory").to_owned()
}

/// Builds the package as its owner would, with the dependencies that are there already.
fn own_driver() -> PathBuf {
    let package = root().join("examples/own_driver");
    std::fs::copy(root().join("Cargo.lock"), package.join("Cargo.lock")).expect("copied");
    // What the tests were built from is not built again.
    let target = built().join("..");
    let mut cargo = Command::new(env!("CARGO"));
    cargo
        .args(["build", "--release", "--offline", "--manifest-path"])
        .arg(package.join("Cargo.toml"))
        .env("CARGO_TARGET_DIR", &target);
    let build = output(cargo);
    assert!(build.status.success(), "{}", text(&build));
    target.join("release/own-driver")
}

#[test]
fn a_package_of_ones_own_runs_with_its_driver() {
    let program = own_driver();
    let call = |arguments: &[&str]| {
        let mut command = Command::new(&program);
        command.args(arguments).current_dir(std::env::temp_dir());
        output(command)
    };
    let doctor = call(&[
        "doctor",
        "--no-probe",
        "--driver",
        "mine",
        "--robot",
        "shd17",
    ]);
    assert!(
        text(&doctor).contains("my drive, firmware 1.0"),
        "{}",
        text(&doctor)
    );

    let bench = Bench::new("own-driver");
    let recording = std::env::temp_dir().join(format!("{}.mcap", bench.instance));
    let recording = recording.display().to_string();
    let run = |robot: &str| {
        call(&[
            "run",
            "--driver",
            "mine",
            "--robot",
            robot,
            "--mode",
            "lockstep",
            "--duration",
            "2s",
            "--instance",
            &bench.instance,
            "--record",
            &recording,
        ])
    };
    let ran = run("shd17");
    assert!(ran.status.success(), "{}", text(&ran));

    let unknown = call(&["run", "--driver", "yours"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(
        text(&unknown).contains("emulator, process, mine"),
        "{}",
        text(&unknown)
    );

    // What does not fit the robot file is told before anything moves.
    let shipped = std::fs::read_to_string(root().join("robots/shd17.toml")).expect("shipped");
    let slow = format!("{shipped}\n[drive]\nwatchdog_ms = 500\n");
    let slow_file = std::env::temp_dir().join(format!("{}.toml", bench.instance));
    std::fs::write(&slow_file, slow).expect("written");
    let refused = run(&slow_file.display().to_string());
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    assert!(
        text(&refused).contains("watchdog waits 500 ms"),
        "{}",
        text(&refused)
    );

    let faults = call(&[
        "faults",
        "--driver",
        "mine",
        "--robot",
        "shd17",
        "--short",
        "--part",
        "processes",
    ]);
    assert!(faults.status.success(), "{}", text(&faults));
    assert!(
        text(&faults).contains("feedforward killed"),
        "{}",
        text(&faults)
    );
    for file in [Path::new(&recording), &slow_file] {
        let _ = std::fs::remove_file(file);
    }
}

/// A Python with the packages of `tests/requirements.txt`; the reason is printed where there is none.
fn python() -> Option<Command> {
    let python = std::env::var("FLEXSPLINE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has_package = Command::new(&python)
        .args(["-c", "import iceoryx2"])
        .output()
        .is_ok_and(|found| found.status.success());
    if !has_package {
        println!("skipped: {python} has no package iceoryx2; see tests/requirements.txt");
        return None;
    }
    let mut command = Command::new(python);
    command.arg(root().join("examples/process_driver.py"));
    Some(command)
}

#[test]
fn a_process_of_ones_own_drives_in_any_language() {
    let rust = Command::new(built().join("examples/process_driver"));
    for (name, mut driver) in [("rust", Some(rust)), ("python", python())] {
        let Some(driver) = &mut driver else { continue };
        let bench = Bench::new(&format!("process-{name}"));
        // In lockstep, where a slow process is waited for.
        let run = spawn(bench.run(&[
            "--driver",
            "process",
            "--control",
            "velocity",
            "--robot",
            "shd17",
            "--mode",
            "lockstep",
            "--duration",
            "2s",
        ]));
        bench.await_process("loop");
        driver.arg(&bench.instance).stdout(Stdio::piped());
        let drove = spawn(std::mem::replace(driver, Command::new("true")));
        let ran = run.wait_with_output().expect("the run ends");
        assert!(ran.status.success(), "{name}: {}", text(&ran));
        let drove = drove.wait_with_output().expect("the driver ends");
        assert!(drove.status.success(), "{name}: {}", text(&drove));
        assert!(
            text(&drove).contains("drove 30"),
            "{name}: {}",
            text(&drove)
        );
    }
}
