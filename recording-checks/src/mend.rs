//! What was found in the samples is taken out before anything is fitted: rows that were not measured anew are no
//! measurement, an encoder's steps are those it has, and a command that the drive left out is the one that it acted on
//! instead. A torque that was not measured anew is known from its command: a controller that saw the joint stand still and
//! then leap kicks it, and those kicks lie in and beside the lost rows. What the file itself tells of the whole arm is put
//! into its links.

use std::ops::Range;

use recording::grid::{in_runs, runs};
use recording::{JointColumns, Recording, Signal};
use robot::{Effect, EncoderSide, Robot};

use crate::follow::weights_of_commands;
use crate::found::Found;
use crate::lost::acted_on;
use crate::timing::Timing;

/// Signals that a lost sample repeats.
const MEASURED: [Signal; 4] = [
    Signal::MotorPositionRad,
    Signal::LinkPositionRad,
    Signal::MotorTorqueNm,
    Signal::JointTorqueNm,
];

/// Recordings in which rows that repeat the row before hold no value, of the joints where such were found, and a torque that
/// was read early stands where the command's delay would have it.
pub fn recordings(
    tables: &[&Recording],
    robot: &Robot,
    found: &[Vec<Found>],
    timing: &Timing,
) -> Option<Vec<Recording>> {
    let with = |is_such: fn(&Effect) -> bool| -> Vec<&str> {
        let joints = robot.joints.iter().zip(found);
        let such = joints.filter(|(_, found)| found.iter().any(|found| is_such(&found.effect)));
        such.map(|(joint, _)| joint.name.as_str()).collect()
    };
    let lost = with(|effect| matches!(effect, Effect::DroppedSamples { .. }));
    let left_out = with(|effect| matches!(effect, Effect::DroppedCommands { .. }));
    let early: Vec<(&str, usize)> = robot
        .joints
        .iter()
        .zip(&timing.early_rows)
        .filter(|(_, rows)| **rows > 0)
        .map(|(joint, rows)| (joint.name.as_str(), *rows))
        .collect();
    if lost.is_empty() && left_out.is_empty() && early.is_empty() {
        return None;
    }
    let mended = tables.iter().map(|table| {
        let mut mended = (*table).clone();
        let runs = runs(table);
        let period_s = 1.0 / table.sample_rate_hz;
        for joint in &mut mended.joints {
            if lost.contains(&joint.name.as_str()) {
                blank_repeats(joint);
                torque_from_commands(joint, &runs, period_s);
            }
            if let Some((_, rows)) = early.iter().find(|(name, _)| *name == joint.name) {
                put_later(joint, &runs, *rows);
            }
            if left_out.contains(&joint.name.as_str()) {
                put_acted_on(joint, &runs, period_s, timing);
            }
        }
        mended
    });
    Some(mended.collect())
}

/// Puts what the drive acted on in the place of commands that it left out.
fn put_acted_on(joint: &mut JointColumns, runs: &[Range<usize>], period_s: f64, timing: &Timing) {
    let pieces = in_runs(joint, runs);
    let acted_on = acted_on(&pieces, period_s, timing.told_rows());
    let command_nm = joint.signals.get_mut(&Signal::CommandTorqueNm);
    let (Some(acted_on), Some(command_nm)) = (acted_on, command_nm) else {
        return;
    };
    for (run, acted_nm) in runs.iter().zip(acted_on) {
        command_nm[run.clone()].copy_from_slice(&acted_nm);
    }
}

/// Puts the torque so many rows later, in every run; what comes before it in a run was not measured.
fn put_later(joint: &mut JointColumns, runs: &[Range<usize>], rows: usize) {
    let Some(torque_nm) = joint.signals.get_mut(&Signal::MotorTorqueNm) else {
        return;
    };
    for run in runs {
        let torque_nm = &mut torque_nm[run.clone()];
        let rows = rows.min(torque_nm.len());
        torque_nm.rotate_right(rows);
        torque_nm[..rows].fill(f64::NAN);
    }
}

/// Leaves no measured value in rows that repeat the row before.
pub(crate) fn blank_repeats(joint: &mut JointColumns) {
    let measured: Vec<&Vec<f64>> = MEASURED
        .iter()
        .filter_map(|signal| joint.signals.get(signal))
        .filter(|values| values.iter().any(|value| value.is_finite()))
        .collect();
    let rows = measured.first().map_or(0, |values| values.len());
    let repeats: Vec<usize> = (1..rows)
        .filter(|&k| measured.iter().all(|values| values[k] == values[k - 1]))
        .collect();
    for signal in MEASURED {
        if let Some(values) = joint.signals.get_mut(&signal) {
            for &k in &repeats {
                values[k] = f64::NAN;
            }
        }
    }
}

/// Puts the drive's answer to its commands where the torque was not measured anew, with what the torque has beyond that
/// before and after.
fn torque_from_commands(joint: &mut JointColumns, runs: &[Range<usize>], period_s: f64) {
    let pieces = in_runs(joint, runs);
    let weights = weights_of_commands(&pieces, period_s);
    let command_nm = joint.signals.get(&Signal::CommandTorqueNm).cloned();
    let torque_nm = joint.signals.get_mut(&Signal::MotorTorqueNm);
    let (Some(weights), Some(command_nm), Some(torque_nm)) = (weights, command_nm, torque_nm)
    else {
        return;
    };
    let answer_nm = |k: usize| -> f64 {
        let past = command_nm[..=k].iter().rev();
        weights.iter().zip(past).map(|(w, u)| w * u).sum()
    };
    for run in runs {
        let mut before = None;
        for k in run.start + weights.len()..run.end {
            let beyond_nm = torque_nm[k] - answer_nm(k);
            if !beyond_nm.is_finite() {
                continue;
            }
            if let Some((from, from_nm)) = before {
                let rows = (k - from) as f64;
                for (lost, torque_nm) in torque_nm[..k].iter_mut().enumerate().skip(from + 1) {
                    let share = (lost - from) as f64 / rows;
                    *torque_nm = answer_nm(lost) + from_nm + share * (beyond_nm - from_nm);
                }
            }
            before = Some((k, beyond_nm));
        }
    }
}

/// The robot file with the encoder steps that were found, and with its own payload, tilt and added inertia in the chain.
pub fn robot(robot: &Robot, found: &[Vec<Found>]) -> Robot {
    let mut mended = robot.clone();
    if let Ok(chain) = robot.loaded_chain() {
        mended.chain = chain;
    }
    for (joint, found) in mended.joints.iter_mut().zip(found) {
        for found in found {
            let Effect::EncoderQuantisation {
                resolution_rad,
                side,
            } = found.effect
            else {
                continue;
            };
            match side {
                EncoderSide::Motor => joint.motor_encoder_resolution_rad = Some(resolution_rad),
                EncoderSide::Link => joint.link_encoder_resolution_rad = Some(resolution_rad),
            }
        }
    }
    mended
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_repeats_all_signals_holds_no_value() {
        let mut joint = JointColumns {
            name: "joint1".to_owned(),
            signals: [
                (Signal::MotorPositionRad, vec![0.0, 0.1, 0.1, 0.1, 0.2]),
                (Signal::MotorTorqueNm, vec![1.0, 1.1, 1.1, 1.2, 1.3]),
                (Signal::CommandTorqueNm, vec![1.0; 5]),
            ]
            .into(),
        };
        blank_repeats(&mut joint);
        let position_rad = &joint.signals[&Signal::MotorPositionRad];
        assert!(position_rad[2].is_nan());
        assert_eq!(position_rad[3], 0.1);
        assert_eq!(joint.signals[&Signal::CommandTorqueNm], [1.0; 5]);
    }

    #[test]
    fn a_lost_torque_is_the_drives_answer_to_its_commands() {
        let is_lost = |k: usize| k % 7 == 3 || k % 11 == 4;
        let command_nm: Vec<f64> = (0..2000)
            .map(|k| (0.01 * f64::from(k)).sin() + f64::from(k * 7919 % 101) / 101.0)
            .collect();
        let torque_nm = |k: usize| 0.3 + command_nm[k.saturating_sub(2)];
        let shown = (0..2000).map(|k| if is_lost(k) { f64::NAN } else { torque_nm(k) });
        let mut joint = JointColumns {
            name: "joint1".to_owned(),
            signals: [
                (Signal::MotorTorqueNm, shown.collect()),
                (Signal::CommandTorqueNm, command_nm.clone()),
            ]
            .into(),
        };
        torque_from_commands(&mut joint, std::slice::from_ref(&(0..2000)), 1e-3);
        let mended_nm = &joint.signals[&Signal::MotorTorqueNm];
        for (k, mended_nm) in mended_nm[..1990].iter().enumerate().skip(100) {
            let off_nm = mended_nm - torque_nm(k);
            assert!(off_nm.abs() < 0.01, "row {k}: {off_nm}");
        }
    }
}
