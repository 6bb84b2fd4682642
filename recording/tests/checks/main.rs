//! Recordings with one thing wrong each: it is found, named, and nothing else is.
#![allow(clippy::unwrap_used, reason = "a test may")]

use proptest::prelude::*;
use recording::{
    CheckRobot, Finding, FindingKind, JointColumns, Recording, Severity, Signal, check, describe,
};
use std::collections::BTreeMap;

mod bench;
mod gear_ratio;

use bench::{
    DEGREES, JOINTS, RATE_HZ, ROWS, TORQUE_CONSTANT_NM_A, column, noise, only, robot, scale,
    serious, whole,
};

#[test]
fn a_whole_recording_has_no_findings() {
    assert_eq!(check(&whole(), None), []);
    assert_eq!(check(&whole(), Some(&robot())), []);
}

#[test]
fn a_factor_is_named_with_the_signal_the_joint_and_what_undoes_it() {
    use FindingKind::{ReversedSign, WrongSide, WrongUnit};
    use Signal::*;
    let cases = [
        (MotorPositionRad, DEGREES, WrongUnit),
        (MotorPositionRad, -1.0, ReversedSign),
        (MotorPositionRad, 0.01, WrongSide),
        (MotorPositionRad, 1.0 / std::f64::consts::TAU, WrongUnit),
        (LinkPositionRad, DEGREES, WrongUnit),
        (LinkPositionRad, -1.0, ReversedSign),
        (LinkPositionRad, 100.0, WrongSide),
        (ReferencePositionRad, DEGREES, WrongUnit),
        (ReferencePositionRad, -1.0, ReversedSign),
        (MotorVelocityRadS, 60.0 / std::f64::consts::TAU, WrongUnit),
        (MotorVelocityRadS, 0.01, WrongSide),
        (LinkVelocityRadS, -DEGREES, WrongUnit),
        (LinkVelocityRadS, -1.0, ReversedSign),
        (ReferenceVelocityRadS, DEGREES, WrongUnit),
        (MotorTorqueNm, -1.0, ReversedSign),
        (JointTorqueNm, -1.0, ReversedSign),
    ];
    for (signal, factor, kind) in cases {
        let mut recording = whole();
        scale(&mut recording, 1, signal, factor);
        let findings = serious(check(&recording, Some(&robot())));
        let Some(first) = findings.first() else {
            panic!("{signal} times {factor}: nothing found")
        };
        assert_eq!(
            (first.kind, first.signal, first.joint.as_deref()),
            (kind, Some(signal), Some("b")),
            "{signal} times {factor}: {findings:#?}"
        );
        assert!(
            first.remedy.contains(&format!("[joint.b], {signal}")),
            "{first}"
        );
        assert!(
            (first.value.unwrap() / factor - 1.0).abs() < 0.02,
            "{first}"
        );
        let others = findings.iter().filter(|other| other.signal != Some(signal));
        assert_eq!(others.count(), 0, "{findings:#?}");
        // Without a robot file it may be another signal that is named, but none of another joint.
        let findings = serious(check(&recording, None));
        assert!(!findings.is_empty(), "{signal} times {factor}");
        assert!(
            findings
                .iter()
                .all(|other| other.joint.as_deref() == Some("b")),
            "{findings:#?}"
        );
    }
}

#[test]
fn a_joint_that_friction_holds_is_not_in_turns() {
    use Signal::*;
    let mut recording = whole();
    for signal in [LinkPositionRad, LinkVelocityRadS] {
        recording.joints[1].signals.remove(&signal);
    }
    // it was asked for seven times as much
    scale(&mut recording, 1, ReferencePositionRad, 7.0);
    scale(&mut recording, 1, ReferenceVelocityRadS, 7.0);
    let is_unit = |finding: &Finding| finding.kind == FindingKind::WrongUnit;
    let findings = check(&recording, Some(&robot()));
    assert!(!findings.iter().any(is_unit), "{findings:#?}");
    // with another step it is
    let factor = 1.0 / std::f64::consts::TAU;
    let mut recording = whole();
    scale(&mut recording, 1, MotorPositionRad, factor);
    recording.joints[1].signals.remove(&LinkPositionRad);
    let findings = check(&recording, Some(&robot()));
    assert!(findings.iter().any(is_unit), "{findings:#?}");
}

#[test]
fn a_reversed_torque_is_told_by_friction_and_work() {
    for signals in [
        &[
            Signal::MotorTorqueNm,
            Signal::CommandTorqueNm,
            Signal::MotorCurrentA,
        ][..],
        &[Signal::MotorTorqueNm],
    ] {
        for index in 0..JOINTS.len() {
            let mut recording = whole();
            for signal in signals {
                scale(&mut recording, index, *signal, -1.0);
            }
            let finding = &serious(check(&recording, Some(&robot())))[0];
            assert_eq!(
                (finding.kind, finding.signal),
                (FindingKind::ReversedSign, Some(Signal::MotorTorqueNm)),
                "{finding}"
            );
        }
    }
}

#[test]
fn a_torque_that_other_joints_make_is_not_reversed_by_chance() {
    let found = |others_nm: f64| {
        let mut recording = whole();
        recording.joints.truncate(1);
        let signals = &mut recording.joints[0].signals;
        signals.retain(|signal, _| *signal == Signal::LinkPositionRad);
        let position = &signals[&Signal::LinkPositionRad];
        let torque = (0..ROWS).map(|row| {
            let moved_rad = position[(row + 1).min(ROWS - 1)] - position[row.saturating_sub(1)];
            let others = (5.3 * row as f64 / RATE_HZ).sin();
            -0.5 * moved_rad.signum() + others_nm * others
        });
        let torque = torque.collect();
        signals.insert(Signal::MotorTorqueNm, torque);
        let findings = check(&recording, None);
        let reversed = |finding: &Finding| finding.kind == FindingKind::ReversedSign;
        findings.iter().any(reversed)
    };
    assert!(found(0.2));
    assert!(!found(1.0));
}

#[test]
fn angles_all_in_degrees_are_told_by_the_robot_file() {
    let mut recording = whole();
    for joint in 0..JOINTS.len() {
        for signal in Signal::ALL
            .into_iter()
            .filter(|signal| signal.name().contains("_rad"))
        {
            scale(&mut recording, joint, signal, DEGREES);
        }
    }
    let findings = serious(check(&recording, Some(&robot())));
    for (name, ..) in JOINTS {
        let first = findings
            .iter()
            .find(|finding| finding.joint.as_deref() == Some(name))
            .unwrap();
        assert_eq!(
            (first.severity, first.kind),
            (Severity::Error, FindingKind::WrongUnit),
            "{first}"
        );
    }
}

#[test]
fn encoders_that_agree_in_degrees_are_wrong_and_not_their_reference() {
    let degrees = 180.0 / std::f64::consts::PI;
    let wrong = |signals: &[Signal]| -> Vec<Option<Signal>> {
        let mut recording = whole();
        for signal in signals {
            scale(&mut recording, 1, *signal, degrees);
        }
        let findings = check(&recording, Some(&robot())).into_iter();
        let units = findings.filter(|finding| finding.kind == FindingKind::WrongUnit);
        units.map(|finding| finding.signal).collect()
    };
    let encoders = [Signal::LinkPositionRad, Signal::MotorPositionRad];
    assert!(wrong(&encoders).starts_with(&encoders.map(Some)));
    let reference = [Signal::ReferencePositionRad];
    assert_eq!(wrong(&reference)[..1], reference.map(Some));
}

#[test]
fn swapped_joints_are_named() {
    let positions = [Signal::MotorPositionRad, Signal::MotorVelocityRadS];
    let torques = [Signal::MotorTorqueNm];
    for signals in [&positions[..], &torques] {
        let mut recording = whole();
        let [a, b, _] = &mut recording.joints[..] else {
            panic!("three joints")
        };
        // as a drive reports what it was told
        for joint in [&mut *a, &mut *b] {
            let torque_nm = joint.signals[&Signal::MotorTorqueNm].clone();
            joint.signals.insert(Signal::CommandTorqueNm, torque_nm);
        }
        for signal in signals {
            let (of_a, of_b) = (
                a.signals.get_mut(signal).unwrap(),
                b.signals.get_mut(signal).unwrap(),
            );
            std::mem::swap(of_a, of_b);
        }
        let findings = serious(check(&recording, None));
        let swapped: Vec<_> = findings
            .iter()
            .filter(|finding| finding.kind == FindingKind::SwappedJoints)
            .collect();
        // neither of the two is diagnosed
        assert_eq!(swapped.len(), 2, "{findings:#?}");
        for (finding, other) in swapped.iter().zip(["b", "a"]) {
            let remedy = format!("exchange the columns with those of [joint.{other}]");
            assert!(finding.to_string().contains(&remedy), "{finding}");
            assert_eq!(finding.signal, Some(signals[0]));
        }
    }
}

#[test]
fn a_joint_the_robot_does_not_have_and_one_the_recording_lacks() {
    let mut recording = whole();
    recording.joints[2].name = "cc".to_owned();
    let findings = serious(check(&recording, Some(&robot())));
    let kinds: Vec<_> = findings
        .iter()
        .map(|finding| (finding.kind, finding.joint.as_deref().unwrap()))
        .collect();
    assert_eq!(
        kinds,
        [
            (FindingKind::UnknownJoint, "cc"),
            (FindingKind::MissingJoint, "c")
        ]
    );
    assert!(
        findings[0].remedy.contains("perhaps [joint.c]"),
        "{}",
        findings[0]
    );
}

#[test]
fn a_current_or_a_joint_torque_in_place_of_the_motor_torque() {
    let mut recording = whole();
    scale(
        &mut recording,
        0,
        Signal::MotorTorqueNm,
        1.0 / TORQUE_CONSTANT_NM_A,
    );
    assert_eq!(
        serious(check(&recording, Some(&robot())))[0].kind,
        FindingKind::CurrentAsTorque
    );
    recording.joints[0].signals.remove(&Signal::MotorCurrentA);
    assert_eq!(
        serious(check(&recording, Some(&robot())))[0].kind,
        FindingKind::CurrentAsTorque
    );
    recording.joints[0].signals.remove(&Signal::CommandTorqueNm);
    let finding = only(&recording, Some(&robot()));
    assert_eq!(finding.kind, FindingKind::BeyondLimit);
    assert!(
        finding.remedy.contains("0.25 if it is the current"),
        "{finding}"
    );
    let mut recording = whole();
    scale(&mut recording, 0, Signal::MotorTorqueNm, 50.0);
    assert_eq!(
        serious(check(&recording, Some(&robot())))[0].kind,
        FindingKind::WrongSide
    );
}

#[test]
fn positions_beyond_the_limits_are_told_with_them() {
    let mut recording = whole();
    for signal in [Signal::LinkPositionRad, Signal::ReferencePositionRad] {
        column(&mut recording, 0, signal)
            .iter_mut()
            .for_each(|value| *value += 1.0);
    }
    column(&mut recording, 0, Signal::MotorPositionRad)
        .iter_mut()
        .for_each(|value| *value += 50.0);
    let finding = only(&recording, Some(&robot()));
    assert_eq!(
        (finding.kind, finding.severity),
        (FindingKind::BeyondLimit, Severity::Warning),
        "{finding}"
    );
}

#[test]
fn one_limit_of_all_joints_is_told_once() {
    let mut slow = robot();
    let mut weak = robot();
    for (slow, weak) in slow.joints.iter_mut().zip(&mut weak.joints) {
        slow.velocity_limit_rad_s = Some(0.1);
        weak.torque_limit_nm = Some(1e-4);
    }
    for robot in [&slow, &weak] {
        let finding = only(&whole(), Some(robot));
        assert_eq!(finding.kind, FindingKind::BeyondLimit);
        assert_eq!((&finding.joint, finding.signal), (&None, None));
        assert!(finding.what.contains("at 3 joints ("), "{finding}");
    }
    // limits of their own are told of each
    slow.joints[1].velocity_limit_rad_s = Some(0.11);
    let each = serious(check(&whole(), Some(&slow)));
    assert!(each.len() == 3 && each.iter().all(|found| found.joint.is_some()));
}

#[test]
fn a_torque_limit_that_no_unit_keeps_refuses_nothing() {
    let mut robot = robot();
    robot.joints[0].torque_limit_nm = Some(1e-4);
    let found = serious(check(&whole(), Some(&robot)));
    assert!(!found.is_empty());
    for finding in found {
        assert_eq!(
            (finding.kind, finding.severity),
            (FindingKind::BeyondLimit, Severity::Warning),
            "{finding}"
        );
    }
}

#[test]
fn one_joint_that_turns_beyond_its_limits_is_not_in_degrees() {
    let turns = |joints: &[usize]| {
        let mut recording = whole();
        for joint in joints {
            for signal in recording.joints[*joint].signals.clone().into_keys() {
                if signal.name().contains("position") || signal.name().contains("velocity") {
                    scale(&mut recording, *joint, signal, DEGREES);
                }
            }
        }
        let mut found = check(&recording, Some(&robot()));
        found.retain(|finding| finding.what.ends_with("these are degrees"));
        found.len()
    };
    assert_eq!([turns(&[0]), turns(&[0, 1]), turns(&[0, 1, 2])], [0, 2, 3]);
}

#[test]
fn a_factor_of_all_velocities_that_is_no_unit_is_of_the_time() {
    let of_velocities = |recording: &Recording| {
        let mut found = check(recording, Some(&robot()));
        found.retain(|finding| finding.severity == Severity::Error);
        found
    };
    let mut recording = whole();
    recording.sample_rate_hz = RATE_HZ / 3.0;
    recording
        .time_s
        .iter_mut()
        .for_each(|time_s| *time_s *= 3.0);
    let found = of_velocities(&recording);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(found[0].kind, FindingKind::RateOff);
    assert_eq!((&found[0].joint, found[0].signal), (&None, None));
    assert!((found[0].value.unwrap() / RATE_HZ - 1.0).abs() < 0.01);
    assert!(
        found[0].remedy.contains("`sample_rate_hz` to 500.0"),
        "{}",
        found[0]
    );
    assert!(found[0].remedy.contains("by 3.33"), "{}", found[0]);

    // a clock that was read is believed
    let mut read = recording.clone();
    for row in 1..ROWS {
        read.time_s[row] += 0.1e-3 * noise(row, 5);
    }
    let found = of_velocities(&read);
    assert!(found.len() > 1 && found.iter().all(|f| f.kind == FindingKind::WrongScale));

    // one joint alone may be off by any factor
    let mut alone = recording.clone();
    alone.joints.truncate(1);
    let found = of_velocities(&alone);
    assert!(found.len() == 3 && found.iter().all(|f| f.kind == FindingKind::WrongScale));
    // a velocity that is right has the right time
    scale(&mut recording, 1, Signal::MotorVelocityRadS, 1.0 / 3.0);
    let found = of_velocities(&recording);
    assert!(found.len() == 8 && found.iter().all(|f| f.kind == FindingKind::WrongScale));
    // and so has a unit
    let mut recording = whole();
    for joint in 0..JOINTS.len() {
        scale(&mut recording, joint, Signal::LinkVelocityRadS, DEGREES);
    }
    let found = of_velocities(&recording);
    assert!(found.len() == 3 && found.iter().all(|f| f.kind == FindingKind::WrongUnit));
}

#[test]
fn time_that_is_not_regular_is_described() {
    let mut recording = whole();
    recording
        .time_s
        .iter_mut()
        .skip(5000)
        .for_each(|time_s| *time_s += 2.0);
    let finding = only(&recording, None);
    assert_eq!(finding.kind, FindingKind::Gaps);
    assert!(finding.what.contains("room for 1000 rows"), "{finding}");
    assert!(finding.what.contains("2.0020 s at 9.9980 s"), "{finding}");

    let mut recording = whole();
    recording.sample_rate_hz = 1000.0;
    let kinds: Vec<_> = check(&recording, None)
        .iter()
        .map(|finding| finding.kind)
        .collect();
    assert!(kinds.contains(&FindingKind::RateOff), "{kinds:?}");

    let mut recording = whole();
    for row in 1..ROWS {
        recording.time_s[row] += 0.4e-3 * 2.0 * noise(row, 5);
    }
    assert_eq!(only(&recording, None).kind, FindingKind::Jitter);
    let timing = describe(&recording).timing;
    assert!(
        (timing.jitter_std_s / (0.8e-3 / 6_f64.sqrt()) - 1.0).abs() < 0.1,
        "{timing:?}"
    );

    let mut recording = whole();
    recording.time_s[77] = recording.time_s[76];
    let kinds: Vec<_> = check(&recording, None)
        .iter()
        .map(|finding| finding.kind)
        .collect();
    assert!(kinds.contains(&FindingKind::RepeatedTimes), "{kinds:?}");
}

#[test]
fn a_clock_of_whole_seconds_is_no_time() {
    let mut recording = whole();
    for time_s in &mut recording.time_s {
        *time_s = time_s.floor();
    }
    let found = check(&recording, None);
    let repeated = found
        .iter()
        .find(|finding| finding.kind == FindingKind::RepeatedTimes);
    let remedy = &repeated.expect("told").remedy;
    assert!(remedy.contains("set `sample_rate_hz`"), "{remedy}");
}

#[test]
fn signals_that_stay_or_are_missing_are_named() {
    let mut recording = whole();
    let stuck = column(&mut recording, 1, Signal::MotorPositionRad);
    let held = stuck[4000];
    stuck[4000..4400].fill(held);
    let finding = only(&recording, None);
    assert_eq!(
        (finding.kind, finding.signal),
        (FindingKind::StuckSignal, Some(Signal::MotorPositionRad))
    );
    assert!(finding.what.contains("0.798 s from 8.000 s"), "{finding}");

    let mut recording = whole();
    column(&mut recording, 1, Signal::JointTorqueNm).fill(0.0);
    let finding = only(&recording, None);
    assert_eq!(
        (finding.kind, finding.signal),
        (FindingKind::StuckSignal, Some(Signal::JointTorqueNm))
    );

    // a drive that was switched off after the first rows
    column(&mut recording, 1, Signal::JointTorqueNm)[..50].fill(0.7);
    let finding = only(&recording, None);
    assert_eq!(
        (finding.kind, finding.signal),
        (FindingKind::StuckSignal, Some(Signal::JointTorqueNm))
    );
    let mut recording = whole();
    column(&mut recording, 1, Signal::JointTorqueNm)[..2000].fill(f64::NAN);
    let finding = only(&recording, None);
    assert_eq!(
        (finding.kind, finding.value),
        (FindingKind::MissingValues, Some(0.2))
    );
}

#[test]
fn a_torque_sensor_that_goes_against_friction_is_not_reversed() {
    let mut recording = whole();
    recording.joints.truncate(1);
    // driven up for half of the time while the load pulls it on, then held against a load that pulls it back
    let half = ROWS / 2;
    let ratio = JOINTS[0].1;
    let moved_rad = |row: usize| 0.05 * row.min(half) as f64 / RATE_HZ;
    let load_nm = |row: usize| -2.0 + 4.0 * row as f64 / ROWS as f64;
    let motor_nm = |row: usize| (load_nm(row) + if row < half { 8.0 } else { 0.0 }) / ratio;
    let signals = &mut recording.joints[0].signals;
    signals.clear();
    let mut add = |signal, of: &dyn Fn(usize) -> f64| {
        signals.insert(signal, (0..ROWS).map(of).collect());
    };
    add(Signal::MotorPositionRad, &|row| ratio * moved_rad(row));
    add(Signal::MotorTorqueNm, &motor_nm);
    add(Signal::JointTorqueNm, &load_nm);
    let found = serious(check(&recording, Some(&robot())));
    let reversed = found
        .iter()
        .filter(|of| of.kind == FindingKind::ReversedSign);
    assert_eq!(reversed.count(), 0, "{found:#?}");
}

#[test]
fn of_a_motor_and_a_sensor_the_one_that_makes_friction_give_power_is_reversed() {
    for reversed in [Signal::MotorTorqueNm, Signal::JointTorqueNm] {
        let mut recording = whole();
        recording.joints.truncate(1);
        let signals = &mut recording.joints[0].signals;
        signals.retain(|signal, _| {
            [
                Signal::LinkPositionRad,
                Signal::MotorTorqueNm,
                Signal::JointTorqueNm,
            ]
            .contains(signal)
        });
        // what other joints do hides the friction in either torque
        for (signal, ratio) in [
            (Signal::MotorTorqueNm, JOINTS[0].1),
            (Signal::JointTorqueNm, 1.0),
        ] {
            let torque_nm = signals.get_mut(&signal).unwrap().iter_mut();
            for (row, nm) in torque_nm.enumerate() {
                *nm += 40.0 * (5.3 * row as f64 / RATE_HZ).sin() / ratio;
            }
        }
        scale(&mut recording, 0, reversed, -1.0);
        let found = serious(check(&recording, None));
        let told: Vec<_> = found.iter().map(|of| (of.kind, of.signal)).collect();
        assert_eq!(
            told,
            [(FindingKind::ReversedSign, Some(reversed))],
            "{found:#?}"
        );
    }
}

#[test]
fn a_joint_that_stands_or_moves_in_one_way_only_is_named() {
    let still = |recording: &mut Recording, joint: usize| {
        for column in recording.joints[joint].signals.values_mut() {
            let first = column[0];
            column.fill(first);
        }
    };
    let mut recording = whole();
    still(&mut recording, 2);
    assert_eq!(only(&recording, Some(&robot())).kind, FindingKind::NoMotion);

    let moved = |position_rad: &dyn Fn(f64) -> f64| {
        let mut recording = whole();
        recording.joints.truncate(1);
        for row in 0..ROWS {
            recording.joints[0]
                .signals
                .get_mut(&Signal::LinkPositionRad)
                .unwrap()[row] = position_rad(row as f64 / RATE_HZ);
        }
        recording.joints[0]
            .signals
            .retain(|signal, _| matches!(signal, Signal::LinkPositionRad | Signal::MotorTorqueNm));
        only(&recording, None).kind
    };
    let there_and_back = |t: f64| 0.05 * if t > 10.0 { 20.0 - t } else { t };
    assert_eq!(moved(&there_and_back), FindingKind::OneSpeed);
    assert_eq!(moved(&|t| 0.05 * t), FindingKind::OneSpeed);
    let swing = |hz: f64, t: f64| 0.1 / hz * (std::f64::consts::TAU * hz * t).sin();
    assert_eq!(moved(&|t| swing(0.7, t)), FindingKind::OneFrequency);
    let onwards = |t: f64| 0.4 * t + 0.3 * swing(0.7, t) + 0.2 * swing(0.25, t);
    assert_eq!(moved(&onwards), FindingKind::OneDirection);
}

#[test]
fn what_a_recording_cannot_support_is_said() {
    let kinds = |kept: &[Signal]| {
        let mut recording = whole();
        for joint in &mut recording.joints {
            joint.signals.retain(|signal, _| kept.contains(signal));
        }
        recording.joints.truncate(1);
        let findings = check(
            &recording,
            Some(&CheckRobot {
                joints: robot().joints[..1].to_vec(),
                ..robot()
            }),
        );
        findings
            .into_iter()
            .map(|finding| (finding.severity, finding.kind))
            .collect::<Vec<_>>()
    };
    assert_eq!(
        kinds(&[Signal::MotorPositionRad]),
        [
            (Severity::Warning, FindingKind::NoTorque),
            (Severity::Note, FindingKind::OneEncoder),
            (Severity::Note, FindingKind::NoReference)
        ]
    );
    assert_eq!(
        kinds(&[Signal::LinkPositionRad, Signal::JointTorqueNm]),
        [
            (Severity::Note, FindingKind::OneEncoder),
            (Severity::Note, FindingKind::NoTorque),
            (Severity::Note, FindingKind::NoReference)
        ]
    );
    assert_eq!(
        kinds(&[Signal::MotorTorqueNm, Signal::ReferencePositionRad]),
        [(Severity::Error, FindingKind::NoPosition)]
    );
    let two = [
        Signal::MotorPositionRad,
        Signal::LinkPositionRad,
        Signal::ReferencePositionRad,
    ];
    let with = |signal| kinds(&[&two[..], &[signal]].concat());
    assert_eq!(
        with(Signal::CommandTorqueNm),
        [(Severity::Note, FindingKind::CommandOnly)]
    );
    assert_eq!(with(Signal::MotorTorqueNm), []);
}

#[test]
fn findings_survive_json() {
    let mut recording = whole();
    scale(&mut recording, 0, Signal::LinkPositionRad, -1.0);
    let findings = check(&recording, Some(&robot()));
    let text = serde_json::to_string(&findings).unwrap();
    assert!(text.contains("\"signal\":\"link_position_rad\""), "{text}");
    let read: Vec<Finding> = serde_json::from_str(&text).unwrap();
    assert_eq!(read[0].to_string(), findings[0].to_string());
}

fn any_column(rows: usize) -> impl Strategy<Value = Vec<f64>> {
    let value = prop_oneof![
        4 => -10.0..10.0,
        1 => Just(f64::NAN),
        1 => Just(0.0),
        1 => proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL,
    ];
    prop::collection::vec(value, rows)
}

proptest! {
    #[test]
    fn any_table_can_be_checked(
        (steps, columns, segments) in (0..300_usize).prop_flat_map(|rows| (
            prop::collection::vec(prop_oneof![Just(0.01), Just(0.0), 0.0..1e9], rows),
            prop::collection::vec(prop::collection::btree_map(prop::sample::select(&Signal::ALL[..]), any_column(rows), 0..6), 0..4),
            prop::option::of(prop::collection::vec(0..2_i64, rows)),
        )),
        rate_hz in prop_oneof![Just(100.0), 1e-9..1e9],
    ) {
        let mut time_s = 0.0;
        let time_s = steps.into_iter().map(|step_s| { time_s += step_s; time_s }).collect();
        let joints = columns.into_iter().enumerate().map(|(index, signals)| JointColumns {
            name: ["a", "b", "x", "y"][index].to_owned(),
            signals,
        });
        let recording = Recording {
            time_s,
            segment: segments,
            joints: joints.collect(),
            sample_rate_hz: rate_hz,
            metadata: BTreeMap::new(),
            truncated: true,
        };
        let _ = check(&recording, Some(&robot()));
        let _ = describe(&recording);
    }
}
