//! A run to record: made up, but with every kind of value that may be there or not.
#![allow(dead_code, reason = "each test file uses its part")]
#![allow(clippy::unwrap_used, reason = "a test may")]

use recording::{CycleRow, Header, JointCycle, JointTruth, LoopCycle, Writer};
use std::path::Path;

pub const RATE_HZ: u64 = 1500;
pub const JOINT_NAMES: [&str; 2] = ["shoulder", "elbow.1"];

pub fn header() -> Header {
    let metadata = [
        ("robot", "bench"),
        ("mode", "lockstep"),
        ("seed", "7"),
        ("note", "π, \"quoted\""),
    ];
    Header {
        joint_names: JOINT_NAMES.map(str::to_owned).to_vec(),
        sample_rate_hz: RATE_HZ as f64,
        metadata: metadata
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .into(),
    }
}

pub fn time_ns(cycle: u64) -> u64 {
    1_000_000_000 + cycle * 1_000_000_000 / RATE_HZ
}

/// The second joint misses a sample in every third cycle; neither has a temperature.
pub fn joints(cycle: u64) -> [JointCycle; 2] {
    let angle = cycle as f64 * 0.01;
    let full = JointCycle {
        reference_position_rad: Some(angle.sin()),
        command_torque_nm: Some(-0.25),
        motor_position_rad: Some(100.0 * angle.sin()),
        motor_current_a: Some(0.0),
        joint_torque_nm: Some(1e-300 * angle),
        estimate_residual_torque_nm: Some(2.0 * angle),
        segment: Some(cycle as i64 / 1000 - 1),
        ..Default::default()
    };
    let sparse = JointCycle {
        motor_position_rad: Some(angle).filter(|_| !cycle.is_multiple_of(3)),
        ..Default::default()
    };
    [full, sparse]
}

pub fn truth(cycle: u64) -> [JointTruth; 2] {
    let truth = JointTruth {
        link_position_rad: cycle as f64,
        friction_torque_nm: -0.5,
        ..Default::default()
    };
    [
        truth,
        JointTruth {
            joint_torque_nm: 0.125,
            ..truth
        },
    ]
}

pub fn loop_cycle(cycle: u64) -> LoopCycle {
    LoopCycle {
        cycle,
        state: 3,
        wakeup_lateness_ns: -12,
        compute_ns: 40_000,
        limited: 2,
        ..Default::default()
    }
}

pub fn write_cycles(writer: &mut Writer, cycles: std::ops::Range<u64>) {
    for cycle in cycles {
        let (loop_cycle, joints, truth) = (loop_cycle(cycle), joints(cycle), truth(cycle));
        let row = CycleRow {
            cycle,
            time_ns: time_ns(cycle),
            loop_cycle: Some(&loop_cycle),
            joints: &joints,
            truth: Some(&truth),
        };
        writer.write_cycle(&row).unwrap();
    }
}

pub fn write_recording(path: &Path, cycles: u64) {
    let mut writer = Writer::create(path, &header()).unwrap();
    write_cycles(&mut writer, 0..cycles);
    writer.finish().unwrap();
}
