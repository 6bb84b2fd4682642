//! Against the robot file: names, limits, resolutions.

use super::meaning::{DEGREES, MEASURED, Meaning};
use super::motion::STILL_RAD;
use super::scale::Scales;
use super::{CheckJoint, CheckRobot, Finding, FindingKind, Severity, mapping_line, values};
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
            // a robot file may be of one arm of several; a name that is nearly a missing joint's is most likely misspelt
            let missing = || {
                of_robot
                    .iter()
                    .filter(|name| recording.joint(name).is_err())
            };
            let near = nearest(&joint.name, missing().map(String::as_str));
            let finding = if near.is_some() || missing().count() == of_robot.len() {
                let perhaps =
                    near.map_or_else(String::new, |near| format!(", perhaps [joint.{near}]"));
                Finding::error(FindingKind::UnknownJoint, what).remedy(format!(
                    "rename [joint.{}] in the mapping file{perhaps}",
                    joint.name
                ))
            } else {
                Finding::warning(FindingKind::UnknownJoint, what).remedy(format!(
                    "it is not looked at; if it is one of those, rename [joint.{}] in the mapping file",
                    joint.name
                ))
            };
            findings.push(finding.at(joint));
        }
    }
    for name in of_robot {
        if recording.joint(&name).is_err() {
            let what = format!(
                "robot `{}` has this joint, the recording does not",
                robot.name
            );
            let finding = Finding::warning(FindingKind::MissingJoint, what);
            let finding = finding.remedy("if it was recorded, map its columns under [joint.NAME]");
            findings.push(Finding {
                joint: Some(name),
                ..finding
            });
        }
    }
    findings
}

/// One joint's values against the robot file's numbers. `are_in_degrees`: as [`are_in_degrees`] says.
pub(super) fn check_joint(
    robot: &CheckRobot,
    of_robot: &CheckJoint,
    joint: &JointColumns,
    seen: &Scales,
    are_in_degrees: bool,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    findings.extend(positions(robot, of_robot, joint, seen, are_in_degrees));
    findings.extend(velocities(of_robot, joint, seen));
    for signal in TORQUES {
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

/// From where to where a joint goes, and may go by the robot file.
struct Reach {
    signal: Signal,
    went: [f64; 2],
    limits_rad: [f64; 2],
}

impl Reach {
    /// None where nothing tells one of the two.
    fn of(of_robot: &CheckJoint, joint: &JointColumns, seen: &Scales) -> Option<Self> {
        let limits_rad = of_robot.position_limit_rad?;
        let candidates = [
            (Signal::LinkPositionRad, 1.0),
            (Signal::MotorPositionRad, of_robot.gear_ratio),
            (Signal::ReferencePositionRad, 1.0),
        ];
        candidates.into_iter().find_map(|(signal, side)| {
            Some(Self {
                signal,
                went: joint_side_range(joint, signal, side * seen.factor(signal))?,
                limits_rad,
            })
        })
    }

    /// Whether it stays within the limits, in a unit of so many a radian.
    fn is_within(&self, unit: f64) -> bool {
        let ([from, to], [low, high]) = (self.went, self.limits_rad);
        from / unit >= low - OVERSHOOT_RAD && to / unit <= high + OVERSHOOT_RAD
    }

    fn width(&self) -> f64 {
        self.went[1] - self.went[0]
    }

    /// In degrees a usual motion goes far beyond any limit; an offset does not.
    fn is_in_degrees(&self) -> bool {
        let [low, high] = self.limits_rad;
        let is_far = self.width() > 2.0 * (high - low).min(2.0 * PI);
        !self.is_within(1.0) && self.is_within(DEGREES) && is_far
    }
}

/// Whether the limits tell that angles are in degrees: one joint that turns beyond its own may do so, most joints do not.
pub(super) fn are_in_degrees(robot: &CheckRobot, recording: &Recording, seen: &[Scales]) -> bool {
    let each = recording.joints.iter().zip(seen);
    let reaches =
        each.filter_map(|(joint, seen)| Reach::of(robot.joint(&joint.name)?, joint, seen));
    let moving: Vec<Reach> = reaches.filter(|reach| reach.width() > STILL_RAD).collect();
    let in_degrees = moving.iter().filter(|reach| reach.is_in_degrees()).count();
    let in_radians = moving.iter().filter(|reach| reach.is_within(1.0)).count();
    in_degrees > in_radians
}

fn positions(
    robot: &CheckRobot,
    of_robot: &CheckJoint,
    joint: &JointColumns,
    seen: &Scales,
    are_in_degrees: bool,
) -> Option<Finding> {
    let reach = Reach::of(of_robot, joint, seen)?;
    if reach.is_within(1.0) {
        return None;
    }
    let (signal, [from, to], [low, high]) = (reach.signal, reach.went, reach.limits_rad);
    let beyond = format!(
        "goes from {from:.4} to {to:.4} rad, the robot file's limits are {low:.4} and {high:.4}"
    );
    let farthest = if from.abs() > to.abs() { from } else { to };
    let finding = if are_in_degrees && reach.is_in_degrees() {
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
/// What a drive's torque limit is of; behind the gear it is the gear ratio times as much.
const TORQUES: [Signal; 3] = [
    Signal::MotorTorqueNm,
    Signal::CommandTorqueNm,
    Signal::JointTorqueNm,
];

/// A number of the robot file that every joint may have the same of.
struct Limit {
    of: fn(&CheckJoint) -> Option<f64>,
    signals: &'static [Signal],
    unit: &'static str,
    /// Of the values, if not the limit is wrong.
    else_check: &'static str,
}

const LIMITS: [Limit; 2] = [
    Limit {
        of: |joint| joint.velocity_limit_rad_s,
        signals: &VELOCITIES,
        unit: "rad/s",
        else_check: "the velocities' unit and side of the gear",
    },
    Limit {
        of: |joint| joint.torque_limit_nm,
        signals: &TORQUES,
        unit: "Nm",
        else_check: "the torques' scale and side of the gear",
    },
];

/// Tells once that joints go beyond a limit which is the same for every joint: more often than not it was never set.
pub(super) fn one_limit(robot: &CheckRobot, findings: &mut Vec<Finding>) {
    for limit in &LIMITS {
        let first = robot.joints.first().and_then(limit.of);
        let is_first = |joint: &CheckJoint| (limit.of)(joint) == first;
        let Some(most) = first.filter(|_| robot.joints.iter().all(is_first)) else {
            continue;
        };
        let is_beyond = |finding: &Finding| {
            finding.kind == FindingKind::BeyondLimit
                && finding.severity == Severity::Warning
                && finding.signal.is_some_and(|of| limit.signals.contains(&of))
        };
        let beyond = || findings.iter().filter(|finding| is_beyond(finding));
        let mut joints: Vec<String> = beyond().filter_map(|found| found.joint.clone()).collect();
        joints.dedup();
        if joints.len() < 2 {
            continue;
        }
        let largest = beyond().filter_map(|found| found.value);
        let largest = largest.fold(0.0, f64::max);
        findings.retain(|finding| !is_beyond(finding));
        let unit = limit.unit;
        let what = format!(
            "up to {largest:.4} {unit} at {} joints ({}), the limit of every joint in the robot file is {most:.4}",
            joints.len(),
            list(&joints)
        );
        let finding = Finding::warning(FindingKind::BeyondLimit, what).decided_by(largest);
        findings.push(finding.remedy(format!(
            "correct the limits in the robot file if they were never set; else check {}",
            limit.else_check
        )));
    }
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
    let ratio = of_robot.gear_ratio.abs();
    let (side, limit_nm) = match signal {
        Signal::JointTorqueNm => ("joint", ratio * of_robot.torque_limit_nm?),
        _ => ("motor", of_robot.torque_limit_nm?),
    };
    let [low, high] = range(values(joint, signal)?)?;
    let largest = low.abs().max(high.abs());
    if largest <= PEAK * limit_nm {
        return None;
    }
    let mut remedies = Vec::new();
    let is_of_motor = side == "motor";
    let constant = of_robot.torque_constant_nm_a.filter(|_| is_of_motor);
    if let Some(constant_nm_a) = constant.filter(|constant| largest * constant <= PEAK * limit_nm) {
        remedies.push(format!("{constant_nm_a} if it is the current"));
    }
    if is_of_motor && largest / ratio <= PEAK * limit_nm {
        remedies.push(format!(
            "1/{} if it is at the joint side",
            of_robot.gear_ratio
        ));
    }
    let what =
        format!("up to {largest:.4} Nm, the robot file's limit is {limit_nm:.4} Nm at the {side}");
    // a limit that no unit keeps is as likely wrong itself: exporters of robot files put a one there
    let (finding, remedy) = if remedies.is_empty() {
        let remedy = "check its scale, or torque_limit_nm in the robot file".to_owned();
        (Finding::warning(FindingKind::BeyondLimit, what), remedy)
    } else {
        let finding = match largest > 2.0 * limit_nm {
            true => Finding::error(FindingKind::BeyondLimit, what),
            false => Finding::warning(FindingKind::BeyondLimit, what),
        };
        (
            finding,
            format!("multiply its scale by {}", remedies.join(", or by ")),
        )
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
