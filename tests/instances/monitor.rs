//! `flexspline monitor` beside a running instance.

use crate::support::{Bench, eventually, kill, output, spawn, text};
use serde_json::Value;

fn once(bench: &Bench, arguments: &[&str]) -> std::process::Output {
    let mut monitor = bench.flexspline();
    monitor
        .args(["monitor", "--once", "--instance", &bench.instance])
        .args(arguments);
    output(monitor)
}

#[test]
fn a_snapshot_shows_loop_joints_and_processes() {
    let bench = Bench::new("monitor");
    let run = spawn(bench.run(&["--duration", "60s"]));
    bench.await_process("loop");
    let shown = eventually(|| {
        let output = once(&bench, &["--json", "-", "--listen", "300ms"]);
        let snapshot: Value = serde_json::from_slice(&output.stdout).ok()?;
        (snapshot["state"] == "Running").then_some(snapshot)
    });
    let snapshot = shown.expect("the loop runs");
    assert!(
        snapshot["rate_hz"]
            .as_f64()
            .is_some_and(|rate_hz| rate_hz > 0.0),
        "{snapshot}"
    );
    let heard = snapshot["times"]["late_at_wakeup"]["count"].as_u64();
    assert!(heard.is_some_and(|heard| heard > 0), "{snapshot}");
    let joints = snapshot["joints"].as_array().expect("a list");
    assert_eq!(joints.len(), 7);
    for joint in joints {
        assert!(joint["link_position_rad"].is_number(), "{joint}");
        assert!(
            joint["estimates"]["residual_torque_nm"].is_number(),
            "{joint}"
        );
    }
    let relay = bench.await_process("relay");
    let processes = snapshot["processes"].as_array().expect("a list");
    assert_eq!(processes.len(), 5, "{snapshot}");
    assert!(
        processes
            .iter()
            .any(|process| process["role"] == "relay" && process["process_id"] == relay),
        "{snapshot}"
    );

    kill(relay, libc::SIGKILL);
    let restarted = eventually(|| {
        let output = once(&bench, &["--json", "-", "--listen", "100ms"]);
        let snapshot: Value = serde_json::from_slice(&output.stdout).ok()?;
        let processes = snapshot["processes"].as_array()?.clone();
        processes
            .into_iter()
            .find(|process| process["role"] == "relay" && process["restarts"] == 1)
    });
    assert_eq!(
        restarted.expect("the supervisor says so")["last_end"],
        "signal 9"
    );

    let picture = once(&bench, &["--listen", "300ms"]);
    let shown = String::from_utf8_lossy(&picture.stdout).into_owned();
    assert!(
        shown.contains("late at wake-up") && shown.contains("joint7"),
        "{shown}"
    );
    kill(run.id(), libc::SIGINT);
    let output = run.wait_with_output().expect("the run ends");
    assert!(output.status.success(), "{}", text(&output));
}

#[test]
fn without_an_instance_or_a_terminal_it_says_what_to_do() {
    let bench = Bench::new("nomon");
    let nothing_runs = once(&bench, &[]);
    assert_eq!(
        nothing_runs.status.code(),
        Some(2),
        "{}",
        text(&nothing_runs)
    );
    let message = String::from_utf8_lossy(&nothing_runs.stderr).into_owned();
    assert!(
        message.contains(&bench.instance) && message.contains("flexspline run"),
        "{message}"
    );
    let mut monitor = bench.flexspline();
    monitor.args(["monitor", "--instance", &bench.instance]);
    let no_terminal = output(monitor);
    assert_eq!(no_terminal.status.code(), Some(2), "{}", text(&no_terminal));
    let message = String::from_utf8_lossy(&no_terminal.stderr).into_owned();
    assert!(message.contains("--once"), "{message}");
}
