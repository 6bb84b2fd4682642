//! Three joints of a bench, everything measured, and their robot file.

use std::collections::BTreeMap;

use recording::{
    CheckJoint, CheckRobot, Finding, JointColumns, Recording, Severity, Signal, check,
};

pub(crate) const RATE_HZ: f64 = 500.0;
pub(crate) const ROWS: usize = 10_000;
pub(crate) const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// Gear ratio, phase, and how the joint swings.
pub(crate) const JOINTS: [(&str, f64, f64); 3] =
    [("a", 50.0, 0.0), ("b", 100.0, 1.0), ("c", 101.0, 2.5)];
pub(crate) const MOTOR_STEP_RAD: f64 = 1.534e-3;
pub(crate) const LINK_STEP_RAD: f64 = 1.198e-5;
pub(crate) const TORQUE_CONSTANT_NM_A: f64 = 0.25;

pub(crate) fn noise(row: usize, salt: usize) -> f64 {
    let mut state = (row * 31 + salt * 7919 + 1) as u64;
    for _ in 0..3 {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
    }
    (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}

/// Inertia, friction, gravity and a soft gear, two encoders, everything measured.
pub(crate) fn joint(index: usize) -> JointColumns {
    let (name, ratio, phase) = JOINTS[index];
    let mut signals: BTreeMap<Signal, Vec<f64>> = BTreeMap::new();
    let (slow, fast) = (0.7 + 0.13 * index as f64, 2.1 + 0.4 * index as f64);
    for row in 0..ROWS {
        let t = row as f64 / RATE_HZ;
        let q = 0.6 * (slow * t + phase).sin() + 0.1 * (fast * t).sin();
        let v = 0.6 * slow * (slow * t + phase).cos() + 0.1 * fast * (fast * t).cos();
        let a =
            -0.6 * slow * slow * (slow * t + phase).sin() - 0.1 * fast * fast * (fast * t).sin();
        let load = 2.0 * a + 8.0 * (q + 0.3).sin();
        let friction = 3.0 * (v / 0.01).tanh() + 1.0 * v;
        let joint_torque = load + 0.05 * noise(row, index);
        let motor_torque = (load + friction) / ratio + 1e-3 * noise(row, index + 10);
        let torsion = load / 2e4;
        let count = |value: f64, step: f64| (value / step).round() * step;
        let values = [
            (Signal::ReferencePositionRad, q + 0.002 * (3.0 * t).sin()),
            (Signal::ReferenceVelocityRadS, v + 0.006 * (3.0 * t).cos()),
            (
                Signal::CommandTorqueNm,
                motor_torque + 1e-3 * noise(row, index + 20),
            ),
            (Signal::MotorTorqueNm, motor_torque),
            (
                Signal::MotorPositionRad,
                count(ratio * (q + torsion), MOTOR_STEP_RAD),
            ),
            (
                Signal::MotorVelocityRadS,
                ratio * v + 0.1 * noise(row, index + 30),
            ),
            (Signal::LinkPositionRad, count(q, LINK_STEP_RAD)),
            (Signal::LinkVelocityRadS, v + 1e-3 * noise(row, index + 40)),
            (Signal::JointTorqueNm, joint_torque),
            (Signal::MotorCurrentA, motor_torque / TORQUE_CONSTANT_NM_A),
        ];
        for (signal, value) in values {
            signals.entry(signal).or_default().push(value);
        }
    }
    JointColumns {
        name: name.to_owned(),
        signals,
    }
}

pub(crate) fn whole() -> Recording {
    Recording {
        time_s: (0..ROWS).map(|row| row as f64 / RATE_HZ).collect(),
        segment: None,
        joints: (0..JOINTS.len()).map(joint).collect(),
        sample_rate_hz: RATE_HZ,
        metadata: BTreeMap::new(),
        truncated: false,
    }
}

pub(crate) fn robot() -> CheckRobot {
    let joint = |(name, gear_ratio, _): (&str, f64, f64)| CheckJoint {
        name: name.to_owned(),
        gear_ratio,
        position_limit_rad: Some([-1.0, 1.0]),
        velocity_limit_rad_s: Some(1.5),
        torque_limit_nm: Some(0.3),
        torque_constant_nm_a: Some(TORQUE_CONSTANT_NM_A),
        motor_encoder_resolution_rad: Some(MOTOR_STEP_RAD),
        link_encoder_resolution_rad: Some(LINK_STEP_RAD),
        stiffness_nm_rad: Some(2e4),
    };
    CheckRobot {
        name: "bench".to_owned(),
        joints: JOINTS.map(joint).to_vec(),
    }
}

pub(crate) fn column(recording: &mut Recording, joint: usize, signal: Signal) -> &mut Vec<f64> {
    recording.joints[joint].signals.get_mut(&signal).unwrap()
}

pub(crate) fn scale(recording: &mut Recording, joint: usize, signal: Signal, factor: f64) {
    column(recording, joint, signal)
        .iter_mut()
        .for_each(|value| *value *= factor);
}

/// Warnings and errors.
pub(crate) fn serious(findings: Vec<Finding>) -> Vec<Finding> {
    let mut findings = findings;
    findings.retain(|finding| finding.severity > Severity::Note);
    findings
}

/// The only serious finding, which every mapping of that kind must give.
pub(crate) fn only(recording: &Recording, robot: Option<&CheckRobot>) -> Finding {
    let mut found = serious(check(recording, robot));
    assert_eq!(found.len(), 1, "{found:#?}");
    found.remove(0)
}
