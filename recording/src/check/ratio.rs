//! The gear ratio that both encoders show, against the robot file's.

use std::ops::Range;

use nalgebra::SVector;

use super::scale::{STRAIGHT, Scales, blocks};
use super::{CheckJoint, Finding, FindingKind, Severity, mapping_line, values};
use crate::statistics::{first_coefficient, line};
use crate::{JointColumns, Recording, Signal};

/// The gear ratio from both encoders against the robot file's.
pub(super) fn check(
    recording: &Recording,
    joint: &JointColumns,
    robot: Option<&CheckJoint>,
    seen: &Scales,
) -> Option<Finding> {
    /// An encoder's eccentricity and the windup of a gear of unknown stiffness change the ratio by less.
    const RATIO_OFF: f64 = 0.01;
    /// So many times softer than its file says a gear may be.
    const SOFTER: f64 = 3.0;
    let measured = seen.measured_ratio?;
    let Some(robot) = robot else {
        let reversed = (measured < 0.0).then(|| {
            let what = format!("turns against link_position_rad, {measured:.4} times as far");
            let remedy = "multiply its scale by -1: positive is the same direction on both sides of the gear";
            Finding::error(FindingKind::ReversedSign, what)
                .decided_by(measured)
                .remedy(mapping_line(joint, Signal::MotorPositionRad, remedy))
        });
        return reversed.map(|finding| finding.at(joint).of(Signal::MotorPositionRad));
    };
    let off = measured / robot.gear_ratio - 1.0;
    let windup = SOFTER * windup(joint, robot);
    let beyond = off - off.clamp(windup.min(0.0), windup.max(0.0));
    let is_straight = seen.ratio_scatter < STRAIGHT * off.abs();
    if beyond.abs() > RATIO_OFF && is_straight {
        return Some(wrong(joint, measured, seen));
    }
    // what windup may do of it leaves most of a turn
    let is_beyond_windup = beyond.abs() * robot.gear_ratio.abs() > 0.5;
    off_by_one(recording, joint, robot)
        .filter(|found| found.is_sure || is_beyond_windup)
        .map(|found| one_turn(joint, found, seen))
}

/// One turn more or less than the robot file tells.
struct OffByOne {
    /// As the encoders show it.
    turns: f64,
    /// Whether nothing else is like it over the way that the joint goes.
    is_sure: bool,
}

fn one_turn(joint: &JointColumns, of: OffByOne, seen: &Scales) -> Finding {
    let held = "a harmonic drive of this many teeth turns once more or less, depending on which of its parts is held";
    let finding = wrong(joint, of.turns, seen);
    if of.is_sure {
        let what = format!("{}: {held}", finding.what);
        return Finding { what, ..finding };
    }
    let off_centre_mrad = 1e3 / seen.gear_ratio.unwrap_or(1.0).abs();
    let what = format!(
        "{}: {held}; an encoder {off_centre_mrad:.1} mrad off its centre would look the same over so short a way",
        finding.what
    );
    Finding {
        what,
        severity: Severity::Warning,
        remedy: "make sure of gear_ratio in the robot file".to_owned(),
        ..finding
    }
}

/// Whether both encoders show one turn more or one less than the robot file tells.
///
/// What else tilts the line between them is taken off: windup of the file's stiffness under the torque, less what friction and the
/// rotor take of it (by direction, velocity, acceleration), and lost motion by the direction. An encoder that is off its centre
/// tilts it too, and bends it: over a short way that leaves the ratio unsure.
fn off_by_one(recording: &Recording, joint: &JointColumns, robot: &CheckJoint) -> Option<OffByOne> {
    /// Standard errors. Neighbouring blocks are not independent, so far above the usual.
    const CERTAIN: f64 = 8.0;
    /// Turns by which the ratio may be off one more or one less, and by which it may where an encoder's centre is fitted beside.
    const NEAR: f64 = 0.25;
    const NEAR_BESIDE_CENTRE: f64 = 0.1;
    let [motor_rad, link_rad] =
        [Signal::MotorPositionRad, Signal::LinkPositionRad].map(|signal| values(joint, signal));
    let (motor_rad, link_rad) = (motor_rad?, link_rad?);
    let torque_nm = torque(joint)?;
    let told = robot.gear_ratio;
    let windup_rad_nm = told / robot.stiffness_nm_rad.filter(|of| *of > 0.0)?;
    let mean = |values: &[f64], rows: Range<usize>| {
        let count = rows.len() as f64;
        values[rows].iter().sum::<f64>() / count
    };
    let blocks = blocks(recording);
    let neighbours = blocks
        .windows(2)
        .filter(|pair| pair[0].end == pair[1].start + 1);
    let rows: Vec<(SVector<f64, 7>, f64)> = neighbours
        .filter_map(|pair| {
            let [before, after] = [0, 1].map(|k| &pair[k]);
            let both = || before.start..after.end;
            let moved_rad =
                [before, after].map(|rows| link_rad[rows.end - 1] - link_rad[rows.start]);
            let angle_rad = mean(link_rad, both());
            let (sin, cos) = angle_rad.sin_cos();
            let way_rad = moved_rad[0] + moved_rad[1];
            let row = [
                angle_rad,
                1.0,
                way_rad.signum(),
                way_rad,
                moved_rad[1] - moved_rad[0],
                sin,
                cos,
            ];
            let twist_rad = mean(motor_rad, both()) / told
                - angle_rad
                - windup_rad_nm * mean(torque_nm, both());
            let is_there = twist_rad.is_finite() && row.iter().all(|x| x.is_finite());
            is_there.then_some((SVector::from(row), twist_rad))
        })
        .collect();
    let is_one = |(off, error): (f64, f64), near: f64| {
        ((told * off).abs() - 1.0).abs() < near && off.abs() > CERTAIN * error
    };
    let with_centred: Vec<(SVector<f64, 5>, f64)> = rows
        .iter()
        .map(|(row, twist_rad)| (row.fixed_rows::<5>(0).into_owned(), *twist_rad))
        .collect();
    let found = first_coefficient(&with_centred).filter(|found| is_one(*found, NEAR))?;
    let beside_centre = first_coefficient(&rows);
    Some(OffByOne {
        turns: told * (1.0 + found.0),
        is_sure: beside_centre.is_some_and(|found| is_one(found, NEAR_BESIDE_CENTRE)),
    })
}

/// The motor's, or the command's where the drive reports none.
fn torque(joint: &JointColumns) -> Option<&[f64]> {
    let torques = [Signal::MotorTorqueNm, Signal::CommandTorqueNm];
    torques.iter().find_map(|signal| values(joint, *signal))
}

/// By how much the torque winds a gear up per angle of its joint (least squares): it turns the motor on, as another ratio would.
fn windup(joint: &JointColumns, robot: &CheckJoint) -> f64 {
    let load = values(joint, Signal::LinkPositionRad)
        .zip(torque(joint))
        .and_then(|(link_rad, torque_nm)| line(link_rad, torque_nm));
    load.zip(robot.stiffness_nm_rad)
        .filter(|(_, stiffness_nm_rad)| *stiffness_nm_rad > 0.0)
        .map_or(0.0, |(load, stiffness_nm_rad)| {
            load.slope * load.correlation.abs() * robot.gear_ratio / stiffness_nm_rad
        })
}

/// The ratio that was measured, against the one that is told.
pub(super) fn wrong(joint: &JointColumns, measured: f64, seen: &Scales) -> Finding {
    let told = seen.gear_ratio.unwrap_or(1.0);
    let what = format!(
        "the motor turns {measured:.4} times per joint turn, the gear_ratio told is {told:.4}"
    );
    Finding::error(FindingKind::WrongGearRatio, what)
        .at(joint)
        .of(Signal::MotorPositionRad)
        .decided_by(measured)
        .remedy("correct gear_ratio in the robot file, or the scale of one encoder in the mapping file; if the ratio is another joint's, the joints are swapped")
}
