//! Against the robot file: names, limits, resolutions.

use super::meaning::{DEGREES, MEASURED, Meaning};
use super::scale::Scales;
use super::{CheckJoint, CheckRobot, Finding, FindingKind, mapping_line, values};
use crate::error::{list, nearest};
use crate::statistics::{range, step};
use crate::{JointColumns, Recording, Signal};
use std::f64::consts::PI;

/// A joint may overshoot its position limit by this much.
const OVERSHOOT_RAD: f64 = 0.05;
/// Peaks above a torque or velocity limit by less are noise and overshoot.
const PEAK: f64 = 1.2;

/// Joints that only one of the two knows.
pub(super) fn check_names(robot: &CheckRobot, recording: &Recording) -> Vec<Finding> {
    let of_robot: Vec<String> = robot
        .joints
        .iter()
        .map(|joint| joint.name.clone())
        .collect();
    let mut findings = Vec::new();
    for joint in &recording.joints {
        if robot.joint(&joint.name).is_none() {
            let what = format!(
                "robot `{}` has no such joint; its joints are {}",
                robot.name,
                list(&of_robot)
            );
            let near = nearest(&joint.name, of_robot.iter().map(String::as_str));
            let remedy = near.map_or_else(String::new, |near| format!(", perhaps [joint.{near}]"));
            let remedy = format!("rename [joint.{}] in the mapping file{remedy}", joint.name);
            findings.push(
                Finding::error(FindingKind::UnknownJoint, what)
                    .at(joint)
                    .remedy(remedy),
            );
        }
    }
    for name in of_robot {
        if recording.joint(&name).is_err() {
            let what = format!(
                "robot `{}` has this joint, the recording does not",
                robot.name
            );
            let finding = Finding::warning(FindingKind::MissingJoint, what);
            let finding = finding.remedy(format!("map its columns under [joint.{name}]"));
            findings.push(Finding {
                joint: Some(name),
                ..finding
            });
        }
    }
    findings
}

/// One joint's values against the robot file's numbers.
pub(super) fn check_joint(
    robot: &CheckRobot,
    of_robot: &CheckJoint,
    joint: &JointColumns,
    seen: &Scales,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    findings.extend(positions(robot, of_robot, joint, seen));
    findings.extend(velocities(of_robot, joint, seen));
    for signal in [Signal::MotorTorqueNm, Signal::CommandTorqueNm] {
        findings.extend(torque(of_robot, joint, signal));
    }
    findings.extend(resolutions(of_robot, joint, seen));
    findings
}

/// A signal's range at the joint side, in what the other signals show to be its unit.
fn joint_side_range(joint: &JointColumns, signal: Signal, factor: f64) -> Option<[f64; 2]> {
    let [a, b] = range(values(joint, signal)?)?.map(|value| value / factor);
    Some([a.min(b), a.max(b)])
}

fn positions(
    robot: &CheckRobot,
    of_robot: &CheckJoint,
    joint: &JointColumns,
    seen: &Scales,
) -> Option<Finding> {
    let [low, high] = of_robot.position_limit_rad?;
    let candidates = [
        (Signal::LinkPositionRad, 1.0),
        (Signal::MotorPositionRad, of_robot.gear_ratio),
        (Signal::ReferencePositionRad, 1.0),
    ];
    let (signal, [from, to]) = candidates.into_iter().find_map(|(signal, side)| {
        Some((
            signal,
            joint_side_range(joint, signal, side * seen.factor(signal))?,
        ))
    })?;
    let within =
        |unit: f64| from / unit >= low - OVERSHOOT_RAD && to / unit <= high + OVERSHOOT_RAD;
    if within(1.0) {
        return None;
    }
    let beyond = format!(
        "goes from {from:.4} to {to:.4} rad, the robot file's limits are {low:.4} and {high:.4}"
    );
    let farthest = if from.abs() > to.abs() { from } else { to };
    // In degrees a usual motion goes far beyond any limit; an offset does not.
    let in_degrees = within(DEGREES) && to - from > 2.0 * (high - low).min(2.0 * PI);
    let finding = if in_degrees {
        let what = format!("{beyond}: these are degrees");
        let remedy = format!(
            "multiply the scale of this joint's angles by {:.7}",
            1.0 / DEGREES
        );
        Finding::error(FindingKind::WrongUnit, what).remedy(mapping_line(joint, signal, &remedy))
    } else {
        let fits = robot.joints.iter().filter(|other| {
            other.name != of_robot.name
                && other
                    .position_limit_rad
                    .is_some_and(|[low, high]| low <= from && to <= high)
        });
        let fits: Vec<String> = fits.map(|other| other.name.clone()).collect();
        let remedy = match fits.is_empty() {
            true => "check its offset, unit and sign".to_owned(),
            false => format!(
                "check its offset, unit and sign; it would fit {}",
                list(&fits)
            ),
        };
        Finding::warning(FindingKind::BeyondLimit, beyond)
            .remedy(mapping_line(joint, signal, &remedy))
    };
    Some(finding.at(joint).of(signal).decided_by(farthest))
}

/// What tells how fast a joint goes, the joint side first.
pub(super) const VELOCITIES: [Signal; 3] = [
    Signal::LinkVelocityRadS,
    Signal::MotorVelocityRadS,
    Signal::ReferenceVelocityRadS,
];

/// Tells once that joints go beyond a velocity limit which is the same for every joint: more often than not it was never set.
pub(super) fn one_velocity_limit(robot: &CheckRobot, findings: &mut Vec<Finding>) {
    let first = robot.joints.first().map(|joint| joint.velocity_limit_rad_s);
    let is_first = |joint: &CheckJoint| Some(joint.velocity_limit_rad_s) == first;
    let Some(limit) = first
        .flatten()
        .filter(|_| robot.joints.iter().all(is_first))
    else {
        return;
    };
    let is_beyond = |finding: &Finding| {
        finding.kind == FindingKind::BeyondLimit
            && finding.signal.is_some_and(|of| VELOCITIES.contains(&of))
    };
    let beyond = || findings.iter().filter(|finding| is_beyond(finding));
    let joints: Vec<String> = beyond().filter_map(|found| found.joint.clone()).collect();
    if joints.len() < 2 {
        return;
    }
    let largest = beyond().filter_map(|found| found.value);
    let largest = largest.fold(0.0, f64::max);
    findings.retain(|finding| !is_beyond(finding));
    let what = format!(
        "up to {largest:.4} rad/s at {} joints ({}), the limit of every joint in the robot file is {limit:.4}",
        joints.len(),
        list(&joints)
    );
    let finding = Finding::warning(FindingKind::BeyondLimit, what).decided_by(largest);
    findings.push(finding.remedy(
        "correct the limits in the robot file if they were never set; else check the velocities' unit and side of the gear",
    ));
}

fn velocities(of_robot: &CheckJoint, joint: &JointColumns, seen: &Scales) -> Option<Finding> {
    let limit = of_robot.velocity_limit_rad_s?;
    let candidates = VELOCITIES.map(|signal| match signal {
        Signal::MotorVelocityRadS => (signal, of_robot.gear_ratio),
        _ => (signal, 1.0),
    });
    let (signal, [from, to]) = candidates.into_iter().find_map(|(signal, side)| {
        Some((
            signal,
            joint_side_range(joint, signal, side * seen.factor(signal))?,
        ))
    })?;
    let largest = from.abs().max(to.abs());
    (largest > PEAK * limit).then(|| {
        let what =
            format!("up to {largest:.4} rad/s at the joint, the robot file's limit is {limit:.4}");
        Finding::warning(FindingKind::BeyondLimit, what)
            .at(joint)
            .of(signal)
            .decided_by(largest)
            .remedy(mapping_line(
                joint,
                signal,
                "check its unit and its side of the gear",
            ))
    })
}

fn torque(of_robot: &CheckJoint, joint: &JointColumns, signal: Signal) -> Option<Finding> {
    let limit_nm = of_robot.torque_limit_nm?;
    let [low, high] = range(values(joint, signal)?)?;
    let largest = low.abs().max(high.abs());
    if largest <= PEAK * limit_nm {
        return None;
    }
    let mut remedies = Vec::new();
    let constant = of_robot.torque_constant_nm_a;
    if let Some(constant_nm_a) = constant.filter(|constant| largest * constant <= PEAK * limit_nm) {
        remedies.push(format!("{constant_nm_a} if it is the current"));
    }
    if largest / of_robot.gear_ratio.abs() <= PEAK * limit_nm {
        remedies.push(format!(
            "1/{} if it is at the joint side",
            of_robot.gear_ratio
        ));
    }
    let remedy = match remedies.is_empty() {
        true => "check its scale, or torque_limit_nm in the robot file".to_owned(),
        false => format!("multiply its scale by {}", remedies.join(", or by ")),
    };
    let what =
        format!("up to {largest:.4} Nm, the robot file's limit is {limit_nm:.4} Nm at the motor");
    let finding = match largest > 2.0 * limit_nm {
        true => Finding::error(FindingKind::BeyondLimit, what),
        false => Finding::warning(FindingKind::BeyondLimit, what),
    };
    let finding = finding.at(joint).of(signal).decided_by(largest);
    Some(finding.remedy(mapping_line(joint, signal, &remedy)))
}

/// A step off by more than this is of another encoder.
const OTHER_STEP: f64 = 0.2;

/// Whether an encoder's step is the robot file's: then its position is in its unit, whatever else is wrong.
pub(super) fn has_its_step(of_robot: &CheckJoint, joint: &JointColumns, signal: Signal) -> bool {
    let told = told_resolutions(of_robot).into_iter();
    let of_signal = told.filter(|(of, _)| *of == signal);
    let resolution_rad = of_signal.filter_map(|(_, told)| told).next();
    let step = values(joint, signal).and_then(step);
    step.zip(resolution_rad)
        .is_some_and(|(step, told)| (step / told - 1.0).abs() < OTHER_STEP)
}

fn told_resolutions(of_robot: &CheckJoint) -> [(Signal, Option<f64>); 2] {
    [
        (
            Signal::MotorPositionRad,
            of_robot.motor_encoder_resolution_rad,
        ),
        (
            Signal::LinkPositionRad,
            of_robot.link_encoder_resolution_rad,
        ),
    ]
}

/// Encoder steps tell units and sides where nothing else does.
fn resolutions(of_robot: &CheckJoint, joint: &JointColumns, seen: &Scales) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (signal, resolution) in told_resolutions(of_robot) {
        let (Some(resolution), Some(step)) = (resolution, values(joint, signal).and_then(step))
        else {
            continue;
        };
        let factor = step / seen.factor(signal).abs() / resolution;
        if (factor - 1.0).abs() < OTHER_STEP {
            continue;
        }
        let Meaning { kind, text, factor } =
            Meaning::of(factor, Some(of_robot.gear_ratio), MEASURED);
        let what =
            format!("its step is {step:.4e}, the robot file's resolution {resolution:.4e} rad");
        let finding = if kind == FindingKind::WrongScale || factor < 1.0 {
            Finding::note(FindingKind::OtherResolution, what)
                .remedy("correct the resolution in the robot file if the encoder is another one")
        } else {
            let remedy = format!("multiply its scale by {:.6}", 1.0 / factor);
            Finding::warning(kind, format!("{what}: {text}"))
                .remedy(mapping_line(joint, signal, &remedy))
        };
        findings.push(finding.at(joint).of(signal).decided_by(step));
    }
    findings
}
