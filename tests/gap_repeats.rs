//! Repeats of one input: those that are alike and one that is not, on emulated joints and on a real arm's logs.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use support::{Bench, output, text};

/// The single joint, always the same one: other seeds make other noise and no other arm.
fn bench(name: &str, parameter_deviation: &str) -> Bench {
    let bench = Bench::new(name);
    fs::copy("robots/shd17.toml", bench.file("arm.toml")).unwrap();
    let plant = fs::read_to_string("robots/shd17.plant.toml").unwrap();
    let given = "parameter_deviation = 0.02";
    assert!(plant.contains(given));
    let deviation = format!("parameter_deviation = {parameter_deviation}");
    fs::write(
        bench.file("arm.plant.toml"),
        plant.replace(given, &deviation),
    )
    .unwrap();
    bench
}

/// Leaves `NAME.mcap`.
fn record(bench: &Bench, name: &str, seed: u32, more: &[&str]) {
    let seed = seed.to_string();
    let mut run = bench.run(&["--mode", "lockstep", "--robot", "arm.toml", "--seed", &seed]);
    run.args(["--trajectory", "multi_sine", "--duration", "6s"]);
    run.args(["--estimators", "residual"]).args(more);
    let ran = output(run);
    assert!(ran.status.success(), "{}", text(&ran));
    fs::rename(bench.file("run.mcap"), bench.file(name)).unwrap();
}

fn gap(bench: &Bench, arguments: &[&str], recordings: &[String]) -> Value {
    let mut command = bench.flexspline();
    command
        .arg("gap")
        .args(arguments)
        .arg("--recording")
        .args(recordings);
    command.args(["--json", "told.json"]);
    let told = output(command);
    assert!(told.status.success(), "{}", text(&told));
    serde_json::from_slice(&fs::read(bench.file("told.json")).unwrap()).unwrap()
}

fn differing(group: &Value) -> Vec<&str> {
    let repeats = group["repeats"].as_array().unwrap().iter();
    let differ = repeats.filter(|repeat| repeat["differs"] == true);
    differ
        .map(|repeat| repeat["recording"].as_str().unwrap())
        .collect()
}

#[test]
fn a_repeat_with_more_friction_is_found_and_the_others_are_alike() {
    let bench = bench("repeats", "0.0");
    let more = "[[effect]]\njoint = \"joint1\"\neffect = \"coulomb_friction\"\ncoulomb_nm = 0.3\n";
    fs::write(bench.file("gap.toml"), more).unwrap();
    let mut names: Vec<String> = (1..=5).map(|seed| format!("{seed}.mcap")).collect();
    for (name, seed) in names.iter().zip(1..) {
        record(&bench, name, seed, &[]);
    }
    let told = gap(&bench, &["repeats"], &names);
    assert_eq!(told["groups"].as_array().unwrap().len(), 1);
    let group = &told["groups"][0];
    assert_eq!(group["input"][0], "reference_position_rad");
    assert_eq!(group["repeats"].as_array().unwrap().len(), 5);
    assert_eq!(differing(group), [""; 0], "{group}");
    record(&bench, "more.mcap", 6, &["--inject", "gap.toml"]);
    names.insert(2, "more.mcap".to_owned());
    let told = gap(&bench, &["repeats"], &names);
    let group = &told["groups"][0];
    assert_eq!(differing(group), ["more.mcap"], "{group}");
    // the diagnosis is told so, and its floor is not raised by what differs
    let report = gap(&bench, &["diagnose", "--robot", "arm.toml"], &names);
    let data = report["data"].as_array().unwrap();
    let says = |part: &str| {
        data.iter()
            .any(|found| found["what"].as_str().unwrap().contains(part))
    };
    assert!(
        says("more.mcap from 0.00 s on is not as the other repeats"),
        "{data:?}"
    );
    assert!(says("5 repeats of one input scatter by"), "{data:?}");
}

#[test]
fn the_noise_floor_is_the_repeats_where_they_scatter_more_than_the_file_says() {
    // every seed is another arm here: what they differ by is no model's error
    let bench = bench("floor", "0.1");
    let names: Vec<String> = (1..=4).map(|seed| format!("{seed}.mcap")).collect();
    for (name, seed) in names.iter().zip(1..) {
        record(&bench, name, seed, &[]);
    }
    let floor = |names: &[String]| {
        let report = gap(&bench, &["diagnose", "--robot", "arm.toml"], names);
        let floor_nm = &report["joints"][0]["gap"]["torque_rms_nm"]["noise_floor"];
        (floor_nm.as_f64().unwrap(), report)
    };
    let (alone_nm, alone) = floor(&names[..1]);
    assert!(
        !alone.to_string().contains("repeats of one input"),
        "{alone}"
    );
    let (two_nm, two) = floor(&names[..2]);
    assert!(!two.to_string().contains("repeats of one input"), "{two}");
    let (all_nm, all) = floor(&names);
    assert!(
        all.to_string()
            .contains("noise floor of the torque is the repeats' scatter"),
        "{all}"
    );
    assert!(
        all_nm > 2.0 * two_nm.max(alone_nm),
        "{all_nm} {two_nm} {alone_nm}"
    );
}

#[test]
fn what_is_no_repeat_is_refused_in_one_line() {
    let bench = bench("lonely", "0.0");
    record(&bench, "1.mcap", 1, &[]);
    let mut command = bench.flexspline();
    command.args(["gap", "repeats", "--recording", "1.mcap", "1.mcap"]);
    let told = output(command);
    assert_eq!(told.status.code(), Some(2), "{}", text(&told));
    let message = String::from_utf8_lossy(&told.stderr).into_owned();
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    assert!(
        message.contains("no more than 2") && message.contains("3 are needed"),
        "{message}"
    );
}

/// The folder of real robots' logs; without one the reason is printed and the test has nothing to do.
fn schunk() -> Option<PathBuf> {
    let folder = std::env::var_os("FLEXSPLINE_REALDATA").map(PathBuf::from);
    let found = folder
        .map(|folder| folder.join("schunk_lwa4p/Robot"))
        .filter(|f| f.is_dir());
    if found.is_none() {
        println!("skipped: FLEXSPLINE_REALDATA names no folder with schunk_lwa4p");
    }
    found
}

/// What `benches/real/schunk_lwa4p.py` writes of a trial.
fn trial(folder: &Path, number: usize) -> String {
    let cells = |name: &str| {
        fs::read_to_string(folder.join(format!("measurement_{number}/{name}.csv"))).unwrap()
    };
    let signals = [
        "link_position_rad",
        "link_velocity_rad_s",
        "command_torque_nm",
    ];
    let columns = signals
        .iter()
        .flat_map(|signal| (1..7).map(move |joint| format!(",joint{joint}.{signal}")));
    let mut log = format!("time_s{}\n", columns.collect::<String>());
    let (time, state, torque) = (cells("time"), cells("trajectory"), cells("input"));
    let torque = torque.lines().chain(std::iter::repeat(",,,,,"));
    for ((time, state), torque) in time.lines().zip(state.lines()).zip(torque) {
        log += &format!("{time},{state},{torque}\n");
    }
    log
}

#[test]
fn repeats_of_a_real_arm_have_no_gap_against_each_other_and_drift() {
    let Some(folder) = schunk() else { return };
    let bench = Bench::new("schunk");
    let names: Vec<String> = (1..=100).map(|number| format!("{number:03}.csv")).collect();
    for (name, number) in names.iter().zip(1..) {
        fs::write(bench.file(name), trial(&folder, number)).unwrap();
    }
    let told = gap(&bench, &["repeats"], &names);
    let groups = told["groups"].as_array().unwrap();
    let sizes: Vec<usize> = groups
        .iter()
        .map(|g| g["repeats"].as_array().unwrap().len())
        .collect();
    assert_eq!(sizes, [20, 20, 20, 19, 14, 7]);
    assert_eq!(told["alone"], serde_json::json!([]));
    for group in groups {
        assert_eq!(differing(group), [""; 0], "{group}");
        assert_eq!(group["input"][0], "command_torque_nm");
        // joint 3 goes farther from trial to trial
        assert_eq!(group["joints"][2]["order"]["drifts"], true, "{group}");
    }
    // a trial with its third encoder 0.4 rad off is found among the others of its input
    let mut lines: Vec<String> = trial(&folder, 30).lines().map(str::to_owned).collect();
    for line in lines.iter_mut().skip(1) {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[3] = (cells[3].parse::<f64>().unwrap() + 0.4).to_string();
        *line = cells.join(",");
    }
    fs::write(bench.file(&names[29]), lines.join("\n")).unwrap();
    let told = gap(&bench, &["repeats"], &names[20..40]);
    assert_eq!(differing(&told["groups"][0]), ["030.csv"], "{told}");
}
