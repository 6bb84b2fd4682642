//! A driver in a process of its own, in Rust and in Python.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::support::{Bench, python, spawn, text};

mod support;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Where cargo has put what it built for the tests.
fn built() -> PathBuf {
    let program = Path::new(env!("CARGO_BIN_EXE_flexspline"));
    program.parent().expect("a directory").to_owned()
}

/// The same driver in Python, where that has its packages.
fn in_python() -> Option<Command> {
    let mut command = python()?;
    command.arg(root().join("examples/process_driver.py"));
    Some(command)
}

#[test]
fn a_process_of_ones_own_drives_in_any_language() {
    let rust = Command::new(built().join("examples/process_driver"));
    for (name, mut driver) in [("rust", Some(rust)), ("python", in_python())] {
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
