//! The recorded motion of the whole arm and the torque of each joint, at a constant rate and band-limited.

use std::borrow::Cow;
use std::ops::Range;

use gap_report::TorqueSource;
use joint_model::filter::FilterError;
use joint_twin::on_all_cores::OnAllCores;
use joint_twin::signal::band::{Band, COMPARED_HZ, MOTION_HZ, up_to};
use joint_twin::signal::smooth::{derivative, second_derivative};
use joint_twin::stretch::{STRETCH_MIN_S, StretchError};
use recording::grid::{Grid, pieces};
use recording::{JointColumns, MissingSignal, Recording, Signal, noise_std};
use robot::Robot;

use super::signals::controller;
use crate::evidence::DEVIATIONS;

/// Rows a second that hold the motion's band: seven times its end.
const ROWS_HZ: f64 = 200.0;
/// The ends of a piece do not count, in seconds: a low-pass of 8 Hz both ways has nothing behind them.
pub const END_S: f64 = 0.3;

/// Standard deviation of the time by which torque and position may be apart beside a sample, in seconds: filters of usual drives and
/// torque sensors delay by 1 to 3 ms. No file tells it, and it is no effect.
const CLOCK_S: f64 = 2e-3;

/// One joint's motion and torque, joint side.
#[derive(Clone, Debug, Default)]
pub struct JointMotion {
    /// Time since the recording began.
    pub time_s: Vec<f64>,
    /// Angle, without what is faster than any motion.
    pub position_rad: Vec<f64>,
    /// Its rate.
    pub velocity_rad_s: Vec<f64>,
    /// The rate's rate.
    pub acceleration_rad_s2: Vec<f64>,
    /// Torque, none where nothing tells it.
    pub torque_nm: Option<Vec<f64>>,
    /// Part of the torque that a controller makes of the reference's velocity, where no column tells that velocity: some controllers feed
    /// it, others brake the whole velocity.
    pub rate_feed_nm: Option<Vec<f64>>,
    /// By how much more the torque is reckoned, per second by which the reference reaches the drive later than it was recorded; none where
    /// the torque is not the controller's.
    pub late_nm_s: Option<Vec<f64>>,
    /// What was commanded, where that is beside the torque.
    pub command_nm: Option<Vec<f64>>,
    /// What a sensor behind the gear measures, where that is beside the drive's torque and has no holes of its own.
    pub sensor_nm: Option<Vec<f64>>,
    /// Noise of the torque from sample to sample, if it is alike at all frequencies.
    pub noise_nm: f64,
    /// What of the torque is faster than the band that is compared, root mean square while the joint moves; nothing of one that a controller
    /// makes of positions, whose steps it has.
    pub fast_nm: f64,
    /// Step of the encoder, on the side it was read; none where the values show none.
    pub step_rad: Option<f64>,
    /// Samples a second of the recording.
    pub recorded_hz: f64,
    /// Part of the recording's rows in which a controller asks for more than its drive gives. What that gives then tells of its limit, not of
    /// what the joint needs: the rows are not whole.
    pub at_limit_part: f64,
    /// Whether the row was measured, and tells what the joint needs.
    pub is_whole: Vec<bool>,
    /// Whether the joint moves, as far as its encoder can tell.
    pub is_moving: Vec<bool>,
}

/// An uninterrupted piece of a recording.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Rows a second.
    pub rate_hz: f64,
    /// Time of the first row since the recording began.
    pub start_s: f64,
    /// In the robot file's order.
    pub joints: Vec<JointMotion>,
}

/// What to read of each joint.
#[derive(Clone, Copy, Debug)]
pub struct Read {
    /// Its encoder; none where the recording has none, then it is held at zero.
    pub position: Option<Signal>,
    /// Its torque.
    pub torque: Option<TorqueSource>,
    /// Whether a sensor behind the gear measures beside the drive's torque.
    pub has_sensor_beside: bool,
}

impl Piece {
    /// Rows.
    pub fn rows(&self) -> usize {
        self.joints
            .first()
            .map_or(0, |joint| joint.position_rad.len())
    }

    /// The band that is compared, at this rate.
    pub fn compared_hz(&self) -> f64 {
        up_to(COMPARED_HZ, self.rate_hz)
    }

    /// A row's time.
    pub fn time_s(&self, row: usize) -> f64 {
        self.start_s + row as f64 / self.rate_hz
    }

    /// Rows that count: not those near the ends.
    pub fn counted(&self) -> Range<usize> {
        let end = (END_S * self.rate_hz) as usize;
        end..self.rows().saturating_sub(end).max(end)
    }
}

/// All pieces of all recordings.
///
/// # Errors
/// [`StretchError`] if nothing is long enough.
pub fn pieces_of(
    robot: &Robot,
    recordings: &[&Recording],
    read: &[Read],
) -> Result<Vec<Piece>, StretchError> {
    let mut longest_s = 0.0_f64;
    let mut found = Vec::new();
    for recording in recordings {
        let first_s = recording.time_s.first().copied().unwrap_or(0.0);
        for rows in pieces(recording) {
            let time_s = &recording.time_s[rows.clone()];
            let (Some(start_s), Some(end_s)) = (time_s.first(), time_s.last()) else {
                continue;
            };
            longest_s = longest_s.max(end_s - start_s);
            if end_s - start_s >= STRETCH_MIN_S {
                let grid = Grid::new(time_s, rows.start, recording.sample_rate_hz);
                found.push(piece(robot, recording, read, &grid, start_s - first_s)?);
            }
        }
    }
    if found.is_empty() {
        return Err(StretchError::Short { longest_s });
    }
    Ok(found)
}

fn piece(
    robot: &Robot,
    recording: &Recording,
    read: &[Read],
    grid: &Grid,
    start_s: f64,
) -> Result<Piece, StretchError> {
    let rate_hz = recording.sample_rate_hz;
    let every = ((rate_hz / ROWS_HZ) as usize).max(1);
    let joints = read
        .iter()
        .enumerate()
        .on_all_cores(|(index, read)| joint(robot, index, recording, *read, grid, every))
        .collect::<Result<Vec<_>, StretchError>>()?;
    let mut piece = Piece {
        rate_hz: rate_hz / every as f64,
        start_s,
        joints,
    };
    let time_s: Vec<f64> = (0..piece.rows()).map(|row| piece.time_s(row)).collect();
    for joint in &mut piece.joints {
        joint.time_s.clone_from(&time_s);
    }
    Ok(piece)
}

fn joint(
    robot: &Robot,
    index: usize,
    recording: &Recording,
    read: Read,
    grid: &Grid,
    every: usize,
) -> Result<JointMotion, StretchError> {
    let rate_hz = recording.sample_rate_hz;
    let file = &robot.joints[index];
    let ratio = file.gear_ratio;
    let rows = grid.samples().div_ceil(every);
    let Some(position) = read.position else {
        let rest = vec![0.0; rows];
        return Ok(JointMotion {
            position_rad: rest.clone(),
            velocity_rad_s: rest.clone(),
            acceleration_rad_s2: rest,
            is_whole: vec![false; rows],
            is_moving: vec![false; rows],
            ..JointMotion::default()
        });
    };
    let columns = recording.joint(&file.name)?;
    let of = |signal: Signal, scale: f64| -> Result<(Vec<f64>, Vec<bool>), MissingSignal> {
        Ok(grid.sample(recording.signal(&file.name, signal)?, scale))
    };
    let scale = if position == Signal::MotorPositionRad {
        1.0 / ratio
    } else {
        1.0
    };
    let (raw_rad, mut is_whole) = of(position, scale)?;
    let motion = Band::of(rate_hz, MOTION_HZ);
    let smooth_rad = motion.limit(&raw_rad)?;
    let mut torque = |signal: Signal, scale: f64| -> Result<Option<Vec<f64>>, StretchError> {
        let (values, whole) = of(signal, scale)?;
        for (all, one) in is_whole.iter_mut().zip(whole) {
            *all &= one;
        }
        Ok(Some(values))
    };
    let mut rate_feed_nm = None;
    let mut late_nm_s = None;
    let mut at_limit_part = 0.0;
    let torque_nm = match read.torque {
        Some(TorqueSource::Drive) => torque(Signal::MotorTorqueNm, ratio)?,
        Some(TorqueSource::Command) => torque(Signal::CommandTorqueNm, ratio)?,
        Some(TorqueSource::Sensor) => torque(Signal::JointTorqueNm, 1.0)?,
        Some(TorqueSource::Controller) => {
            let reference_rad = torque(Signal::ReferencePositionRad, 1.0)?.unwrap_or_default();
            let rate_rad_s = velocity_reference(columns, grid);
            late_nm_s = late(robot, index, &reference_rad, rate_hz);
            if rate_rad_s.is_none() {
                rate_feed_nm = rate_feed(robot, index, &reference_rad, rate_hz);
            }
            let asked = asked(robot, index, &reference_rad, &raw_rad, rate_rad_s, rate_hz);
            let limit_nm = limit_nm(robot, index);
            asked.map(|asked_nm| {
                let is_beyond: Vec<bool> = asked_nm.iter().map(|nm| nm.abs() > limit_nm).collect();
                at_limit_part = part(&is_beyond);
                // the band's filter goes over the rows both ways
                for (row, is_whole) in is_whole.iter_mut().enumerate() {
                    let rows = near(row, COMPARED_HZ.recip(), rate_hz, is_beyond.len());
                    *is_whole &= !is_beyond[rows].contains(&true);
                }
                let within = asked_nm.iter().map(|nm| nm.clamp(-limit_nm, limit_nm));
                within.collect()
            })
        }
        None => None,
    };
    let has_command = read.torque == Some(TorqueSource::Drive)
        && columns.signals.contains_key(&Signal::CommandTorqueNm);
    let command_nm = if has_command {
        Some(of(Signal::CommandTorqueNm, ratio)?.0)
    } else {
        None
    };
    let sensor_nm = if read.has_sensor_beside {
        let (sensor_nm, whole) = of(Signal::JointTorqueNm, 1.0)?;
        let mut both = is_whole.iter().zip(whole);
        both.all(|(torque, sensor)| sensor || !torque)
            .then_some(sensor_nm)
    } else {
        None
    };
    let limited = |values: Option<Vec<f64>>| -> Result<Option<Vec<f64>>, FilterError> {
        let smooth = values.map(|values| motion.limit(&values)).transpose()?;
        Ok(smooth.map(|smooth| thinned(&smooth, every)))
    };
    let noise_nm = match read.torque {
        // its torque's steps are the reference's
        Some(TorqueSource::Controller) => noise_of_controller(robot, index, &raw_rad, rate_hz),
        _ => torque_nm.as_deref().and_then(noise_std),
    };
    let step_rad = recording::step(&raw_rad);
    let velocity_rad_s = derivative(&smooth_rad, 1.0 / rate_hz);
    let moving = is_moving(&raw_rad, &velocity_rad_s, step_rad, rate_hz);
    let measured_nm = torque_nm
        .as_ref()
        .filter(|_| read.torque != Some(TorqueSource::Controller));
    let fast_nm = match measured_nm {
        Some(all_nm) => {
            let slow_nm = Band::of(rate_hz, up_to(COMPARED_HZ, rate_hz)).limit(all_nm)?;
            let counts = |row: &usize| is_whole[*row] && moving[*row];
            let rows: Vec<usize> = (0..all_nm.len()).filter(counts).collect();
            let square = rows
                .iter()
                .map(|row| (all_nm[*row] - slow_nm[*row]).powi(2));
            (square.sum::<f64>() / rows.len().max(1) as f64).sqrt()
        }
        None => 0.0,
    };
    Ok(JointMotion {
        // the piece's
        time_s: Vec::new(),
        noise_nm: noise_nm.unwrap_or(0.0),
        fast_nm,
        step_rad: step_rad.map(|step_rad| step_rad / scale.abs()),
        recorded_hz: rate_hz,
        velocity_rad_s: thinned(&velocity_rad_s, every),
        acceleration_rad_s2: thinned(&second_derivative(&smooth_rad, 1.0 / rate_hz), every),
        position_rad: thinned(&smooth_rad, every),
        torque_nm: limited(torque_nm)?,
        rate_feed_nm: limited(rate_feed_nm)?,
        late_nm_s: limited(late_nm_s)?,
        command_nm: limited(command_nm)?,
        sensor_nm: limited(sensor_nm)?,
        at_limit_part,
        is_whole: is_whole.into_iter().step_by(every).collect(),
        is_moving: moving.into_iter().step_by(every).collect(),
    })
}

/// Row by row, whether a joint moves, and has and will as far as the compared band reaches: while it stands friction may be anything up to
/// its breakaway. It stands where it goes no further than its encoder's step and noise, in the time in which it
/// usually goes three times as far, and no less than a period of motion. Where that is more than one of the band, nothing tells motion from
/// standing.
fn is_moving(
    position_rad: &[f64],
    velocity_rad_s: &[f64],
    step_rad: Option<f64>,
    rate_hz: f64,
) -> Vec<bool> {
    // one step to and fro is no motion; nor is noise within its deviations to both sides
    let of_step_rad = 1.5 * step_rad.unwrap_or(0.0);
    let still_rad = of_step_rad.max(2.0 * DEVIATIONS * noise_std(position_rad).unwrap_or(0.0));
    let square = velocity_rad_s.iter().map(|v| v * v).sum::<f64>();
    let usual_rad_s = (square / velocity_rad_s.len().max(1) as f64).sqrt();
    let time_s = DEVIATIONS * still_rad / usual_rad_s.max(f64::MIN_POSITIVE);
    if time_s > COMPARED_HZ.recip() {
        return vec![false; position_rad.len()];
    }
    let time_s = time_s.max(MOTION_HZ.recip());
    let rows = position_rad.len();
    let stands: Vec<bool> = (0..rows)
        .map(|row| {
            let ends = (f64::INFINITY, f64::NEG_INFINITY);
            let (least, most) = position_rad[near(row, time_s, rate_hz, rows)]
                .iter()
                .fold(ends, |(least, most), rad| (least.min(*rad), most.max(*rad)));
            most - least <= still_rad
        })
        .collect();
    // the band's filter goes over the rows both ways
    (0..rows)
        .map(|row| !near(row, COMPARED_HZ.recip(), rate_hz, rows).any(|row| stands[row]))
        .collect()
}

/// Rows about one, within half of a time to either side.
fn near(row: usize, time_s: f64, rate_hz: f64, rows: usize) -> Range<usize> {
    let around = (0.5 * time_s * rate_hz).ceil() as usize;
    row.saturating_sub(around)..(row + around + 1).min(rows)
}

fn part(is_so: &[bool]) -> f64 {
    let count = is_so.iter().filter(|is_so| **is_so).count();
    count as f64 / is_so.len().max(1) as f64
}

fn thinned(values: &[f64], every: usize) -> Vec<f64> {
    values.iter().copied().step_by(every).collect()
}

fn velocity_reference(columns: &JointColumns, grid: &Grid) -> Option<Vec<f64>> {
    let values = columns.measured(Signal::ReferenceVelocityRadS)?;
    Some(grid.sample(values, 1.0).0)
}

/// Torque that the robot file's controller asks for, joint side: `kp·(reference - q) + kd·(reference rate - q̇)`, from the sample at which
/// it acts.
fn asked(
    robot: &Robot,
    joint: usize,
    reference_rad: &[f64],
    position_rad: &[f64],
    rate_rad_s: Option<Vec<f64>>,
    rate_hz: f64,
) -> Option<Vec<f64>> {
    let control = controller(robot)?;
    let rate_rad_s = rate_rad_s.unwrap_or_else(|| derivative(reference_rad, 1.0 / rate_hz));
    let velocity_rad_s = derivative(position_rad, 1.0 / rate_hz);
    let [kp, kd] = [
        control.proportional_nm_rad[joint],
        control.derivative_nm_s_rad[joint],
    ];
    let rows = 0..position_rad.len();
    let torque_nm = rows.map(|k| {
        let spring_nm = kp * (reference_rad[k] - position_rad[k]);
        let damper_nm = kd * (rate_rad_s[k] - velocity_rad_s[k]);
        spring_nm + damper_nm
    });
    Some(torque_nm.collect())
}

/// What a joint's drive gives at most, joint side.
fn limit_nm(robot: &Robot, joint: usize) -> f64 {
    let file = &robot.joints[joint];
    file.torque_limit_nm
        .map_or(f64::INFINITY, |limit_nm| limit_nm * file.gear_ratio.abs())
}

/// Noise of the controller's torque, joint side: what it makes of the position's.
fn noise_of_controller(
    robot: &Robot,
    joint: usize,
    position_rad: &[f64],
    rate_hz: f64,
) -> Option<f64> {
    let control = controller(robot)?;
    let kp = control.proportional_nm_rad[joint];
    let kd = control.derivative_nm_s_rad[joint];
    let velocity_rad_s = derivative(position_rad, 1.0 / rate_hz);
    let both = position_rad.iter().zip(&velocity_rad_s);
    let torque_nm: Vec<f64> = both.map(|(q, v)| kp * q + kd * v).collect();
    noise_std(&torque_nm)
}

/// `kd` times the reference's rate.
fn rate_feed(robot: &Robot, joint: usize, reference_rad: &[f64], rate_hz: f64) -> Option<Vec<f64>> {
    let kd = controller(robot)?.derivative_nm_s_rad[joint];
    let rate_rad_s = derivative(reference_rad, 1.0 / rate_hz);
    Some(rate_rad_s.iter().map(|rate| kd * rate).collect())
}

/// `kp` times the reference's rate: what its stiffness makes of a reference that is a second later, to first order.
fn late(robot: &Robot, joint: usize, reference_rad: &[f64], rate_hz: f64) -> Option<Vec<f64>> {
    let kp = controller(robot)?.proportional_nm_rad[joint];
    let rate_rad_s = derivative(reference_rad, 1.0 / rate_hz);
    Some(rate_rad_s.iter().map(|rate| kp * rate).collect())
}

/// Standard deviation of the time by which torque and position of a recording may be apart.
pub fn apart_s(recorded_hz: f64) -> f64 {
    CLOCK_S.hypot(1.0 / recorded_hz)
}

impl JointMotion {
    /// How far it goes.
    pub fn range_rad(&self) -> f64 {
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let (least, most) = self.position_rad.iter().fold(ends, |(least, most), rad| {
            (f64::min(least, *rad), f64::max(most, *rad))
        });
        most - least
    }

    /// How a torque at so many rows a second changes by a standard deviation of its samples' time.
    pub fn clock_nm(&self, torque_nm: &[f64], rate_hz: f64) -> Vec<f64> {
        let apart_s = apart_s(self.recorded_hz);
        let rate = derivative(torque_nm, 1.0 / rate_hz);
        rate.iter().map(|rate| apart_s * rate).collect()
    }

    /// The torque; of a controller that `feeds_rate` or does not, where nothing tells that.
    pub fn torque_nm(&self, feeds_rate: bool) -> Option<Cow<'_, [f64]>> {
        let torque_nm = self.torque_nm.as_ref()?;
        match &self.rate_feed_nm {
            Some(feed_nm) if !feeds_rate => {
                let both = torque_nm.iter().zip(feed_nm);
                Some(Cow::Owned(both.map(|(all, feed)| all - feed).collect()))
            }
            _ => Some(Cow::Borrowed(torque_nm)),
        }
    }
}
