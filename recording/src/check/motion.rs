//! Motion: whether there is any, at more than one speed and in both directions, and whether every signal follows it.

use super::scale::{Scales, blocks};
use super::{Finding, FindingKind, POSITIONS, measured_position, values};
use crate::statistics::{quantile, span};
use crate::{JointColumns, Recording, Signal};

/// A joint that moves less is moved by its neighbours' reaction only.
pub const STILL_RAD: f64 = 2e-3;
/// Of the fastest speed (of its 95 % quantile); slower counts as standing.
const MOVING: f64 = 0.05;
/// Fast moving over slow moving, 90 % over 20 % quantile: below this it is one speed.
const SPEEDS: f64 = 1.4;
/// Part of the speeds' squares that one frequency makes up: above it there is no other. There and back at one speed has 0.81.
const ONE_FREQUENCY: f64 = 0.86;
/// Fewer swings are any motion's, and a faster one is not told by a few blocks a swing.
const SWINGS_MIN: f64 = 4.0;
const FREQUENCY_MAX_HZ: f64 = 4.0;
/// A signal that keeps one value for as long while the joint moves is stuck.
const STUCK_S: f64 = 0.2;
/// Share of its whole way that the joint moves meanwhile.
const STUCK_TRAVEL: f64 = 0.05;
/// Part of a torque's rows, at each end of what it measured, that may be anything.
const ODD: f64 = 0.01;
/// Above this share missing values are worth a warning.
const MISSING: f64 = 0.05;

/// One joint's motion and signals.
pub(super) fn check(recording: &Recording, joint: &JointColumns, seen: &Scales) -> Vec<Finding> {
    let mut findings = Vec::new();
    let way = |signal: Signal| {
        let position = values(joint, signal)?;
        let side = match signal {
            Signal::MotorPositionRad => seen.gear_ratio.unwrap_or(1.0),
            _ => 1.0,
        };
        Some((signal, span(position) / (side * seen.factor(signal)).abs()))
    };
    let farthest_rad = POSITIONS
        .into_iter()
        .filter_map(way)
        .map(|(_, way)| way)
        .fold(0.0, f64::max);
    match POSITIONS[..2].iter().find_map(|signal| way(*signal)) {
        Some((signal, way_rad)) if way_rad < STILL_RAD => {
            let what = format!("stands still, it moves {way_rad:.2e} rad at the joint");
            let finding = Finding::warning(FindingKind::NoMotion, what)
                .at(joint)
                .of(signal);
            let remedy = "record a motion in both directions at several speeds to learn something about this joint";
            findings.push(finding.decided_by(way_rad).remedy(remedy));
        }
        Some(_) => {
            let position = measured_position(joint);
            findings.extend(
                position.and_then(|(signal, position)| speeds(recording, joint, signal, position)),
            );
        }
        None => {}
    }
    for (signal, column) in &joint.signals {
        findings.extend(missing(joint, *signal, column));
        if farthest_rad >= STILL_RAD && !may_be_constant(*signal) {
            findings.extend(stuck(recording, joint, *signal, column));
        }
    }
    findings
}

fn speeds(
    recording: &Recording,
    joint: &JointColumns,
    signal: Signal,
    position: &[f64],
) -> Option<Finding> {
    let timed: Vec<(f64, f64)> = blocks(recording)
        .into_iter()
        .map(|rows| {
            let (from_s, to_s) = (recording.time_s[rows.start], recording.time_s[rows.end - 1]);
            let way = position[rows.end - 1] - position[rows.start];
            (0.5 * (from_s + to_s), way / (to_s - from_s))
        })
        .filter(|(_, velocity)| velocity.is_finite())
        .collect();
    let velocities: Vec<f64> = timed.iter().map(|(_, velocity)| *velocity).collect();
    let sizes: Vec<f64> = velocities.iter().map(|velocity| velocity.abs()).collect();
    let fast = quantile(sizes.clone(), 0.95)?;
    let moving: Vec<f64> = sizes
        .into_iter()
        .filter(|size| *size > MOVING * fast)
        .collect();
    let (slow, fast) = (quantile(moving.clone(), 0.2)?, quantile(moving, 0.9)?);
    let finding = if fast < SPEEDS * slow {
        let side = match signal {
            Signal::MotorPositionRad => "motor",
            _ => "joint",
        };
        let what =
            format!("moves at one speed only, from {slow:.4} to {fast:.4} rad/s at the {side}");
        Finding::warning(FindingKind::OneSpeed, what)
            .decided_by(fast / slow)
            .remedy("record several speeds: how friction changes with speed cannot be told")
    } else {
        let threshold = MOVING * fast;
        let forward = velocities.iter().any(|velocity| *velocity > threshold);
        let backward = velocities.iter().any(|velocity| *velocity < -threshold);
        if forward && backward {
            return one_frequency(&timed).map(|finding| finding.at(joint).of(signal));
        }
        let direction = if forward { "positive" } else { "negative" };
        let what = format!("moves in the {direction} direction only");
        Finding::warning(FindingKind::OneDirection, what)
            .remedy("record both directions: friction cannot be told from a torque offset")
    };
    Some(finding.at(joint).of(signal))
}

/// Whether speeds over time are one sine.
fn one_frequency(timed: &[(f64, f64)]) -> Option<Finding> {
    let (from_s, to_s) = (timed.first()?.0, timed.last()?.0);
    let square: f64 = timed.iter().map(|(_, velocity)| velocity * velocity).sum();
    let share = |hz: f64| {
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (time_s, velocity) in timed {
            let (s, c) = (std::f64::consts::TAU * hz * time_s).sin_cos();
            sine += s * velocity;
            cosine += c * velocity;
        }
        2.0 * (sine * sine + cosine * cosine) / (timed.len() as f64 * square)
    };
    let lowest_hz = SWINGS_MIN / (to_s - from_s);
    let step_hz = 0.25 / (to_s - from_s);
    // two blocks a swing at least, however long the recording says that it is
    let highest_hz = FREQUENCY_MAX_HZ.min(0.5 * timed.len() as f64 / (to_s - from_s));
    let count = ((highest_hz - lowest_hz) / step_hz) as usize;
    let (hz, share) = (0..count)
        .map(|k| lowest_hz + k as f64 * step_hz)
        .map(|hz| (hz, share(hz)))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    (share > ONE_FREQUENCY).then(|| {
        let what = format!("swings at one frequency only, {hz:.2} Hz");
        Finding::warning(FindingKind::OneFrequency, what)
            .decided_by(share)
            .remedy("record several frequencies: load, inertia, a soft gear and a wrong torque constant look alike")
    })
}

fn missing(joint: &JointColumns, signal: Signal, column: &[f64]) -> Option<Finding> {
    let missing = column.iter().filter(|value| value.is_nan()).count();
    let share = missing as f64 / column.len() as f64;
    (share > MISSING).then(|| {
        let what = format!("{:.1} % of the rows have no value", 100.0 * share);
        Finding::warning(FindingKind::MissingValues, what)
            .at(joint)
            .of(signal)
            .decided_by(share)
    })
}

/// An encoder that keeps its value while the joint's other one moves, or any signal that always does. A joint with one
/// encoder may really stick, and a reference rest while the joint catches up.
fn stuck(
    recording: &Recording,
    joint: &JointColumns,
    signal: Signal,
    column: &[f64],
) -> Option<Finding> {
    let other = match signal {
        Signal::MotorPositionRad => values(joint, Signal::LinkPositionRad),
        Signal::LinkPositionRad => values(joint, Signal::MotorPositionRad),
        _ => None,
    };
    let held = other.and_then(|other| longest_held(recording, column, other));
    let is_torque = matches!(signal, Signal::MotorTorqueNm | Signal::JointTorqueNm);
    // of a drive that was switched off before the joint moved the first rows have another one
    let is_nearly_one_value = || {
        let there: Vec<f64> = column.iter().copied().filter(|nm| nm.is_finite()).collect();
        let [low, high] = [ODD, 1.0 - ODD].map(|part| quantile(there.clone(), part));
        low.is_some() && low == high
    };
    let what = if let Some((held_s, at_s)) = held {
        format!("keeps one value for {held_s:.3} s from {at_s:.3} s on, while the joint moves")
    } else if span(column) == 0.0 || is_torque && is_nearly_one_value() {
        "keeps one value while the joint moves".to_owned()
    } else {
        return None;
    };
    // a torque of one value is no measurement of a joint that moves
    let (finding, remedy) = if is_torque {
        (
            Finding::error(FindingKind::StuckSignal, what),
            "leave the column out; if the joint has no drive, or none that was switched on, map a column of zeros to command_torque_nm",
        )
    } else {
        (
            Finding::warning(FindingKind::StuckSignal, what),
            "leave the values empty where the sensor gave none, or leave the column out",
        )
    };
    Some(finding.at(joint).of(signal).remedy(remedy))
}

/// How long and from when on the column keeps a value, at longest, while the other one moves.
fn longest_held(recording: &Recording, column: &[f64], other: &[f64]) -> Option<(f64, f64)> {
    let travel = STUCK_TRAVEL * span(other);
    let mut longest: Option<(f64, f64)> = None;
    for rows in recording.segments() {
        let same = |a: &f64, b: &f64| a == b;
        let mut start = rows.start;
        for held in column[rows].chunk_by(same) {
            let end = start + held.len() - 1;
            let (from_s, held_s) = (
                recording.time_s[start],
                recording.time_s[end] - recording.time_s[start],
            );
            let longer = longest.is_none_or(|(longest_s, _)| held_s > longest_s);
            if held_s > STUCK_S && longer && span(&other[start..=end]) > travel {
                longest = Some((held_s, from_s));
            }
            start = end + 1;
        }
    }
    longest
}

/// Of these a constant value may be meant: no torque commanded in velocity mode, a constant speed, a steady gear.
fn may_be_constant(signal: Signal) -> bool {
    matches!(
        signal,
        Signal::CommandTorqueNm | Signal::ReferenceVelocityRadS | Signal::TemperatureC
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_years_are_looked_at_as_soon_as_times_of_seconds() {
        // microseconds that were read as seconds
        let timed: Vec<(f64, f64)> = (0..2000)
            .map(|k| (2e5 * f64::from(k), (0.3 * f64::from(k)).sin()))
            .collect();
        let found = one_frequency(&timed);
        assert!(found.is_some_and(|found| found.kind == FindingKind::OneFrequency));
    }
}
