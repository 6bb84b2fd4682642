//! Recordings cut into stretches: uninterrupted pieces at a constant rate, as the simulation wants them.

use joint_model::filter::FilterError;
use recording::{JointColumns, MissingSignal, Recording, Signal};
use robot::Robot;

use crate::twin::control;
use crate::twin::links::{Links, Position};
use crate::twin::load::{Load, Motion};
use crate::twin::simulate::{Between, Drive};

/// A hole longer than this ends a stretch.
const HOLE_MAX_S: f64 = 0.1;
/// A stretch shorter than this tells nothing.
const STRETCH_MIN_S: f64 = 1.0;
/// Rows without a value are bridged over so many; what lies in longer holes does not count.
const BRIDGED_ROWS: usize = 3;

/// Where something begins among the recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Index of the recording.
    pub recording: usize,
    /// Its first row.
    pub first_row: usize,
}

/// One joint's signals, joint side, at a constant rate.
#[derive(Clone, Debug)]
pub struct JointStretch {
    /// What drives the simulation.
    pub drive: Drive,
    /// What the joint carries.
    pub load: Load,
    /// Torque that rounding of the other joints' encoders pretends, root mean square.
    pub others_rounding_nm: Vec<f64>,
    /// Torque that nobody can know of how the other joints' links swing behind their gears where no encoder shows it.
    pub unseen_nm: Vec<f64>,
    /// Motor torque, or the command where the drive reports none.
    pub torque_nm: Vec<f64>,
    /// Whether the command is known.
    pub has_command: bool,
    /// Whether the drive reports its torque beside the command.
    pub has_torque_beside_command: bool,
    /// Link encoder, where there is one beside the motor's.
    pub link_rad: Option<Vec<f64>>,
    /// Torque sensor.
    pub joint_torque_nm: Option<Vec<f64>>,
    /// Whether all signals were there.
    pub is_whole: Vec<bool>,
}

/// An uninterrupted piece of a recording.
#[derive(Clone, Debug)]
pub struct Stretch {
    /// Which of the recordings it is from.
    pub recording: usize,
    /// The recording's row it begins with.
    pub first_row: usize,
    /// Samples per second.
    pub rate_hz: f64,
    /// In the robot file's order; none where the joint's torque is not known.
    pub joints: Vec<Option<JointStretch>>,
    /// The whole arm's, of its links.
    pub motion: Motion,
}

/// Why recordings cannot be cut.
#[derive(Debug, thiserror::Error)]
pub enum StretchError {
    /// A joint's position is not known.
    #[error(transparent)]
    Missing(#[from] MissingSignal),
    /// The rate is no rate.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// Nothing is long enough.
    #[error(
        "no piece of the recordings lasts {STRETCH_MIN_S} s without a hole; the longest lasts {longest_s:.2} s"
    )]
    Short {
        /// What there is.
        longest_s: f64,
    },
}

/// Cuts recordings where a trajectory ends or time jumps, and brings each piece to a constant rate.
///
/// # Errors
/// [`StretchError`].
pub fn stretches(recordings: &[&Recording], robot: &Robot) -> Result<Vec<Stretch>, StretchError> {
    cut(recordings, robot, Links::of)
}

/// The same with every link where its motor is: in little time, for what is asked of the rigid bodies only.
///
/// # Errors
/// [`StretchError`].
pub(crate) fn rigid_stretches(
    recordings: &[&Recording],
    robot: &Robot,
) -> Result<Vec<Stretch>, StretchError> {
    cut(recordings, robot, Links::rigid)
}

/// How the links moved, from what the encoders say at a rate.
type OfLinks = fn(&Robot, &[Position], f64) -> Result<Links, FilterError>;

fn cut(
    recordings: &[&Recording],
    robot: &Robot,
    of_links: OfLinks,
) -> Result<Vec<Stretch>, StretchError> {
    let mut found = Vec::new();
    let mut longest_s = 0.0_f64;
    for (index, recording) in recordings.iter().enumerate() {
        for rows in pieces(recording) {
            let time_s = &recording.time_s[rows.clone()];
            let length_s = time_s.last().unwrap_or(&0.0) - time_s.first().unwrap_or(&0.0);
            longest_s = longest_s.max(length_s);
            if length_s >= STRETCH_MIN_S {
                let grid = Grid::new(time_s, rows.start, recording.sample_rate_hz);
                found.push(stretch(index, recording, robot, &grid, of_links)?);
            }
        }
    }
    if found.is_empty() {
        return Err(StretchError::Short { longest_s });
    }
    Ok(found)
}

/// Rows without a hole among them, of one trajectory.
pub(crate) fn pieces(recording: &Recording) -> Vec<std::ops::Range<usize>> {
    let hole_s = HOLE_MAX_S.max(3.0 / recording.sample_rate_hz);
    let segments = recording.segments().into_iter();
    segments
        .flat_map(|rows| without_holes(&recording.time_s, rows, hole_s))
        .collect()
}

fn without_holes(
    time_s: &[f64],
    rows: std::ops::Range<usize>,
    hole_s: f64,
) -> Vec<std::ops::Range<usize>> {
    let mut pieces = Vec::new();
    let mut start = rows.start;
    for row in rows.start + 1..rows.end {
        let follows = time_s[row] - time_s[row - 1] <= hole_s;
        if !follows {
            pieces.push(start..row);
            start = row;
        }
    }
    pieces.push(start..rows.end);
    pieces
}

/// Instants at a constant rate, each between two rows.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    start_s: f64,
    period_s: f64,
    /// The row before, and how far it is to the next.
    places: Vec<(usize, f64)>,
    rows: std::ops::Range<usize>,
}

impl Grid {
    /// Of rows that begin with the first one, at their times.
    pub fn new(time_s: &[f64], first_row: usize, rate_hz: f64) -> Self {
        let rows = first_row..first_row + time_s.len();
        let start_s = time_s[0];
        let period_s = 1.0 / rate_hz;
        let uneven_s = (0..time_s.len())
            .map(|k| (time_s[k] - start_s - k as f64 * period_s).abs())
            .fold(0.0, f64::max);
        let places = if uneven_s < 0.2 * period_s {
            rows.clone().map(|row| (row, 0.0)).collect()
        } else {
            between_rows(time_s, first_row, period_s)
        };
        Self {
            start_s,
            period_s,
            places,
            rows,
        }
    }

    /// How many instants.
    pub fn samples(&self) -> usize {
        self.places.len()
    }

    /// A signal at the grid's instants, with where it was there.
    pub fn sample(&self, values: &[f64], scale: f64) -> (Vec<f64>, Vec<bool>) {
        let (bridged, whole) = bridge(&values[self.rows.clone()]);
        let first = self.rows.start;
        let last = bridged.len() - 1;
        let sampled = self.places.iter().map(|&(row, share)| {
            let (a, b) = (row - first, (row - first + 1).min(last));
            scale * (bridged[a] + share * (bridged[b] - bridged[a]))
        });
        let whole = self.places.iter().map(|&(row, _)| whole[row - first]);
        (sampled.collect(), whole.collect())
    }
}

fn between_rows(time_s: &[f64], first_row: usize, period_s: f64) -> Vec<(usize, f64)> {
    let end_s = time_s[time_s.len() - 1] - time_s[0];
    let count = (end_s / period_s) as usize + 1;
    let mut row = 0;
    (0..count)
        .map(|k| {
            let at_s = time_s[0] + k as f64 * period_s;
            while row + 2 < time_s.len() && time_s[row + 1] <= at_s {
                row += 1;
            }
            let step_s = time_s[row + 1] - time_s[row];
            let share = if step_s > 0.0 {
                ((at_s - time_s[row]) / step_s).clamp(0.0, 1.0)
            } else {
                0.0
            };
            (first_row + row, share)
        })
        .collect()
}

/// Fills holes by straight lines, and tells which rows do not lie in long ones.
fn bridge(values: &[f64]) -> (Vec<f64>, Vec<bool>) {
    let mut bridged = values.to_vec();
    let mut whole = vec![true; values.len()];
    let mut row = 0;
    while row < values.len() {
        if values[row].is_finite() {
            row += 1;
            continue;
        }
        let end = (row..values.len())
            .find(|k| values[*k].is_finite())
            .unwrap_or(values.len());
        let before = row.checked_sub(1).map(|k| bridged[k]);
        let after = values.get(end).copied();
        let (from, to) = match (before, after) {
            (Some(from), Some(to)) => (from, to),
            (Some(only), None) | (None, Some(only)) => (only, only),
            (None, None) => (0.0, 0.0),
        };
        let steps = (end - row + 1) as f64;
        for k in row..end {
            bridged[k] = from + (to - from) * (k - row + 1) as f64 / steps;
            whole[k] = end - row <= BRIDGED_ROWS;
        }
        row = end;
    }
    (bridged, whole)
}

fn stretch(
    index: usize,
    recording: &Recording,
    robot: &Robot,
    grid: &Grid,
    of_links: OfLinks,
) -> Result<Stretch, StretchError> {
    let rate_hz = 1.0 / grid.period_s;
    let between = control::between(robot, rate_hz);
    let positions = robot
        .joints
        .iter()
        .map(|joint| position_rad(recording.joint(&joint.name)?, joint.gear_ratio, grid))
        .collect::<Result<Vec<_>, MissingSignal>>()?;
    let links = of_links(robot, &positions, rate_hz)?;
    let joints = positions
        .into_iter()
        .zip(&robot.joints)
        .enumerate()
        .map(|(k, (position, file))| {
            let columns = recording.joint(&file.name)?;
            let signals = joint_stretch(columns, file.gear_ratio, position, between, grid);
            Ok(signals.map(|signals| {
                let load = links.load(&robot.chain, k);
                JointStretch {
                    unseen_nm: links.unseen_nm(&robot.chain, k, &load),
                    load,
                    others_rounding_nm: links.rounding_nm(&robot.chain, k, signals.samples()),
                    ..signals
                }
            }))
        })
        .collect::<Result<Vec<_>, MissingSignal>>()?;
    Ok(Stretch {
        recording: index,
        first_row: grid.rows.start,
        rate_hz,
        joints,
        motion: links.motion,
    })
}

fn position_rad(
    joint: &JointColumns,
    gear_ratio: f64,
    grid: &Grid,
) -> Result<Position, MissingSignal> {
    let motor = measured(joint, Signal::MotorPositionRad).map(|x| grid.sample(x, 1.0 / gear_ratio));
    let link = measured(joint, Signal::LinkPositionRad).map(|x| grid.sample(x, 1.0));
    match (motor, link) {
        (Some((motor_rad, is_whole)), link) => Ok(Position {
            motor_rad,
            link_rad: link.map(|(link_rad, _)| link_rad),
            is_whole,
            is_of_link: false,
        }),
        // one encoder behind the gear: the gear is as good as rigid
        (None, Some((motor_rad, is_whole))) => Ok(Position {
            motor_rad,
            link_rad: None,
            is_whole,
            is_of_link: true,
        }),
        (None, None) => Err(MissingSignal::Signal {
            joint: joint.name.clone(),
            signal: Signal::MotorPositionRad,
            there: joint.signals.keys().map(ToString::to_string).collect(),
        }),
    }
}

/// A signal with at least one value.
pub(crate) fn measured(joint: &JointColumns, signal: Signal) -> Option<&[f64]> {
    let values = joint.signals.get(&signal)?;
    values
        .iter()
        .any(|value| value.is_finite())
        .then_some(values)
}

fn joint_stretch(
    joint: &JointColumns,
    gear_ratio: f64,
    position: Position,
    between: Between,
    grid: &Grid,
) -> Option<JointStretch> {
    let sample = |signal, scale| measured(joint, signal).map(|x| grid.sample(x, scale));
    let torque = sample(Signal::MotorTorqueNm, gear_ratio);
    let command = sample(Signal::CommandTorqueNm, gear_ratio);
    let has_command = command.is_some();
    let has_torque_beside_command = torque.is_some() && command.is_some();
    let (torque_nm, torque_whole) = torque.or_else(|| command.clone())?;
    let command_nm = command.map_or_else(|| torque_nm.clone(), |(values, _)| values);
    let is_whole = position
        .is_whole
        .iter()
        .zip(&torque_whole)
        .map(|(a, b)| *a && *b)
        .collect();
    Some(JointStretch {
        drive: Drive {
            period_s: grid.period_s,
            start_s: grid.start_s,
            motor_rad: position.motor_rad,
            link_rad: position.link_rad.clone(),
            command_nm,
            // a measured torque is one instant's, before or after a command took effect
            between: if has_command { between } else { Between::Line },
        },
        load: Load::default(),
        others_rounding_nm: Vec::new(),
        unseen_nm: Vec::new(),
        torque_nm,
        has_command,
        has_torque_beside_command,
        link_rad: position.link_rad,
        joint_torque_nm: sample(Signal::JointTorqueNm, 1.0).map(|(values, _)| values),
        is_whole,
    })
}

impl JointStretch {
    /// How many samples.
    pub fn samples(&self) -> usize {
        self.torque_nm.len()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn a_jump_in_time_ends_a_stretch() {
        let time_s = [0.0, 0.01, 0.02, 1.0, 1.01];
        assert_eq!(without_holes(&time_s, 0..5, 0.1), [0..3, 3..5]);
    }

    #[test]
    fn holes_are_bridged_and_long_ones_do_not_count() {
        let nan = f64::NAN;
        let (values, whole) = bridge(&[nan, 1.0, nan, 3.0, nan, nan, nan, nan, 8.0, nan]);
        assert_eq!(values, [1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 8.0]);
        let missing: Vec<usize> = (0..whole.len()).filter(|k| !whole[*k]).collect();
        assert_eq!(missing, [4, 5, 6, 7]);
    }

    #[test]
    fn an_uneven_clock_is_brought_to_a_constant_rate() {
        let time_s = [0.0, 0.9, 2.2, 3.0, 4.0];
        let grid = Grid::new(&time_s, 0, 1.0);
        let (values, _) = grid.sample(&time_s, 2.0);
        for (k, value) in values.iter().enumerate() {
            assert!((value - 2.0 * k as f64).abs() < 1e-12);
        }
    }
}
