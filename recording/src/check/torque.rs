//! Torques: a current in their place, the other side of the gear, the wrong sign.

use super::meaning::{MEASURED, Meaning, TRACKED};
use super::scale::{SAME, Scales, Wrong, blocks, slope};
use super::{CheckJoint, Finding, FindingKind, mapping_line, values};
use crate::statistics::{first_coefficient, unexplained};
use crate::{JointColumns, Recording, Signal};
use nalgebra::SVector;
use std::ops::Range;

/// The measured torque against the commanded one, else its sign against the motion; then the joint's torque sensor.
pub(super) fn wrong(
    recording: &Recording,
    joint: &JointColumns,
    robot: Option<&CheckJoint>,
    seen: &Scales,
) -> Vec<Wrong> {
    let motor = against_command(recording, joint, robot, seen)
        .or_else(|| reversed_torque(recording, joint, seen));
    let motor_sign = motor
        .as_ref()
        .filter(|wrong| wrong.signal == Signal::MotorTorqueNm)
        .map_or(1.0, |wrong| wrong.measured.signum());
    let sensor = reversed_sensor(recording, joint, seen, motor_sign);
    motor.into_iter().chain(sensor).collect()
}

/// The drive's torque where it is in another unit than the command; the command, where no unit tells why they differ or the motion
/// contradicts it: what a drive measured is nearer to the joint than what it was asked for.
fn against_command(
    recording: &Recording,
    joint: &JointColumns,
    robot: Option<&CheckJoint>,
    seen: &Scales,
) -> Option<Wrong> {
    /// A drive's torque may be off by this much without being something else.
    const HONEST: Range<f64> = 0.5..2.0;
    const SIMILAR: f64 = 0.9;
    let command = values(joint, Signal::CommandTorqueNm)?;
    let measured = slope(command, values(joint, Signal::MotorTorqueNm)?, SIMILAR)?;
    let told = Wrong {
        signal: Signal::MotorTorqueNm,
        against: Signal::CommandTorqueNm,
        measured,
        meaning: Meaning::of_torque(measured, seen.gear_ratio, TRACKED),
    };
    let is_reversed = |signal| reversed_by_motion(recording, joint, seen, signal).is_some();
    let constant_nm_a = robot.and_then(|robot| robot.torque_constant_nm_a);
    let is_current = constant_nm_a.is_some_and(|constant| is_near(measured * constant, 1.0));
    let of_command = told.meaning.kind == FindingKind::WrongScale && !is_current
        || told.meaning.kind == FindingKind::ReversedSign
            && is_reversed(Signal::CommandTorqueNm)
            && !is_reversed(Signal::MotorTorqueNm);
    let told = if of_command {
        Wrong {
            signal: Signal::CommandTorqueNm,
            against: Signal::MotorTorqueNm,
            measured: 1.0 / measured,
            meaning: Meaning::of_torque(1.0 / measured, seen.gear_ratio, TRACKED),
        }
    } else {
        told
    };
    (!HONEST.contains(&measured)).then_some(told)
}

/// A torque sensor that goes against the motor's torque, and does so beside friction too: where friction is most of the motor's torque,
/// the two may well go against each other. Reversed is whichever makes friction take power: the gear takes what the motor gives and the
/// sensor does not pass on.
fn reversed_sensor(
    recording: &Recording,
    joint: &JointColumns,
    seen: &Scales,
    motor_sign: f64,
) -> Option<Wrong> {
    /// Friction and the rotor's inertia lie between the two sides of the gear.
    const RELATED: f64 = 0.5;
    let motor = values(joint, Signal::MotorTorqueNm)?;
    let sensor = values(joint, Signal::JointTorqueNm)?;
    let factor = slope(motor, sensor, RELATED)?;
    if factor * motor_sign >= 0.0 {
        return None;
    }
    let Some((_, stretches)) = moving(recording, joint, seen) else {
        // without a position nothing is known of friction
        return Some(reversed(Signal::JointTorqueNm, Signal::MotorTorqueNm));
    };
    let rows = stretches.iter().map(|at| {
        let row = [
            mean(sensor, at),
            at.speed,
            at.change,
            1.0,
            at.speed.signum(),
        ];
        (SVector::from(row), mean(motor, at))
    });
    let is_finite = |(row, motor): &(SVector<f64, 5>, f64)| {
        motor.is_finite() && row.iter().all(|x| x.is_finite())
    };
    let rows: Vec<_> = rows.filter(is_finite).collect();
    let forth = rows.iter().filter(|(row, _)| row[4] > 0.0).count();
    let (part, error) = if forth == 0 || forth == rows.len() {
        // in one direction friction is like a zero that is off
        let rows = rows.iter();
        let rows = rows.map(|(row, motor)| (row.fixed_rows::<4>(0).into_owned(), *motor));
        first_coefficient::<4>(&rows.collect::<Vec<_>>())?
    } else {
        first_coefficient::<5>(&rows)?
    };
    if part * motor_sign >= -CERTAIN * error {
        return None;
    }
    // if it is the sensor that is reversed
    let taken = stretches
        .iter()
        .map(|at| motor_sign * (mean(motor, at) - part * mean(sensor, at)) * at.speed);
    let taken: f64 = taken.filter(|power| power.is_finite()).sum();
    Some(if taken < 0.0 && motor_sign > 0.0 {
        reversed(Signal::MotorTorqueNm, Signal::JointTorqueNm)
    } else {
        reversed(Signal::JointTorqueNm, Signal::MotorTorqueNm)
    })
}

/// Standard errors. Neighbouring blocks are not independent, so far above the usual.
const CERTAIN: f64 = 8.0;

/// Rows in which a joint moves on in one direction.
struct Stretch {
    rows: Range<usize>,
    /// Joint angle in the middle.
    angle_rad: f64,
    /// Of the signal, with the joint's sign.
    speed: f64,
    /// Of the speed.
    change: f64,
}

fn mean(values: &[f64], at: &Stretch) -> f64 {
    values[at.rows.clone()].iter().sum::<f64>() / at.rows.len() as f64
}

/// Where a joint moves on, by the signal that says so.
fn moving(
    recording: &Recording,
    joint: &JointColumns,
    seen: &Scales,
) -> Option<(Signal, Vec<Stretch>)> {
    let (signal, position) = super::measured_position(joint)?;
    let sign = (seen.factor(signal) * seen.gear_ratio.unwrap_or(1.0)).signum();
    let joint_side = match signal {
        Signal::MotorPositionRad => seen.factor(signal) * seen.gear_ratio?,
        _ => seen.factor(signal),
    };
    let velocity = |rows: &Range<usize>| {
        let elapsed_s = recording.time_s[rows.end - 1] - recording.time_s[rows.start];
        sign * (position[rows.end - 1] - position[rows.start]) / elapsed_s
    };
    let blocks = blocks(recording);
    let neighbours = blocks
        .windows(2)
        .filter(|pair| pair[0].end == pair[1].start + 1);
    let stretches = neighbours.filter_map(|pair| {
        let (before, after) = (velocity(&pair[0]), velocity(&pair[1]));
        (before * after > 0.0).then(|| Stretch {
            rows: pair[0].start..pair[1].end,
            angle_rad: position[pair[0].end - 1] / joint_side,
            speed: 0.5 * (before + after),
            change: after - before,
        })
    });
    Some((signal, stretches.collect()))
}

/// A torque whose friction drives the joint and whose work over the whole recording is negative: its sign, or that of
/// the position, is reversed.
fn reversed_torque(recording: &Recording, joint: &JointColumns, seen: &Scales) -> Option<Wrong> {
    let signal = [Signal::MotorTorqueNm, Signal::CommandTorqueNm]
        .into_iter()
        .find(|signal| values(joint, *signal).is_some())?;
    reversed_by_motion(recording, joint, seen, signal)
}

fn reversed_by_motion(
    recording: &Recording,
    joint: &JointColumns,
    seen: &Scales,
    torque_signal: Signal,
) -> Option<Wrong> {
    const BLOCKS_MIN: usize = 50;
    /// Part of the torque that may come from elsewhere, as from the motion of an arm's other joints, which may go with this joint's
    /// direction by chance; a large robot's axes leave 0.12 at most.
    const UNEXPLAINED: f64 = 0.5;
    let torque = values(joint, torque_signal)?;
    let (position_signal, stretches) = moving(recording, joint, seen)?;
    let mut rows = Vec::new();
    let mut work_nm_rad = 0.0;
    for at in &stretches {
        let mean_torque = mean(torque, at);
        let row = [
            at.speed.signum(),
            at.speed,
            at.change,
            1.0,
            at.angle_rad.sin(),
            at.angle_rad.cos(),
        ];
        if mean_torque.is_finite() && row.iter().all(|x| x.is_finite()) {
            work_nm_rad += mean_torque * at.speed;
            rows.push((SVector::from(row), mean_torque));
        }
    }
    let (friction_nm, error_nm) = first_coefficient::<6>(&rows)?;
    let is_reversed =
        rows.len() >= BLOCKS_MIN && work_nm_rad < 0.0 && friction_nm < -CERTAIN * error_nm;
    let is_understood = unexplained(&rows)? < UNEXPLAINED;
    (is_reversed && is_understood).then(|| reversed(torque_signal, position_signal))
}

fn reversed(signal: Signal, against: Signal) -> Wrong {
    Wrong {
        signal,
        against,
        measured: -1.0,
        meaning: Meaning::of_torque(-1.0, None, MEASURED),
    }
}

/// What is wrong with a torque in other words than a factor's, if there are better ones.
pub(super) fn explain(
    joint: &JointColumns,
    robot: Option<&CheckJoint>,
    wrong: &Wrong,
) -> Option<Finding> {
    let Wrong {
        signal,
        against,
        measured,
        ..
    } = wrong;
    let constant_nm_a = robot.and_then(|robot| robot.torque_constant_nm_a);
    if let (Some(constant_nm_a), Signal::CommandTorqueNm) = (constant_nm_a, against)
        && is_near(measured * constant_nm_a, 1.0)
    {
        return Some(current(joint, constant_nm_a, *measured));
    }
    let told_by_motion = matches!(against, Signal::MotorPositionRad | Signal::LinkPositionRad);
    let is_torque = matches!(signal, Signal::MotorTorqueNm | Signal::CommandTorqueNm);
    (told_by_motion && is_torque).then(|| {
        let what = format!("reversed: friction would drive the joint and the work done is negative, against {against}");
        Finding::error(FindingKind::ReversedSign, what)
            .at(joint)
            .of(*signal)
            .decided_by(*measured)
            .remedy(mapping_line(joint, *signal, "multiply its scale by -1"))
    })
}

fn is_near(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < TRACKED
}

/// A motor torque that is the motor's current, seen where both are recorded.
pub(super) fn current_as_torque(
    joint: &JointColumns,
    robot: Option<&CheckJoint>,
) -> Option<Finding> {
    let constant_nm_a = robot?.torque_constant_nm_a?;
    let torque = values(joint, Signal::MotorTorqueNm)?;
    let current_a = values(joint, Signal::MotorCurrentA)?;
    let seen_nm_a = slope(current_a, torque, SAME)?;
    let is_current = is_near(seen_nm_a, 1.0) && !is_near(constant_nm_a, 1.0);
    is_current.then(|| current(joint, constant_nm_a, seen_nm_a))
}

fn current(joint: &JointColumns, constant_nm_a: f64, factor: f64) -> Finding {
    let what = "holds the motor's current, not its torque".to_owned();
    let remedy =
        format!("multiply its scale by {constant_nm_a}, the robot file's torque_constant_nm_a");
    Finding::error(FindingKind::CurrentAsTorque, what)
        .at(joint)
        .of(Signal::MotorTorqueNm)
        .decided_by(factor)
        .remedy(mapping_line(joint, Signal::MotorTorqueNm, &remedy))
}
