//! One joint's part of a recording, as estimators take it.

use joint_model::rigid_body::Chain;
use recording::{MissingSignal, Recording, Signal};
use robot::{Robot, RobotJoint};

use crate::{GAP_MAX_CYCLES, Sample};

/// One joint's samples in their order, of all segments.
#[derive(Clone, Debug)]
pub struct JointLog {
    /// Of the measurement.
    pub time_s: Vec<f64>,
    /// A segment begins so many cycles after the one before that every estimator starts again.
    pub samples: Vec<Sample>,
    /// Torque sensor at the gear's output; NaN where there is none.
    pub joint_torque_nm: Vec<f64>,
    /// The model's gravity torque at the measured position of the whole arm.
    pub gravity_nm: Vec<f64>,
    /// Of the control loop.
    pub period_s: f64,
}

impl JointLog {
    /// The joint's samples. A signal that is not in the recording is NaN throughout: see [`JointLog::need`].
    ///
    /// # Errors
    /// [`MissingSignal`] if the recording has no such joint.
    pub fn new(
        recording: &Recording,
        robot: &Robot,
        joint: &RobotJoint,
    ) -> Result<Self, MissingSignal> {
        recording.joint(&joint.name)?;
        let period_s = 1.0 / recording.sample_rate_hz;
        let absent = vec![f64::NAN; recording.rows()];
        let column = |signal| {
            recording
                .signal(&joint.name, signal)
                .map_or_else(|_| absent.clone(), <[f64]>::to_vec)
        };
        let gravity_nm = gravity_nm(recording, robot, joint);
        let motor_position_rad = column(Signal::MotorPositionRad);
        let link_position_rad = column(Signal::LinkPositionRad);
        let motor_torque_nm = column(Signal::MotorTorqueNm);
        let cycles = cycles(recording, period_s);
        let samples = (0..recording.rows()).map(|row| Sample {
            cycle: cycles[row],
            motor_position_rad: motor_position_rad[row],
            link_position_rad: link_position_rad[row],
            motor_torque_nm: motor_torque_nm[row],
            load_nm: gravity_nm[row],
        });
        Ok(Self {
            time_s: recording.time_s.clone(),
            samples: samples.collect(),
            joint_torque_nm: column(Signal::JointTorqueNm),
            gravity_nm,
            period_s,
        })
    }

    /// That a signal was measured at least once.
    ///
    /// # Errors
    /// [`MissingSignal`] names it and what is there.
    pub fn need(
        recording: &Recording,
        joint: &str,
        signals: &[Signal],
    ) -> Result<(), MissingSignal> {
        signals
            .iter()
            .try_for_each(|signal| recording.signal(joint, *signal).map(drop))
    }

    /// Rows.
    pub fn rows(&self) -> usize {
        self.samples.len()
    }

    /// Rows so long after the beginning of their segment, or after a gap, that estimators have settled.
    pub fn settled(&self, settling_s: f64) -> Vec<bool> {
        let mut begun_s = f64::NEG_INFINITY;
        let mut before: Option<u64> = None;
        let row = |(sample, time_s): (&Sample, &f64)| {
            let gap = before.is_none_or(|cycle| sample.cycle - cycle > GAP_MAX_CYCLES);
            if gap {
                begun_s = *time_s;
            }
            before = Some(sample.cycle);
            *time_s - begun_s >= settling_s
        };
        self.samples.iter().zip(&self.time_s).map(row).collect()
    }

    /// Link speed over a window around each row, by the motor encoder; NaN where the window is not whole.
    pub fn slow_velocity_rad_s(&self, gear_ratio: f64, half_window_s: f64) -> Vec<f64> {
        let half = (half_window_s / self.period_s).round().max(1.0) as usize;
        (0..self.rows())
            .map(|row| {
                let (Some(first), Some(last)) = (
                    row.checked_sub(half).map(|row| &self.samples[row]),
                    self.samples.get(row + half),
                ) else {
                    return f64::NAN;
                };
                let cycles = (last.cycle - first.cycle) as f64;
                if cycles > 3.0 * half as f64 {
                    return f64::NAN;
                }
                (last.motor_position_rad - first.motor_position_rad)
                    / (gear_ratio * cycles * self.period_s)
            })
            .collect()
    }
}

/// The cycle of each row, from its time; rows of one instant count on.
fn cycles(recording: &Recording, period_s: f64) -> Vec<u64> {
    let mut cycles = vec![0; recording.rows()];
    let mut next = 0;
    for rows in recording.segments() {
        let begun_s = recording.time_s[rows.start];
        let first = next + GAP_MAX_CYCLES + 1;
        for row in rows {
            let since = ((recording.time_s[row] - begun_s) / period_s).round() as u64;
            cycles[row] = (first + since).max(next);
            next = cycles[row] + 1;
        }
    }
    cycles
}

/// Gravity at the measured motor angles; joints that the recording does not have count as at zero.
fn gravity_nm(recording: &Recording, robot: &Robot, joint: &RobotJoint) -> Vec<f64> {
    let chain: &Chain = &robot.chain;
    let index = robot.joint_index(&joint.name).unwrap_or_default();
    let positions: Vec<Option<&[f64]>> = robot
        .joints
        .iter()
        .map(|joint| recording.signal(&joint.name, Signal::MotorPositionRad).ok())
        .collect();
    let mut position_rad = vec![0.0; positions.len()];
    let mut torque_nm = vec![0.0; positions.len()];
    (0..recording.rows())
        .map(|row| {
            for ((place, column), joint) in
                position_rad.iter_mut().zip(&positions).zip(&robot.joints)
            {
                let motor_rad = column.map_or(0.0, |column| column[row]);
                if motor_rad.is_finite() {
                    *place = motor_rad / joint.gear_ratio;
                }
            }
            chain.gravity_torque(&position_rad, &mut torque_nm);
            torque_nm[index]
        })
        .collect()
}
