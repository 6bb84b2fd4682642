//! Processes killed, stopped and interrupted in a real-time run: the loop goes on, services come back, nothing stays. And the
//! fault suite in its short form: every fault ends as documented.

mod support;

use std::time::Duration;

use support::{Bench, eventually, kill, output, spawn, text};

const NOTHING: Vec<String> = Vec::new();

#[test]
fn a_killed_service_comes_back_under_a_running_loop() {
    for (role, name) in [
        ("feedforward", "kill-ff"),
        ("estimator", "kill-est"),
        ("relay", "kill-rel"),
    ] {
        let bench = Bench::new(name);
        let run = spawn(bench.run(&["--duration", "4s"]));
        bench.await_process("loop");
        std::thread::sleep(Duration::from_secs(1));
        let killed = bench.await_process(role);
        kill(killed, libc::SIGKILL);
        let successor = eventually(|| bench.process(role).filter(|&process| process != killed));
        assert!(successor.is_some(), "{role} is started again");
        let output = run.wait_with_output().expect("the run ends");
        assert!(output.status.success(), "{role}: {}", text(&output));
        let report = bench.report();
        assert_eq!(report["restarts"][0]["role"], role, "{}", text(&output));
        assert!(
            report["restarts"][0]["back_after_ms"].is_number(),
            "{report}"
        );
        // without the service it would be damping by then; a machine that steals milliseconds may make it hold at any moment
        let state = report["timing"]["final_state"].as_str();
        assert!(
            matches!(state, Some("Running" | "Holding")),
            "{role}: {}",
            text(&output)
        );
        if role == "feedforward" {
            let gap = report["timing"]["counters"]["longest_command_gap_cycles"]
                .as_u64()
                .expect("a count");
            assert!(gap > 0, "the command gap is measured");
        }
        assert_eq!(bench.left_behind(), NOTHING, "{role}");
    }
}

#[test]
fn a_killed_relay_leaves_a_recording_that_reads_and_its_successor_goes_on() {
    let bench = Bench::new("parts");
    let run = spawn(bench.run(&["--duration", "4s"]));
    bench.await_process("loop");
    std::thread::sleep(Duration::from_secs(2));
    kill(bench.await_process("relay"), libc::SIGKILL);
    let output = run.wait_with_output().expect("the run ends");
    assert!(output.status.success(), "{}", text(&output));
    let first = recording::read(&bench.file("run.mcap")).expect("the first part reads");
    assert!(first.truncated && first.rows() > 0, "{} rows", first.rows());
    let second = recording::read(&bench.file("run.part2.mcap")).expect("the second part reads");
    assert!(!second.truncated);
    assert!(
        second.time_s[0] > first.time_s[first.rows() - 1],
        "the second goes on where the first ended"
    );
}

#[test]
fn ctrl_c_stops_cleanly() {
    let bench = Bench::new("ctrlc");
    let run = spawn(bench.run(&["--duration", "60s"]));
    bench.await_process("loop");
    std::thread::sleep(Duration::from_millis(500));
    kill(run.id(), libc::SIGINT);
    let output = run.wait_with_output().expect("the run ends");
    assert!(output.status.success(), "{}", text(&output));
    assert_eq!(bench.report()["interrupted"], true);
    let recording = recording::read(&bench.file("run.mcap")).expect("the recording was closed");
    assert!(!recording.truncated);
    assert_eq!(bench.left_behind(), NOTHING);
}

#[test]
fn nothing_outlives_a_killed_supervisor() {
    let bench = Bench::new("orphan");
    let mut run = spawn(bench.run(&["--duration", "60s"]));
    bench.await_process("loop");
    std::thread::sleep(Duration::from_millis(500));
    // One of them cannot even be asked to stop.
    kill(bench.await_process("estimator"), libc::SIGSTOP);
    kill(run.id(), libc::SIGKILL);
    run.wait().expect("killed");
    let clean = eventually(|| bench.left_behind().is_empty().then_some(()));
    assert!(clean.is_some(), "{:?}", bench.left_behind());
}

#[test]
fn a_service_that_hangs_is_replaced() {
    let bench = Bench::new("hang");
    let run = spawn(bench.run(&["--duration", "6s"]));
    bench.await_process("loop");
    std::thread::sleep(Duration::from_millis(500));
    let hanging = bench.await_process("estimator");
    kill(hanging, libc::SIGSTOP);
    let successor = eventually(|| {
        bench
            .process("estimator")
            .filter(|&process| process != hanging)
    });
    assert!(successor.is_some(), "the estimator is replaced");
    let output = run.wait_with_output().expect("the run ends");
    assert!(output.status.success(), "{}", text(&output));
    assert_eq!(bench.left_behind(), NOTHING);
}

#[test]
fn a_dead_plant_ends_the_run_with_exit_code_one() {
    let bench = Bench::new("plant");
    let run = spawn(bench.run(&["--duration", "60s"]));
    bench.await_process("loop");
    std::thread::sleep(Duration::from_millis(500));
    kill(bench.await_process("emulator"), libc::SIGKILL);
    let output = run.wait_with_output().expect("the run ends");
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    assert!(
        String::from_utf8_lossy(&output.stderr).contains("emulator"),
        "{}",
        text(&output)
    );
    assert_eq!(bench.left_behind(), NOTHING);
}

#[test]
fn two_instances_run_side_by_side_and_one_name_is_taken_once() {
    let (first, second) = (Bench::new("left"), Bench::new("right"));
    let running = [&first, &second].map(|bench| spawn(bench.run(&["--duration", "4s"])));
    first.await_process("loop");
    let intruder = output(first.run(&["--duration", "1s"]));
    assert_eq!(intruder.status.code(), Some(2), "{}", text(&intruder));
    let message = String::from_utf8_lossy(&intruder.stderr).into_owned();
    assert!(
        message.contains("in use") && message.contains("--instance"),
        "{message}"
    );
    for (run, bench) in running.into_iter().zip([&first, &second]) {
        let output = run.wait_with_output().expect("the run ends");
        assert!(output.status.success(), "{}", text(&output));
        let report = bench.report();
        // Two loops on one core now and then starve a service, also just as the run ends; they recover from that.
        assert_ne!(report["timing"]["final_state"], "SafeStop", "{report}");
        assert_eq!(bench.left_behind(), NOTHING);
    }
}

#[test]
fn every_fault_of_the_short_suite_ends_as_documented() {
    let bench = Bench::new("suite");
    let mut command = bench.flexspline();
    command.args(["faults", "--short", "--json"]);
    command.arg(bench.file("faults.json"));
    let output = output(command);
    assert!(output.status.success(), "{}", text(&output));
    let written = std::fs::read(bench.file("faults.json")).expect("the suite wrote its results");
    let report: serde_json::Value = serde_json::from_slice(&written).expect("JSON");
    for part in ["virtual_time", "processes"] {
        assert!(
            report[part]
                .as_array()
                .is_some_and(|faults| !faults.is_empty()),
            "{part}"
        );
    }
    let pulled = report["virtual_time"].as_array().expect("kinds of drives");
    let buses = pulled.iter().filter(|on| on["pulls"]["pulls"] == 20);
    assert_eq!(buses.count(), 2, "{}", text(&output));
    assert_eq!(report["kills"]["kills"], 5, "{}", text(&output));
}
