//! What is written is what is read, in every format.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::{JOINT_NAMES, RATE_HZ, joints, loop_cycle, time_ns, truth, write_recording};
use proptest::prelude::*;
use recording::{JointColumns, Recording, Signal, read, read_cycles, write_csv, write_mcap};

#[test]
fn mcap_gives_back_every_sample() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    write_recording(&path, 4000);
    let recording = read(&path).unwrap();
    assert!(!recording.truncated);
    assert_eq!(recording.rows(), 4000);
    assert_eq!(recording.sample_rate_hz, RATE_HZ as f64);
    assert_eq!(recording.joint_names().collect::<Vec<_>>(), JOINT_NAMES);
    assert_eq!(recording.metadata["note"], "π, \"quoted\"");
    assert_eq!(recording.metadata["joints"], "shoulder,elbow.1");
    assert_eq!(
        recording.segments(),
        [0..1000, 1000..2000, 2000..3000, 3000..4000]
    );
    for cycle in 0..4000 {
        let row = cycle as usize;
        assert_eq!(recording.time_s[row], time_ns(cycle) as f64 / 1e9);
        for (name, joint) in JOINT_NAMES.into_iter().zip(joints(cycle)) {
            for signal in Signal::ALL {
                let read = recording
                    .signal(name, signal)
                    .ok()
                    .map(|values| values[row])
                    .filter(|value| !value.is_nan());
                assert_eq!(read, joint.get(signal), "cycle {cycle}, {name}.{signal}");
            }
        }
    }
}

#[test]
fn a_signal_never_recorded_is_named_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    write_recording(&path, 10);
    let recording = read(&path).unwrap();
    let missing = recording
        .signal("elbow.1", Signal::TemperatureC)
        .unwrap_err()
        .to_string();
    assert_eq!(
        missing,
        "the recording has no temperature_c of joint `elbow.1`; it has `motor_position_rad`"
    );
}

#[test]
fn rows_hold_what_the_table_leaves_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    write_recording(&path, 2000);
    let mut cycle = 0;
    let contents = read_cycles(&path, |row| {
        assert_eq!((row.cycle, row.time_ns), (cycle, time_ns(cycle)));
        assert_eq!(row.loop_cycle, Some(&loop_cycle(cycle)));
        assert_eq!(row.joints, joints(cycle));
        assert_eq!(row.truth, Some(&truth(cycle)[..]));
        cycle += 1;
    });
    assert_eq!(cycle, 2000);
    assert_eq!(contents.unwrap().joint_names, JOINT_NAMES);
}

#[test]
fn equal_input_makes_equal_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a.mcap", "b.mcap"].map(|name| {
        write_recording(&folder.path().join(name), 4000);
        std::fs::read(folder.path().join(name)).unwrap()
    });
    assert!(a == b);
}

#[test]
fn mcap_to_csv_and_back_is_the_same_table() {
    let folder = tempfile::tempdir().unwrap();
    let (mcap, csv) = (
        folder.path().join("run.mcap"),
        folder.path().join("run.csv"),
    );
    write_recording(&mcap, 2500);
    let recording = read(&mcap).unwrap();
    write_csv(&recording, &csv).unwrap();
    let mut again = read(&csv).unwrap();
    // CSV does not tell the planned rate; the times show it.
    assert!(
        (again.sample_rate_hz - recording.sample_rate_hz).abs() < 1e-3,
        "{}",
        again.sample_rate_hz
    );
    again.sample_rate_hz = recording.sample_rate_hz;
    assert!(recording.same_table(&again));
}

#[test]
fn a_table_whose_columns_differ_in_length_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let signals = [(Signal::MotorTorqueNm, vec![1.0])].into();
    let joints = vec![JointColumns {
        name: "elbow".to_owned(),
        signals,
    }];
    let recording = Recording {
        time_s: vec![0.0, 1.0],
        segment: None,
        joints,
        sample_rate_hz: 1.0,
        metadata: Default::default(),
        truncated: false,
    };
    let error = write_csv(&recording, &folder.path().join("r.csv"))
        .unwrap_err()
        .to_string();
    assert_eq!(
        error,
        "column elbow.motor_torque_nm holds 1 values where the table has 2 rows"
    );
    assert!(write_mcap(&recording, &folder.path().join("r.mcap")).is_err());
}

fn values(rows: usize) -> impl Strategy<Value = Vec<f64>> {
    let value = prop_oneof![3 => proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL | proptest::num::f64::ZERO, 1 => Just(f64::NAN)];
    prop::collection::vec(value, rows).prop_filter("a signal has a value", |values| {
        !values.iter().all(|v| v.is_nan())
    })
}

prop_compose! {
    fn joint(name: &'static str, rows: usize)(
        signals in prop::collection::btree_map(prop::sample::select(&Signal::ALL[..]), values(rows), 1..12)
    ) -> JointColumns {
        JointColumns { name: name.to_owned(), signals }
    }
}

fn table() -> impl Strategy<Value = Recording> {
    (2..20_usize).prop_flat_map(|rows| {
        let joints = (joint("a", rows), joint("b c;\"d", rows), joint("β.γ", rows))
            .prop_map(|(a, b, c)| vec![a, b, c]);
        let segment = prop::option::of(prop::collection::vec(-3..3_i64, rows));
        (joints, segment).prop_map(move |(joints, segment)| Recording {
            time_s: (0..rows).map(|row| row as f64 / 250.0).collect(),
            segment,
            joints,
            sample_rate_hz: 250.0,
            metadata: Default::default(),
            truncated: false,
        })
    })
}

proptest! {
    #[test]
    fn any_table_survives_both_formats(recording in table()) {
        let folder = tempfile::tempdir().unwrap();
        let (mcap, csv) = (folder.path().join("r.mcap"), folder.path().join("r.csv"));
        write_mcap(&recording, &mcap).unwrap();
        let from_mcap = read(&mcap).unwrap();
        prop_assert!(recording.same_table(&from_mcap));
        write_csv(&from_mcap, &csv).unwrap();
        std::fs::write(folder.path().join("r.toml"), "sample_rate_hz = 250.0").unwrap();
        prop_assert!(recording.same_table(&read(&csv).unwrap()));
    }
}
