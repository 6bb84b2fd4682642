//! The maker's Python package on the emulator, through a pseudo-terminal: the oracle that nobody here wrote.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use moteus_emulator::process::Ports;
use moteus_emulator::{Bench, Setup};

/// An interpreter that has the package: the one named in `FLEXSPLINE_PYTHON`, or `python3`.
fn python() -> Option<String> {
    let python = std::env::var("FLEXSPLINE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let imports = Command::new(&python).args(["-c", "import moteus"]).output();
    if imports.is_ok_and(|imports| imports.status.success()) {
        return Some(python);
    }
    eprintln!(
        "skipped: {python} cannot import moteus; see tests/requirements.txt, and set FLEXSPLINE_PYTHON"
    );
    None
}

#[test]
fn the_makers_package_finds_reads_configures_and_moves_the_drives() {
    let Some(python) = python() else {
        return;
    };
    let mut ports = Ports::open(1, None).unwrap();
    let path = ports.path(0);
    let stop = Arc::new(AtomicBool::new(false));
    let served = {
        let stop = Arc::clone(&stop);
        thread::spawn(move || {
            let robot = robot::load("pa10").unwrap();
            let setup = Setup {
                initial_position_rad: vec![0.0; robot.joints.len()],
                buses: 1,
                is_homed: true,
                seed: 1,
                faults: Vec::new(),
            };
            ports.serve(&mut Bench::new(&robot, &setup).unwrap(), &stop, |_| ())
        })
    };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/maker.py");
    let ran = Command::new(python).arg(script).arg(&path).output();
    stop.store(true, Ordering::Relaxed);
    served.join().unwrap().unwrap();
    let ran = ran.unwrap();
    let said = String::from_utf8_lossy(&ran.stderr);
    assert!(
        ran.status.success(),
        "{said}{}",
        String::from_utf8_lossy(&ran.stdout)
    );
}
