//! Factors between signals that tell the same thing: wrong units, signs, gear sides and gear ratios.

use super::meaning::{DEGREES, MEASURED, Meaning, TRACKED};
use super::robot::{VELOCITIES, has_its_step};
use super::{CheckJoint, Finding, FindingKind, mapping_line, ratio, torque, values};
use crate::info::timing;
use crate::statistics::line;
use crate::{JointColumns, Recording, Signal};
use std::ops::Range;

/// Signals that tell the same thing follow a straight line as closely as this.
pub(super) const SAME: f64 = 0.95;
/// A joint moves this part of what its reference does, where it hardly follows.
const BARELY_FOLLOWS: Range<f64> = 0.02..0.6;
/// A wrong factor keeps two positions on a straight line. Lost motion or a joint that lags behind its reference does not: what
/// they change scatters by more than this part of what it tilts. A gap that gravity holds open, a square wave in phase with a
/// sine, scatters by 0.48 of it.
pub(super) const STRAIGHT: f64 = 0.4;
/// A real joint stays behind its reference, and a short swing of it is far from the same.
const TRACKING: Range<f64> = 0.6..1.6;
/// A joint that its controller lets fall behind does not do so in proportion: friction alone scatters the line by more than this
/// part of what gravity tilts it, once the joint goes back as well. A wrong gear ratio does not.
const RULED: f64 = 0.1;
/// Part of the reference's way that leads back where it goes both ways.
const BACK: f64 = 0.05;
/// Time over which a velocity is taken from positions.
const BLOCK_S: f64 = 0.1;
const BLOCK_ROWS: usize = 5;

/// Which of a joint's signals are off, and by what.
pub(super) struct Scales {
    /// Motor turns per joint turn: the robot file's, or what the encoders show.
    pub(super) gear_ratio: Option<f64>,
    /// Motor position over link position.
    pub(super) measured_ratio: Option<f64>,
    /// How far the two are from a straight line, root mean square, as a part of their range.
    pub(super) ratio_scatter: f64,
    /// By the motor's encoder, and what it turns per joint turn.
    followed: Option<Followed>,
    positions: Vec<Wrong>,
    /// Against their own positions.
    velocities: Vec<Wrong>,
    /// Whether one agrees with its own position.
    has_right_velocity: bool,
    torques: Vec<Wrong>,
}

/// A signal that is off.
pub(super) struct Wrong {
    pub(super) signal: Signal,
    pub(super) against: Signal,
    pub(super) measured: f64,
    pub(super) meaning: Meaning,
}

impl Scales {
    /// Compares the joint's signals with each other.
    pub(super) fn of(
        recording: &Recording,
        joint: &JointColumns,
        robot: Option<&CheckJoint>,
    ) -> Self {
        let between = |x: Signal, y: Signal| slope(values(joint, x)?, values(joint, y)?, SAME);
        let measured_ratio = between(Signal::LinkPositionRad, Signal::MotorPositionRad);
        let ratio_scatter = scatter(joint, Signal::LinkPositionRad, Signal::MotorPositionRad);
        let gear_ratio = robot.map(|robot| robot.gear_ratio).or(measured_ratio);
        // without a robot file the ratio is what the encoders show, and holds the error that is looked for
        let followed =
            robot.and_then(|robot| Followed::by(joint, Signal::MotorPositionRad, robot.gear_ratio));
        let positions = wrong_positions(
            gear_ratio,
            measured_ratio
                .zip(gear_ratio)
                .map(|(seen, ratio)| seen / ratio),
            Followed::by(joint, Signal::LinkPositionRad, 1.0),
            followed,
        );
        // a joint that friction holds follows a seventh of its reference, as one in turns would
        let is_in_its_unit = |wrong: &Wrong| {
            BARELY_FOLLOWS.contains(&wrong.measured)
                && wrong.meaning.kind == FindingKind::WrongUnit
                && robot.is_some_and(|robot| has_its_step(robot, joint, wrong.signal))
        };
        let lags = |wrong: &Wrong| {
            wrong.meaning.kind == FindingKind::WrongScale
                && wrong.against == Signal::ReferencePositionRad
                && scatter(joint, wrong.against, wrong.signal)
                    > STRAIGHT * (wrong.measured - 1.0).abs()
        };
        // who does not follow at all, as behind a brake, tells no factor
        let stands = |wrong: &Wrong| {
            wrong.meaning.kind == FindingKind::WrongScale
                && wrong.against == Signal::ReferencePositionRad
                && wrong.measured.abs() < BARELY_FOLLOWS.start
        };
        // one way, a weak controller lets gravity carry the joint on in proportion, and both encoders show the same of it
        let is_carried = |wrong: &Wrong| {
            wrong.meaning.kind == FindingKind::WrongScale
                && wrong.signal == Signal::ReferencePositionRad
                && !values(joint, wrong.signal).is_some_and(goes_back)
        };
        let positions = positions
            .into_iter()
            .filter(|wrong| {
                !is_in_its_unit(wrong) && !lags(wrong) && !stands(wrong) && !is_carried(wrong)
            })
            .collect();
        let mut scales = Self {
            gear_ratio,
            measured_ratio,
            ratio_scatter,
            followed,
            positions,
            velocities: Vec::new(),
            has_right_velocity: false,
            torques: Vec::new(),
        };
        let velocities = scales.compared_velocities(recording, joint);
        let (wrong, right): (Vec<_>, Vec<_>) = velocities
            .into_iter()
            .partition(|compared| is_off(compared.measured));
        scales.velocities = wrong;
        scales.has_right_velocity = !right.is_empty();
        scales.torques = torque::wrong(recording, joint, robot, &scales);
        scales
    }

    /// What the signal must be divided by to be what its name says, as far as the data show.
    pub(super) fn factor(&self, signal: Signal) -> f64 {
        let factor = self
            .all()
            .filter(|wrong| wrong.signal == signal)
            .map(|wrong| wrong.meaning.factor);
        factor.product()
    }

    fn all(&self) -> impl Iterator<Item = &Wrong> {
        self.positions
            .iter()
            .chain(&self.velocities)
            .chain(&self.torques)
    }

    /// All that can be held against their own positions, right or wrong.
    fn compared_velocities(&self, recording: &Recording, joint: &JointColumns) -> Vec<Wrong> {
        let pairs = [
            (Signal::MotorVelocityRadS, Signal::MotorPositionRad),
            (Signal::LinkVelocityRadS, Signal::LinkPositionRad),
            (Signal::ReferenceVelocityRadS, Signal::ReferencePositionRad),
        ];
        let compared = |(velocity, position): (Signal, Signal)| {
            let (moved, integrated) = moves_and_integrals(
                recording,
                values(joint, position)?,
                values(joint, velocity)?,
            );
            // A wrong gear ratio is none of the position itself, and does not spoil the velocity.
            let unit: f64 = self
                .positions
                .iter()
                .filter(|wrong| wrong.signal == position)
                .filter(|wrong| wrong.meaning.kind != FindingKind::WrongScale)
                .map(|wrong| wrong.meaning.factor)
                .product();
            let measured = slope(&moved, &integrated, SAME)? * unit;
            Some(Wrong {
                signal: velocity,
                against: position,
                measured,
                meaning: Meaning::of(measured, self.gear_ratio, MEASURED),
            })
        };
        pairs.into_iter().filter_map(compared).collect()
    }
}

/// The slope of `y` over `x` if they tell the same thing.
pub(super) fn slope(x: &[f64], y: &[f64], correlation_min: f64) -> Option<f64> {
    let line = line(x, y)?;
    (line.correlation.abs() > correlation_min).then_some(line.slope)
}

/// How far two signals are from a straight line, root mean square, as a part of their range.
fn scatter(joint: &JointColumns, x: Signal, y: Signal) -> f64 {
    let both = values(joint, x).zip(values(joint, y));
    both.and_then(|(x, y)| line(x, y))
        .map_or(1.0, |line| (1.0 - line.correlation.powi(2)).max(0.0).sqrt())
}

/// Whether a position goes both ways.
fn goes_back(position: &[f64]) -> bool {
    let steps = position.windows(2).map(|pair| pair[1] - pair[0]);
    let (mut forth, mut back) = (0.0, 0.0);
    for step in steps.filter(|step| step.is_finite()) {
        if step > 0.0 {
            forth += step;
        } else {
            back -= step;
        }
    }
    f64::min(forth, back) > BACK * (forth + back)
}

fn is_off(factor: f64) -> bool {
    (factor - 1.0).abs() > 2.0 * MEASURED
}

/// How a joint follows its reference.
#[derive(Clone, Copy)]
struct Followed {
    /// Joint angle over reference.
    factor: f64,
    /// How far the two are from a straight line.
    scatter: f64,
    /// Whether the reference goes both ways.
    goes_back: bool,
}

impl Followed {
    /// As a measured position shows it, over what it turns per joint turn.
    fn by(joint: &JointColumns, position: Signal, per_turn: f64) -> Option<Self> {
        let [from, to] = [Signal::ReferencePositionRad, position].map(|of| values(joint, of));
        Some(Self {
            factor: slope(from?, to?, SAME)? / per_turn,
            scatter: scatter(joint, Signal::ReferencePositionRad, position),
            goes_back: goes_back(from?),
        })
    }

    /// Whether no controller follows so.
    fn is_wrong(self) -> bool {
        let is_ruled = self.goes_back && self.scatter < RULED * (self.factor - 1.0).abs();
        !TRACKING.contains(&self.factor) || is_ruled && is_off(self.factor)
    }
}

/// Which of three positions is off: the one that fits neither of the others. Of two, the measured one.
fn wrong_positions(
    gear_ratio: Option<f64>,
    motor_over_link: Option<f64>,
    link_over_reference: Option<Followed>,
    motor_over_reference: Option<Followed>,
) -> Vec<Wrong> {
    use Signal::{LinkPositionRad, MotorPositionRad, ReferencePositionRad};
    let off = |factor: Option<f64>| factor.filter(|factor| is_off(*factor));
    let away = |followed: Option<Followed>| {
        let wrong = followed.filter(|followed| followed.is_wrong());
        wrong.map(|followed| followed.factor)
    };
    let wrong = |signal, measured, against| {
        let near = match against {
            // within it only what is followed in proportion is wrong, and that is exact
            ReferencePositionRad if !TRACKING.contains(&measured) => TRACKED,
            _ => MEASURED,
        };
        vec![Wrong {
            signal,
            against,
            measured,
            meaning: Meaning::of(measured, gear_ratio, near),
        }]
    };
    match (
        off(motor_over_link),
        away(link_over_reference),
        away(motor_over_reference),
    ) {
        // two that agree are right, unless they are too large by what an angle in degrees is: all three are to be radians
        (_, Some(link), Some(motor))
            if (link / motor - 1.0).abs() < 2.0 * MEASURED
                && (link / DEGREES).abs().ln().abs() > TRACKED =>
        {
            wrong(ReferencePositionRad, 1.0 / link, LinkPositionRad)
        }
        (_, Some(link), None) => wrong(LinkPositionRad, link, ReferencePositionRad),
        (_, None, Some(motor)) => wrong(MotorPositionRad, motor, ReferencePositionRad),
        (_, Some(link), Some(motor)) => {
            let mut both = wrong(LinkPositionRad, link, ReferencePositionRad);
            both.extend(wrong(MotorPositionRad, motor, ReferencePositionRad));
            both
        }
        (Some(motor), None, None) => wrong(MotorPositionRad, motor, LinkPositionRad),
        (None, None, None) => Vec::new(),
    }
}

/// Blocks of neighbouring rows of one trajectory, without gaps, over which a velocity can be told.
pub(super) fn blocks(recording: &Recording) -> Vec<Range<usize>> {
    let rows_per_block = ((BLOCK_S * recording.sample_rate_hz).ceil() as usize).max(BLOCK_ROWS);
    let span_s = rows_per_block as f64 / recording.sample_rate_hz;
    let mut blocks = Vec::new();
    for rows in recording.segments() {
        let mut start = rows.start;
        while start + rows_per_block < rows.end {
            let end = start + rows_per_block + 1;
            let elapsed_s = recording.time_s[end - 1] - recording.time_s[start];
            if elapsed_s > 0.0 && elapsed_s < 1.5 * span_s {
                blocks.push(start..end);
            }
            start += rows_per_block;
        }
    }
    blocks
}

/// Over each block, how far the position went and what the velocity sums up to.
fn moves_and_integrals(
    recording: &Recording,
    position: &[f64],
    velocity: &[f64],
) -> (Vec<f64>, Vec<f64>) {
    blocks(recording)
        .into_iter()
        .map(|rows| {
            let trapezoids = rows.clone().skip(1).map(|row| {
                let step_s = recording.time_s[row] - recording.time_s[row - 1];
                0.5 * (velocity[row] + velocity[row - 1]) * step_s
            });
            let integral: f64 = trapezoids.sum();
            (position[rows.end - 1] - position[rows.start], integral)
        })
        .unzip()
}

/// Part of a row's time by which rows that were counted are apart from it at most: what rounding to a microsecond does at 1 kHz.
const COUNTED: f64 = 1e-3;

/// A time that runs wrong: what shows it is one factor, and no unit's, by which the velocities of two joints or more are off, and
/// every velocity that moves. These are then right. A clock that was read is believed: its rows are never as far apart as rows that
/// were counted.
pub(super) fn wrong_time(recording: &Recording, joints: &mut [Scales]) -> Option<Finding> {
    let velocities = || joints.iter().flat_map(|seen| &seen.velocities);
    let count = velocities().count() as f64;
    let sum: f64 = velocities().map(|wrong| wrong.measured.ln()).sum();
    let factor = (sum / count).exp();
    let is_of_time = |wrong: &Wrong| {
        wrong.meaning.kind == FindingKind::WrongScale
            && (wrong.measured / factor - 1.0).abs() < MEASURED
    };
    let with_velocity = joints.iter().filter(|seen| !seen.velocities.is_empty());
    let with_velocity = with_velocity.count();
    if with_velocity < 2
        || joints.iter().any(|seen| seen.has_right_velocity)
        || !velocities().all(is_of_time)
    {
        return None;
    }
    let timing = timing(recording);
    let told_hz = timing.measured_rate_hz.unwrap_or(recording.sample_rate_hz);
    if timing.jitter_max_s * told_hz > COUNTED {
        return None;
    }
    for seen in joints {
        seen.velocities.clear();
    }
    let rate_hz = told_hz * factor;
    let what = format!(
        "all {with_velocity} joints' velocities are {factor:.4} times what their positions say, and that is no unit: the time is \
         wrong, with about {rate_hz:.1} rows a second and not {told_hz:.1}"
    );
    let finding = Finding::error(FindingKind::RateOff, what).decided_by(rate_hz);
    Some(finding.remedy(format!(
        "in the mapping file, set `sample_rate_hz` to {rate_hz:.1} and multiply the scale of `time_s`, if there is one, by {0:.4e}; \
         or, if the time is right, multiply the scale of every velocity by {0:.4e}",
        1.0 / factor
    )))
}

/// What the factors mean.
pub(super) fn check(
    recording: &Recording,
    joint: &JointColumns,
    robot: Option<&CheckJoint>,
    seen: &Scales,
) -> Vec<Finding> {
    let has_velocity = |joint: &&JointColumns| {
        VELOCITIES
            .iter()
            .any(|signal| joint.signals.contains_key(signal))
    };
    let is_only_one = recording.joints.iter().filter(has_velocity).count() == 1;
    let mut findings: Vec<Finding> = seen
        .all()
        .map(|wrong| explain(joint, robot, seen, wrong, is_only_one))
        .collect();
    findings.extend(torque::current_as_torque(joint, robot));
    if seen.positions.is_empty() {
        findings.extend(ratio::check(recording, joint, robot, seen));
        findings.extend(off_reference(joint, seen));
    }
    findings
}

/// Where a wrong gear ratio and a weak controller look alike and no second encoder decides.
fn off_reference(joint: &JointColumns, seen: &Scales) -> Option<Finding> {
    let followed = seen.followed.filter(|_| seen.measured_ratio.is_none())?;
    let tilt = (followed.factor - 1.0).abs();
    let told = seen.gear_ratio?;
    let what = format!(
        "moves {:.3} times as far as its reference asks, on a line from which it is {:.3} of its range away: a weak controller \
         lets it, or it turns {:.2} times per joint turn and not {told:.2}",
        followed.factor,
        followed.scatter,
        followed.factor * told,
    );
    (is_off(followed.factor) && followed.scatter < STRAIGHT * tilt).then(|| {
        Finding::warning(FindingKind::WrongGearRatio, what)
            .at(joint)
            .of(Signal::MotorPositionRad)
            .decided_by(followed.factor)
            .remedy("make sure of gear_ratio in the robot file")
    })
}

fn explain(
    joint: &JointColumns,
    robot: Option<&CheckJoint>,
    seen: &Scales,
    wrong: &Wrong,
    has_only_velocity: bool,
) -> Finding {
    if let Some(current) = torque::explain(joint, robot, wrong) {
        return current;
    }
    let Meaning { kind, text, factor } = &wrong.meaning;
    if *kind == FindingKind::WrongScale && wrong.signal == Signal::MotorPositionRad {
        return ratio::wrong(joint, factor * seen.gear_ratio.unwrap_or(1.0), seen);
    }
    let mut what = format!(
        "{:.4} times what {} says: {text}",
        wrong.measured, wrong.against
    );
    let mut remedy = format!("multiply its scale by {:.8}", 1.0 / factor);
    // one joint does not tell a wrong velocity from a wrong time
    let of_velocity = seen.velocities.iter().any(|of| of.signal == wrong.signal);
    if has_only_velocity && of_velocity && *kind == FindingKind::WrongScale {
        what.push_str(", or the time is");
        remedy.push_str(&format!(
            "; or, if it is right, the scale of `time_s` by {0:.8}, and `sample_rate_hz` by {factor:.8}",
            1.0 / factor
        ));
    }
    Finding::error(*kind, what)
        .at(joint)
        .of(wrong.signal)
        .decided_by(wrong.measured)
        .remedy(mapping_line(joint, wrong.signal, &remedy))
}
