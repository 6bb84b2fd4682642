//! The program that comes of the package: Flexspline with one more driver.

use std::path::Path;
use std::process::{Command, Output};

use tempfile::TempDir;

fn output(command: &mut Command) -> Output {
    command.output().expect("the program starts")
}

fn text(output: &Output) -> String {
    format!(
        "{}\n{}{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}

#[test]
fn it_runs_with_its_driver() {
    let directory = TempDir::new().expect("a temporary directory");
    let file = |name: &str| directory.path().join(name).display().to_string();
    let instance = format!("own-{}", std::process::id());
    let call = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_own-driver"));
        output(command.args(arguments).current_dir(directory.path()))
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
            &instance,
            "--record",
            &file("run.mcap"),
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
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/shd17.toml");
    let shipped = std::fs::read_to_string(shipped).expect("shipped");
    let slow = format!("{shipped}\n[drive]\nwatchdog_ms = 500\n");
    std::fs::write(file("slow.toml"), slow).expect("written");
    let refused = run(&file("slow.toml"));
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
}

#[test]
fn it_resolves_wherever_it_lies() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = package.join("../..");
    let elsewhere = TempDir::new().expect("a temporary directory");
    let manifest = std::fs::read_to_string(package.join("Cargo.toml")).expect("read");
    let manifest = manifest.replace("../..", &root.display().to_string());
    std::fs::write(elsewhere.path().join("Cargo.toml"), manifest).expect("written");
    // The dependencies that are there already will do.
    let lock = elsewhere.path().join("Cargo.lock");
    std::fs::copy(root.join("Cargo.lock"), lock).expect("copied");
    std::fs::create_dir(elsewhere.path().join("src")).expect("made");
    let program = elsewhere.path().join("src/main.rs");
    std::fs::copy(package.join("src/main.rs"), program).expect("copied");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["tree", "--offline", "--depth", "1"]);
    let tree = output(cargo.current_dir(elsewhere.path()));
    assert!(tree.status.success(), "{}", text(&tree));
    assert!(text(&tree).contains("flexspline v"), "{}", text(&tree));
}
