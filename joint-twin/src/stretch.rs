//! Recordings cut into stretches: uninterrupted pieces at a constant rate, as the simulation wants them.

use joint_model::filter::FilterError;
use recording::grid::{Grid, pieces};
use recording::{JointColumns, MissingSignal, Recording, Signal};
use robot::Robot;

use crate::START_S;
use crate::control;
use crate::links::{Links, Position};
use crate::load::{Load, Motion};
use crate::simulate::{Between, Drive};

/// A stretch shorter than this tells nothing.
pub const STRETCH_MIN_S: f64 = 2.0 * START_S;

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
pub fn rigid_stretches(
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

fn stretch(
    index: usize,
    recording: &Recording,
    robot: &Robot,
    grid: &Grid,
    of_links: OfLinks,
) -> Result<Stretch, StretchError> {
    let rate_hz = 1.0 / grid.period_s();
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
        first_row: grid.first_row(),
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
    let motor = joint
        .measured(Signal::MotorPositionRad)
        .map(|x| grid.sample(x, 1.0 / gear_ratio));
    let link = joint
        .measured(Signal::LinkPositionRad)
        .map(|x| grid.sample(x, 1.0));
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

fn joint_stretch(
    joint: &JointColumns,
    gear_ratio: f64,
    position: Position,
    between: Between,
    grid: &Grid,
) -> Option<JointStretch> {
    let sample = |signal, scale| joint.measured(signal).map(|x| grid.sample(x, scale));
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
            period_s: grid.period_s(),
            start_s: grid.start_s(),
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
