//! Motor turns per joint turn that are not the robot file's, and what only looks like it.

use recording::{Finding, FindingKind, Severity, Signal, check};

use crate::bench::{JOINTS, MOTOR_STEP_RAD, RATE_HZ, column, only, robot, serious, whole};

#[test]
fn a_gear_ratio_off_is_an_error_with_both_numbers() {
    for factor in [1.02, 0.5, 1.6] {
        let mut robot = robot();
        robot.joints[1].gear_ratio = 100.0 / factor;
        let mut recording = whole();
        recording.joints[1]
            .signals
            .remove(&Signal::ReferencePositionRad);
        robot.joints[1].motor_encoder_resolution_rad = None;
        robot.joints[1].velocity_limit_rad_s = None;
        let finding = only(&recording, Some(&robot));
        assert_eq!(finding.kind, FindingKind::WrongGearRatio, "{finding}");
        assert!((finding.value.unwrap() - 100.0).abs() < 0.3, "{finding}");
    }
}

#[test]
fn without_a_second_encoder_a_gear_ratio_off_is_told_by_the_reference_that_is_followed_in_proportion()
 {
    for factor in [0.8, 1.25, 1.59] {
        let mut robot = robot();
        robot.joints[1].gear_ratio = 100.0 / factor;
        robot.joints[1].motor_encoder_resolution_rad = None;
        robot.joints[1].velocity_limit_rad_s = None;
        let mut recording = whole();
        let signals = &mut recording.joints[1].signals;
        signals.remove(&Signal::LinkPositionRad);
        signals.remove(&Signal::LinkVelocityRadS);
        let findings = check(&recording, Some(&robot));
        let mut ratios = findings
            .iter()
            .filter(|finding| finding.kind == FindingKind::WrongGearRatio);
        let finding = ratios.next().unwrap();
        assert!((finding.value.unwrap() - 100.0).abs() < 0.5, "{finding}");
    }
}

#[test]
fn a_weak_controller_that_lets_gravity_and_friction_pull_is_no_gear_ratio() {
    let (_, ratio, _) = JOINTS[1];
    let mut recording = whole();
    let signals = &mut recording.joints[1].signals;
    signals.remove(&Signal::LinkPositionRad);
    signals.remove(&Signal::LinkVelocityRadS);
    // 20 Nm/rad against about 8 Nm of gravity and 3 Nm of friction
    let torque_nm = signals[&Signal::MotorTorqueNm].clone();
    let error_rad = torque_nm.iter().map(|torque_nm| ratio * torque_nm / 20.0);
    let reference_rad = signals[&Signal::MotorPositionRad].iter().zip(error_rad);
    let reference_rad: Vec<f64> = reference_rad
        .map(|(motor_rad, error_rad)| motor_rad / ratio + error_rad)
        .collect();
    *column(&mut recording, 1, Signal::ReferencePositionRad) = reference_rad;
    let findings = check(&recording, Some(&robot()));
    let is_ratio = |finding: &Finding| finding.kind == FindingKind::WrongGearRatio;
    assert!(!findings.iter().any(is_ratio), "{findings:#?}");
}

#[test]
fn a_joint_that_gravity_holds_back_or_carries_on_all_the_way_one_way_is_no_error_of_its_positions()
{
    let (_, ratio, _) = JOINTS[1];
    for (asked, has_link_encoder) in [(1.14, true), (1.14, false), (0.55, true)] {
        let mut recording = whole();
        let rows = recording.time_s.len();
        let joint_rad: Vec<f64> = (0..rows).map(|row| row as f64 / rows as f64).collect();
        let motor_rad = joint_rad.iter().map(|q| ratio * q).collect();
        // what a weak controller lacks grows with the load, and friction is the same all the way
        let reference_rad = joint_rad.iter().map(|q| asked * q + 0.05).collect();
        for signal in [
            Signal::LinkVelocityRadS,
            Signal::MotorVelocityRadS,
            Signal::ReferenceVelocityRadS,
        ] {
            recording.joints[1].signals.remove(&signal);
        }
        *column(&mut recording, 1, Signal::LinkPositionRad) = joint_rad;
        if !has_link_encoder {
            recording.joints[1].signals.remove(&Signal::LinkPositionRad);
        }
        *column(&mut recording, 1, Signal::MotorPositionRad) = motor_rad;
        *column(&mut recording, 1, Signal::ReferencePositionRad) = reference_rad;
        let findings = check(&recording, Some(&robot()));
        let is_error = |finding: &&Finding| finding.severity == Severity::Error;
        let errors: Vec<&Finding> = findings.iter().filter(is_error).collect();
        let of_position = |finding: &&&Finding| finding.is_of_position();
        assert_eq!(errors.iter().filter(of_position).count(), 0, "{errors:#?}");
    }
}

#[test]
fn what_may_be_a_gear_ratio_or_a_weak_controller_is_a_warning() {
    let mut robot = robot();
    robot.joints[1].gear_ratio = 100.0 / 1.15;
    robot.joints[1].motor_encoder_resolution_rad = None;
    let mut recording = whole();
    let signals = &mut recording.joints[1].signals;
    signals.remove(&Signal::LinkPositionRad);
    signals.remove(&Signal::LinkVelocityRadS);
    let reference_rad = column(&mut recording, 1, Signal::ReferencePositionRad);
    for (row, reference_rad) in reference_rad.iter_mut().enumerate() {
        *reference_rad += 0.02 * (5.0 * row as f64 / RATE_HZ).sin();
    }
    let findings = check(&recording, Some(&robot));
    let is_ratio = |finding: &&Finding| finding.kind == FindingKind::WrongGearRatio;
    let finding = findings.iter().find(is_ratio).unwrap();
    assert_eq!(finding.severity, Severity::Warning, "{finding}");
    assert!((finding.value.unwrap() - 1.15).abs() < 0.01, "{finding}");
    assert!(finding.what.contains("weak controller"), "{finding}");
}

#[test]
fn lost_motion_is_no_gear_ratio() {
    let mut recording = whole();
    let link_rad = column(&mut recording, 1, Signal::LinkPositionRad).clone();
    let swing_rad = link_rad.iter().fold(0.0_f64, |most, q| most.max(q.abs()));
    let gap_rad = 0.04 * swing_rad;
    // the motor drags the link along with whichever side of the gap it is at
    let mut behind_rad = link_rad[0];
    let lost = link_rad.iter().map(|motor_rad| {
        behind_rad = behind_rad.clamp(motor_rad - gap_rad, motor_rad + gap_rad);
        behind_rad
    });
    let lost: Vec<f64> = lost.collect();
    *column(&mut recording, 1, Signal::LinkPositionRad) = lost;
    let findings = serious(check(&recording, Some(&robot())));
    let is_ratio = |finding: &Finding| finding.kind == FindingKind::WrongGearRatio;
    assert!(!findings.iter().any(is_ratio), "{findings:#?}");
}

#[test]
fn a_gap_that_gravity_holds_open_is_no_gear_ratio() {
    let (_, ratio, _) = JOINTS[1];
    let mut recording = whole();
    let times_s = recording.time_s.clone();
    let link_rad = times_s.iter().map(|time_s| 0.6 * (3.0 * time_s).sin());
    let link_rad: Vec<f64> = link_rad.collect();
    // the load is on one side of the gap where the joint is on one side of the vertical
    let motor_rad = link_rad
        .iter()
        .map(|link_rad| ratio * (link_rad + 0.01 * link_rad.signum()));
    let motor_rad: Vec<f64> = motor_rad.collect();
    *column(&mut recording, 1, Signal::LinkPositionRad) = link_rad;
    *column(&mut recording, 1, Signal::MotorPositionRad) = motor_rad;
    let findings = check(&recording, Some(&robot()));
    let is_ratio = |finding: &Finding| finding.kind == FindingKind::WrongGearRatio;
    assert!(!findings.iter().any(is_ratio), "{findings:#?}");
}

#[test]
fn a_joint_that_lags_behind_its_reference_is_no_gear_ratio() {
    let (_, ratio, _) = JOINTS[1];
    let alone = |moved: &dyn Fn(&[f64]) -> Vec<f64>| {
        let mut recording = whole();
        let signals = &mut recording.joints[1].signals;
        for signal in [
            Signal::LinkPositionRad,
            Signal::LinkVelocityRadS,
            Signal::MotorVelocityRadS,
        ] {
            signals.remove(&signal);
        }
        let position_rad = moved(&signals[&Signal::ReferencePositionRad]);
        let steps = position_rad
            .iter()
            .map(|q| (ratio * q / MOTOR_STEP_RAD).round() * MOTOR_STEP_RAD);
        *column(&mut recording, 1, Signal::MotorPositionRad) = steps.collect();
        let findings = serious(check(&recording, Some(&robot())));
        let is_ratio = |finding: &Finding| finding.kind == FindingKind::WrongGearRatio;
        findings.iter().any(is_ratio)
    };
    let largest = |of: &[f64]| of.iter().fold(0.0_f64, |most, q| most.max(q.abs()));
    // friction holds the joint until the reference is far enough away
    let held = |reference_rad: &[f64]| {
        let gap_rad = 0.43 * largest(reference_rad);
        let mut behind_rad = reference_rad[0];
        let follow = |q: &f64| {
            behind_rad = behind_rad.clamp(q - gap_rad, q + gap_rad);
            behind_rad
        };
        reference_rad.iter().map(follow).collect()
    };
    assert!(!alone(&held));
    // one that moves as far and follows at once has another gear
    let other = |reference_rad: &[f64]| reference_rad.iter().map(|q| 0.4 * q).collect();
    assert!(alone(&other));
}

#[test]
fn a_soft_gears_windup_is_no_gear_ratio() {
    let (_, ratio, _) = JOINTS[1];
    let mut recording = whole();
    let link_rad = column(&mut recording, 1, Signal::LinkPositionRad).clone();
    let load_nm = column(&mut recording, 1, Signal::JointTorqueNm).clone();
    let stiffness_nm_rad = 300.0;
    let motor_rad = link_rad.iter().zip(&load_nm);
    *column(&mut recording, 1, Signal::MotorPositionRad) = motor_rad
        .map(|(q, load_nm)| {
            (ratio * (q + load_nm / stiffness_nm_rad) / MOTOR_STEP_RAD).round() * MOTOR_STEP_RAD
        })
        .collect();
    let is_ratio = |finding: &Finding| finding.kind == FindingKind::WrongGearRatio;
    let mut robot = robot();
    // half as soft as the file says is a gap, not another gear
    robot.joints[1].stiffness_nm_rad = Some(2.0 * stiffness_nm_rad);
    let findings = check(&recording, Some(&robot));
    assert!(!findings.iter().any(is_ratio), "{findings:#?}");
    robot.joints[1].stiffness_nm_rad = None;
    let findings = check(&recording, Some(&robot));
    assert!(findings.iter().any(is_ratio), "{findings:#?}");
}

#[test]
fn one_turn_more_or_less_is_told_by_what_else_tilts_the_encoders_line() {
    for told in [99.0, 101.0] {
        let mut robot = robot();
        robot.joints[1].gear_ratio = told;
        // nobody may say that the velocity or the encoder's step is what is wrong
        let finding = only(&whole(), Some(&robot));
        assert_eq!(finding.kind, FindingKind::WrongGearRatio, "{finding}");
        assert_eq!(finding.severity, Severity::Error, "{finding}");
        assert!((finding.value.unwrap() - 100.0).abs() < 0.1, "{finding}");
        assert!(
            finding.what.contains("which of its parts is held"),
            "{finding}"
        );
    }
}

#[test]
fn an_encoder_off_its_centre_is_no_error_of_the_ratio() {
    // over the middle of its way it tilts the line as much as a turn more would
    let mut recording = whole();
    let link_rad = column(&mut recording, 1, Signal::LinkPositionRad);
    for angle_rad in link_rad {
        *angle_rad -= 0.0108 * angle_rad.sin();
    }
    let finding = only(&recording, Some(&robot()));
    assert_eq!(finding.kind, FindingKind::WrongGearRatio, "{finding}");
    assert_eq!(finding.severity, Severity::Warning, "{finding}");
    assert!(finding.what.contains("off its centre"), "{finding}");
}
