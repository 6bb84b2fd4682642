//! Third-party processes read the sample topic of a running instance; nobody else becomes its writer.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::{Bench, eventually, kill, output, python, spawn, text};
use shm_types::bus::Bus;
use shm_types::instance::Instance;
use shm_types::topics;

/// The example's executable: `cargo test` builds examples too, `cargo test --test instances` does not.
fn example(name: &str) -> PathBuf {
    let program = Path::new(env!("CARGO_BIN_EXE_flexspline"));
    program
        .parent()
        .expect("a directory")
        .join("examples")
        .join(name)
}

#[test]
fn the_examples_read_samples_of_a_running_instance() {
    let bench = Bench::new("observe");
    let run = spawn(bench.run(&["--duration", "30s"]));
    bench.await_process("loop");
    let mut rust = Command::new(example("observe"));
    rust.arg(&bench.instance);
    let mut observers = vec![rust];
    if let Some(mut python) = python() {
        python
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/observe.py"))
            .arg(&bench.instance);
        observers.push(python);
    }
    for observer in observers {
        let output = output(observer);
        assert!(output.status.success(), "{}", text(&output));
        let lines = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(
            lines
                .lines()
                .filter(|line| line.starts_with("cycle "))
                .count(),
            10,
            "{lines}"
        );
    }
    kill(run.id(), libc::SIGINT);
    let output = run.wait_with_output().expect("the run ends");
    assert!(output.status.success(), "{}", text(&output));
}

#[test]
fn a_second_writer_cannot_join() {
    let bench = Bench::new("writer");
    let run = spawn(bench.run(&["--duration", "30s"]));
    bench.await_process("loop");
    let instance =
        Instance::new(&bench.instance, realtime::process::user_id()).expect("a good name");
    let bus = Bus::join(&instance).expect("the instance is ours");
    let status = bus
        .reader(&topics::OBSERVED_STATUS)
        .expect("open to observers");
    assert!(eventually(|| status.take()).is_some(), "the loop runs");
    assert!(
        bus.writer(&topics::COMMAND).is_err(),
        "the feedforward controller writes commands"
    );
    assert!(
        bus.writer(&topics::DRIVE_COMMAND).is_err(),
        "the loop commands the drives"
    );
    assert!(
        bus.reader(&topics::LOOP_STATUS).is_err(),
        "observers read from the relay, not from the loop"
    );
    drop((status, bus));
    kill(run.id(), libc::SIGINT);
    let output = run.wait_with_output().expect("the run ends");
    assert!(output.status.success(), "{}", text(&output));
}
