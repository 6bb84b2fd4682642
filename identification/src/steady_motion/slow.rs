//! Slow motion in a recording: where each joint moves steadily, which way, and with what torque.
//!
//! Velocity is the difference of the mean positions of a tenth of a second before and after a row, so it needs no
//! velocity signal and noise of the encoder averages out.

use joint_model::friction::Direction;
use recording::{Recording, Signal};
use robot::Robot;

use super::check_measured;
use crate::IdentificationError;
use crate::statistics::root_mean_square;

/// Half of the time a velocity is taken over.
const HALF_WINDOW_S: f64 = 0.1;

/// Slower, a joint may be creeping in its own elasticity; PA10-03 measured friction from 0.005 rad/s on.
const SLOWEST_RAD_S: f64 = 0.002;

/// Faster, centrifugal torque of a stretched arm comes to more than a few hundredths of a Nm per kg of arm.
const FASTEST_RAD_S: f64 = 0.2;

/// Larger, inertia takes more torque than gravity can be told by: 1 kg m² takes 0.05 Nm.
const MOST_ACCELERATION_RAD_S2: f64 = 0.05;

/// Travel after rest or reversal until friction has wound the gear up: 80 Nm on 10 000 Nm/rad are 0.008 rad.
const SETTLING_RAD: f64 = 0.01;

/// Share of its root mean square by which torque may seem to gain energy: gravity of a payload nobody wrote down.
const GAIN_ALLOWED: f64 = 0.1;

/// Rows of one trajectory, and of them those in which every signal was measured.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    /// In the chain's order.
    pub joints: Vec<JointMotion>,
    /// How many rows every column has.
    pub rows: usize,
    /// Rows over which a velocity is taken, each way.
    pub window_rows: usize,
}

/// One joint's columns, joint side unless named otherwise.
#[derive(Clone, Debug)]
pub(crate) struct JointMotion {
    pub position_rad: Vec<f64>,
    pub motor_position_rad: Vec<f64>,
    pub velocity_rad_s: Vec<f64>,
    /// Motor torque times gear ratio; empty for a joint whose torque was not asked for.
    pub torque_nm: Vec<f64>,
    /// Where the joint moves slowly, steadily and with its gear wound up.
    pub direction: Vec<Option<Direction>>,
}

/// The trajectories of a recording, with the torque of the joints in `with_torque` (indices in the chain).
pub(crate) fn runs(
    recording: &Recording,
    robot: &Robot,
    with_torque: &[usize],
) -> Result<Vec<Run>, IdentificationError> {
    let columns: Vec<Columns> = robot
        .joints
        .iter()
        .enumerate()
        .map(|(index, joint)| {
            Columns::find(
                recording,
                &joint.name,
                joint.gear_ratio,
                with_torque.contains(&index),
            )
        })
        .collect::<Result<_, _>>()?;
    let runs = recording.segments().into_iter().filter_map(|segment| {
        let measured = |row: &usize| {
            recording.time_s[*row].is_finite() && columns.iter().all(|joint| joint.measured(*row))
        };
        let rows: Vec<usize> = segment.filter(measured).collect();
        run(&recording.time_s, &rows, &columns)
    });
    Ok(runs.collect())
}

/// The position signal that tells where a joint is: the link encoder's if there is one.
pub(crate) fn position_signal(recording: &Recording, joint: &str) -> Signal {
    let has_link = recording
        .joint(joint)
        .is_ok_and(|columns| columns.signals.contains_key(&Signal::LinkPositionRad));
    if has_link {
        Signal::LinkPositionRad
    } else {
        Signal::MotorPositionRad
    }
}

/// How fast a joint moved at most.
pub(crate) fn fastest_rad_s<'a>(runs: impl IntoIterator<Item = &'a Run>, joint: usize) -> f64 {
    let runs = runs.into_iter();
    let speeds = runs.flat_map(|run| &run.joints[joint].velocity_rad_s);
    speeds.fold(0.0, |most: f64, velocity| most.max(velocity.abs()))
}

/// Why a joint has no slow motion in a direction: it never moved at all, or only otherwise.
pub(crate) fn no_slow_motion(
    joint: &str,
    (signal, most_rad_s): (Signal, f64),
    direction: Direction,
) -> IdentificationError {
    let joint = joint.to_owned();
    if most_rad_s < SLOWEST_RAD_S {
        return IdentificationError::NeverMoved {
            joint,
            signal,
            most_rad_s,
        };
    }
    IdentificationError::NoSlowMotion {
        joint,
        signal,
        direction,
    }
}

/// That the torque spends energy: about gravity it is larger one way than the other, in the sense of the motion.
///
/// `along_nm` are values of torque less gravity torque times the sign of the motion, `torque_nm` the torques themselves.
pub(crate) fn check_sign(
    joint: &str,
    along_nm: &[f64],
    torque_nm: &[f64],
) -> Result<(), IdentificationError> {
    let mean_nm = along_nm.iter().sum::<f64>() / along_nm.len().max(1) as f64;
    let rms_nm = root_mean_square(torque_nm.iter().copied());
    if mean_nm >= -GAIN_ALLOWED * rms_nm || along_nm.is_empty() {
        return Ok(());
    }
    Err(IdentificationError::ReversedSign {
        joint: joint.to_owned(),
        signal: Signal::MotorTorqueNm,
        evidence: format!(
            "besides gravity it pulls against the motion by {:.3} Nm at the joint on average",
            -mean_nm
        ),
    })
}

/// One joint's signals in the file.
struct Columns<'a> {
    position: &'a [f64],
    torque: Option<&'a [f64]>,
    /// From the position signal to the joint side.
    to_joint: f64,
    gear_ratio: f64,
    /// The motor's own angle, if the position is another one.
    motor: Option<&'a [f64]>,
}

impl<'a> Columns<'a> {
    /// The link encoder tells the pose; without one the motor's does, over the gear ratio, up to the gear's twist.
    fn find(
        recording: &'a Recording,
        joint: &str,
        gear_ratio: f64,
        with_torque: bool,
    ) -> Result<Self, IdentificationError> {
        let signals = &recording.joint(joint)?.signals;
        let torque = with_torque
            .then(|| measured_signal(recording, joint, Signal::MotorTorqueNm))
            .transpose()?;
        let link = signals.contains_key(&Signal::LinkPositionRad);
        let motor = signals
            .contains_key(&Signal::MotorPositionRad)
            .then(|| measured_signal(recording, joint, Signal::MotorPositionRad))
            .transpose()?;
        if link {
            return Ok(Self {
                position: measured_signal(recording, joint, Signal::LinkPositionRad)?,
                torque,
                to_joint: 1.0,
                gear_ratio,
                motor,
            });
        }
        Ok(Self {
            position: measured_signal(recording, joint, Signal::MotorPositionRad)?,
            torque,
            to_joint: 1.0 / gear_ratio,
            gear_ratio,
            motor,
        })
    }

    fn measured(&self, row: usize) -> bool {
        let all = [Some(self.position), self.torque, self.motor];
        all.into_iter()
            .flatten()
            .all(|signal| signal.get(row).is_some_and(|value| value.is_finite()))
    }
}

/// A signal of which at least half is there.
fn measured_signal<'a>(
    recording: &'a Recording,
    joint: &str,
    signal: Signal,
) -> Result<&'a [f64], IdentificationError> {
    let values = recording.signal(joint, signal)?;
    check_measured(joint, signal, values, 0..values.len(), &recording.time_s)?;
    Ok(values)
}

/// Nothing where the rows span less than the windows of a velocity and its change.
fn run(time_s: &[f64], rows: &[usize], columns: &[Columns]) -> Option<Run> {
    let (first, last) = (*rows.first()?, *rows.last()?);
    let rate_hz = (rows.len() - 1) as f64 / (time_s[last] - time_s[first]);
    let window = (HALF_WINDOW_S * rate_hz).round().max(1.0);
    // A rate that is no number, from a time that stands still, is as bad as too few rows.
    if !window.is_finite() || 4.0 * window >= rows.len() as f64 {
        return None;
    }
    let window = window as usize;
    let pick = |values: &[f64], factor: f64| -> Vec<f64> {
        rows.iter().map(|row| factor * values[*row]).collect()
    };
    let time_s = pick(time_s, 1.0);
    let joints = columns.iter().map(|joint| {
        let position_rad = pick(joint.position, joint.to_joint);
        let velocity_rad_s = velocities(&time_s, &position_rad, window);
        JointMotion {
            motor_position_rad: joint.motor.map_or_else(
                || pick(joint.position, joint.to_joint * joint.gear_ratio),
                |motor| pick(motor, 1.0),
            ),
            torque_nm: joint
                .torque
                .map(|torque| pick(torque, joint.gear_ratio))
                .unwrap_or_default(),
            direction: directions(&time_s, &position_rad, &velocity_rad_s, window),
            position_rad,
            velocity_rad_s,
        }
    });
    Some(Run {
        joints: joints.collect(),
        rows: rows.len(),
        window_rows: window,
    })
}

/// Difference of the means over `window` rows after and before each row; zero where there are not as many.
fn velocities(time_s: &[f64], position_rad: &[f64], window: usize) -> Vec<f64> {
    let (time_s, position_rad) = (sums(time_s), sums(position_rad));
    let rows = time_s.len() - 1;
    let velocity = |row: usize| {
        if row < window || row + window >= rows {
            return 0.0;
        }
        let apart = |sums: &[f64]| {
            (sums[row + 1 + window] - sums[row + 1]) - (sums[row] - sums[row - window])
        };
        let velocity = apart(&position_rad) / apart(&time_s);
        if velocity.is_finite() { velocity } else { 0.0 }
    };
    (0..rows).map(velocity).collect()
}

/// Sums of the values before each, counted from the first value to keep their digits.
fn sums(values: &[f64]) -> Vec<f64> {
    let origin = values[0];
    let mut sum = 0.0;
    let running = values.iter().map(|value| {
        sum += value - origin;
        sum
    });
    // Differences of as many values each: the origin cancels.
    std::iter::once(0.0).chain(running).collect()
}

fn directions(
    time_s: &[f64],
    position_rad: &[f64],
    velocity_rad_s: &[f64],
    window: usize,
) -> Vec<Option<Direction>> {
    let rows = time_s.len();
    let slow = SLOWEST_RAD_S..=FASTEST_RAD_S;
    let steady = |row: usize| {
        if row < 2 * window || row + 2 * window >= rows {
            return false;
        }
        let (before, after) = (row - window, row + window);
        let change_rad_s = velocity_rad_s[after] - velocity_rad_s[before];
        slow.contains(&velocity_rad_s[row].abs())
            && change_rad_s.abs() <= 0.5 * velocity_rad_s[row].abs()
            && change_rad_s.abs() <= MOST_ACCELERATION_RAD_S2 * (time_s[after] - time_s[before])
    };
    let mut turned_at_rad = position_rad[0];
    let mut last = None;
    (0..rows)
        .map(|row| {
            let moving = velocity_rad_s[row].abs() >= SLOWEST_RAD_S;
            let direction = moving.then(|| Direction::of(velocity_rad_s[row]));
            if direction.is_none() || direction != last {
                turned_at_rad = position_rad[row];
            }
            last = direction;
            let settled = (position_rad[row] - turned_at_rad).abs() >= SETTLING_RAD;
            direction.filter(|_| settled && steady(row))
        })
        .collect()
}
