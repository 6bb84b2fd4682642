//! Masters that nobody here wrote bring the drives to OP, read their objects and run their process data: SOEM (pysoem), KickCAT.
//!
//! They run in a network namespace of their own. Where that is not allowed, or the packages are not installed
//! (`FLEXSPLINE_PYTHON` names a Python that has them), the tests say so and end.

use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ethercat_emulator::socket::{RawSocket, now_ns, serve};
use ethercat_emulator::{Options, segment};
use plant_emulator::PlantParameters;

/// Set in the process that runs inside the namespace.
const INSIDE: &str = "FLEXSPLINE_ETHERCAT_INSIDE";

fn python() -> String {
    std::env::var("FLEXSPLINE_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

/// Why the test cannot be run, if it cannot.
fn obstacle(module: &str) -> Option<String> {
    let works = |command: &mut Command| {
        let status = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
        status.is_ok_and(|status| status.success())
    };
    if !works(Command::new(python()).args(["-c", &format!("import {module}")])) {
        return Some(format!("{} has no package {module}", python()));
    }
    let veth = "ip link add ecTry0 type veth peer name ecTry1";
    if !works(Command::new("unshare").args(["-n", "sh", "-c", veth])) {
        return Some("no network namespace with a veth pair can be made here".to_owned());
    }
    None
}

/// Runs the test `name` again inside a namespace, where it finds a veth pair; true in there.
fn is_inside(name: &str, module: &str) -> bool {
    if std::env::var_os(INSIDE).is_some() {
        return true;
    }
    if let Some(obstacle) = obstacle(module) {
        eprintln!("skipped: {obstacle}");
        return false;
    }
    let program = std::env::current_exe().expect("a test program");
    let setup = "ip link add ecA0 type veth peer name ecA1 && ip link set ecA0 up && ip link set ecA1 up && exec \"$0\" \"$@\"";
    let status = Command::new("unshare")
        .args(["-n", "sh", "-c", setup])
        .arg(program)
        .args(["--exact", name, "--nocapture"])
        .env(INSIDE, "1")
        .status()
        .expect("unshare");
    assert!(status.success(), "{name} failed inside its namespace");
    false
}

/// Runs a script of `tests/oracles` against drives for a robot.
fn run_script(script: &str, robot: &str, axes: usize) {
    let robot = robot::load(robot).expect("a shipped robot");
    let parameters = PlantParameters::for_robot(&robot).expect("its plant");
    let mut options = Options::for_joints(robot.joints.len());
    options.axes_per_slave = axes;
    let mut drives = segment(&robot, &parameters, &[], &options, now_ns()).expect("drives");
    let socket = RawSocket::open("ecA1").expect("the other end");
    let stop = Arc::new(AtomicBool::new(false));
    let server = std::thread::spawn({
        let stop = Arc::clone(&stop);
        move || serve(&socket, &mut drives, &stop)
    });
    let path = format!("{}/tests/oracles/{script}", env!("CARGO_MANIFEST_DIR"));
    let seconds = std::env::var("FLEXSPLINE_ORACLE_SECONDS").unwrap_or_else(|_| "2".to_owned());
    let status = Command::new(python())
        .args([&path, "ecA0", &seconds])
        .status()
        .expect("python");
    stop.store(true, Ordering::Relaxed);
    server.join().expect("the drives end");
    assert!(status.success(), "{script} found fault");
}

#[test]
fn soem_moves_one_axis() {
    if is_inside("soem_moves_one_axis", "pysoem") {
        run_script("soem.py", "shd17", 1);
    }
}

#[test]
fn soem_moves_seven_axes_on_three_slaves() {
    if is_inside("soem_moves_seven_axes_on_three_slaves", "pysoem") {
        run_script("soem.py", "pa10", 3);
    }
}

#[test]
fn kickcat_moves_one_axis() {
    if is_inside("kickcat_moves_one_axis", "kickcat") {
        run_script("kickcat_master.py", "shd17", 1);
    }
}

#[test]
fn kickcat_moves_seven_axes_on_three_slaves() {
    if is_inside("kickcat_moves_seven_axes_on_three_slaves", "kickcat") {
        run_script("kickcat_master.py", "pa10", 3);
    }
}
