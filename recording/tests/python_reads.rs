//! Python's MCAP and protobuf libraries decode our files: the schemas in them tell the truth.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::{JOINT_NAMES, joints, loop_cycle, time_ns, truth, write_recording};
use recording::Signal;
use std::collections::BTreeMap;
use std::process::Command;

const CYCLES: u64 = 1700;

/// An interpreter that has the libraries: the one named in `FLEXSPLINE_PYTHON`, or `python3`.
fn python() -> Option<String> {
    let python = std::env::var("FLEXSPLINE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let imports = Command::new(&python)
        .args(["-c", "import mcap, mcap_protobuf"])
        .output();
    if imports.is_ok_and(|imports| imports.status.success()) {
        return Some(python);
    }
    eprintln!(
        "skipped: {python} cannot import mcap and mcap_protobuf; name one that can in FLEXSPLINE_PYTHON"
    );
    None
}

fn read_with(python: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    write_recording(&path, CYCLES);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/read_with_mcap.py");
    let output = Command::new(python)
        .arg(script)
        .arg(&path)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

/// By topic, cycle and field.
type Values<'a> = BTreeMap<(&'a str, u64, &'a str), f64>;

fn values(printed: &str) -> Values<'_> {
    let messages = printed.lines().filter(|line| !line.starts_with("metadata"));
    messages
        .map(|line| {
            let [topic, sequence, log_time, publish_time, field, value] =
                line.split('\t').collect::<Vec<_>>().try_into().unwrap();
            let cycle = sequence.parse().unwrap();
            assert_eq!(log_time, time_ns(cycle).to_string());
            assert_eq!(publish_time, log_time);
            ((topic, cycle, field), value.parse().unwrap())
        })
        .collect()
}

#[test]
fn python_decodes_every_value() {
    let Some(python) = python() else { return };
    let printed = read_with(&python);
    assert!(printed.contains("metadata\tsample_rate_hz\t1500\n"));
    assert!(printed.contains("metadata\tnote\tπ, \"quoted\"\n"));
    let values = values(&printed);
    let get = |topic: &str, cycle, field| values.get(&(topic, cycle, field)).copied();
    for cycle in 0..CYCLES {
        for (name, joint) in JOINT_NAMES.into_iter().zip(joints(cycle)) {
            let topic = format!("/{name}");
            for signal in Signal::ALL {
                assert_eq!(
                    get(&topic, cycle, signal.name()),
                    joint.get(signal),
                    "cycle {cycle}, {topic} {signal}"
                );
            }
            assert_eq!(
                get(&topic, cycle, "estimate_residual_torque_nm"),
                joint.estimate_residual_torque_nm
            );
            assert_eq!(
                get(&topic, cycle, "segment"),
                joint.segment.map(|segment| segment as f64)
            );
        }
        for (name, truth) in JOINT_NAMES.into_iter().zip(truth(cycle)) {
            let topic = format!("/truth/{name}");
            assert_eq!(
                get(&topic, cycle, "link_position_rad"),
                Some(truth.link_position_rad)
            );
            assert_eq!(
                get(&topic, cycle, "joint_torque_nm"),
                Some(truth.joint_torque_nm)
            );
            assert_eq!(
                get(&topic, cycle, "friction_torque_nm"),
                Some(truth.friction_torque_nm)
            );
        }
        let loop_cycle = loop_cycle(cycle);
        assert_eq!(get("/loop", cycle, "cycle"), Some(cycle as f64));
        assert_eq!(
            get("/loop", cycle, "wakeup_lateness_ns"),
            Some(loop_cycle.wakeup_lateness_ns as f64)
        );
        assert_eq!(
            get("/loop", cycle, "limited"),
            Some(f64::from(loop_cycle.limited))
        );
        assert_eq!(get("/loop", cycle, "stale_commands"), Some(0.0));
    }
}
