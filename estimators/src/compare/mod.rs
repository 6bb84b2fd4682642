//! Comparison of a joint's estimators with a torque sensor, on a recording they were not calibrated on.
//!
//! Rows are told apart by what the joint does: it stands, or it moves; and within motion, whether it has just reversed. A
//! reference from a sensor is an error of its own noise at least.

mod phases;
mod statistics;

pub use phases::{Phases, STANDING_AFTER_S, STANDING_RAD_S};
pub use statistics::{Drift, Errors};

use recording::{MissingSignal, Recording, Signal};
use robot::{Robot, RobotJoint};
use serde::Serialize;

use crate::{Estimate, JointLog, Kind, Missing, TorqueEstimator};

/// Filters of the estimators have forgotten how they began.
const SETTLING_S: f64 = 0.5;

/// One joint's part of a recording, ready to be compared with.
#[derive(Clone, Debug)]
pub struct Judge {
    /// The samples.
    pub log: JointLog,
    /// What the joint does in each row.
    pub phases: Phases,
    /// Rows that count: settled, and with a reference.
    usable: Vec<bool>,
}

/// How one estimator did on one recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// Which.
    pub kind: Kind,
    /// Why there is no estimate, where there is none in any row.
    pub missing: Option<String>,
    /// While the joint moves.
    pub dynamic: Option<Errors>,
    /// While it stands.
    pub static_load: Option<Errors>,
    /// Around reversals of the motion.
    pub reversals: Option<Errors>,
    /// All rows.
    pub all: Option<Errors>,
    /// How far behind the reference, by the largest correlation in motion, if that lies within -10 to 40 ms at 1.5 kHz.
    pub delay_ms: Option<f64>,
    /// Sample to sample, while the joint stands.
    pub noise_nm: Option<f64>,
    /// Over the longest hold.
    pub drift: Option<Drift>,
    /// Share of rows whose error lies within 1.96 of the estimator's own standard deviations.
    pub coverage_95: Option<f64>,
    /// Rows with a reference in which the estimator gave nothing.
    pub rows_without: usize,
}

impl Judge {
    /// Reads the joint's samples and its torque sensor.
    ///
    /// # Errors
    /// [`MissingSignal`] if there is no such joint, no torque sensor or no motor position.
    pub fn new(
        recording: &Recording,
        robot: &Robot,
        joint: &RobotJoint,
    ) -> Result<Self, MissingSignal> {
        JointLog::need(
            recording,
            &joint.name,
            &[Signal::JointTorqueNm, Signal::MotorPositionRad],
        )?;
        let log = JointLog::new(recording, robot, joint)?;
        let settled = log.settled(SETTLING_S);
        let usable = settled
            .iter()
            .zip(&log.joint_torque_nm)
            .map(|(settled, nm)| *settled && nm.is_finite());
        Ok(Self {
            usable: usable.collect(),
            phases: Phases::of(&log, joint.gear_ratio),
            log,
        })
    }

    /// The estimator's answers to all samples. Nothing else happens here, so that it may be timed.
    pub fn run(&self, estimator: &mut dyn TorqueEstimator) -> Vec<Result<Estimate, Missing>> {
        let samples = self.log.samples.iter();
        samples.map(|sample| estimator.estimate(sample)).collect()
    }

    /// How the answers compare with the reference.
    pub fn score(&self, kind: Kind, answers: &[Result<Estimate, Missing>]) -> Score {
        let errors: Vec<f64> = (0..answers.len())
            .map(|row| match &answers[row] {
                Ok(found) if self.usable[row] => found.torque_nm - self.log.joint_torque_nm[row],
                _ => f64::NAN,
            })
            .collect();
        let rows = |wanted: &dyn Fn(usize) -> bool| {
            let chosen = (0..errors.len()).filter(|row| wanted(*row));
            Errors::of(chosen.map(|row| errors[row]))
        };
        let all = rows(&|_| true);
        let phases = &self.phases;
        let without = (0..errors.len()).filter(|row| self.usable[*row] && answers[*row].is_err());
        let why = answers.iter().find_map(|answer| answer.as_ref().err());
        Score {
            kind,
            missing: all.is_none().then(|| {
                why.map_or_else(|| "no row has a reference".to_owned(), ToString::to_string)
            }),
            dynamic: rows(&|row| !phases.stands[row]),
            static_load: rows(&|row| phases.stands[row]),
            reversals: rows(&|row| phases.reverses[row]),
            all,
            delay_ms: self.delay_ms(answers),
            noise_nm: self.noise_nm(answers),
            drift: self.drift(&errors),
            coverage_95: self.coverage(answers, &errors),
            rows_without: without.count(),
        }
    }

    fn torques_nm(answers: &[Result<Estimate, Missing>]) -> Vec<f64> {
        let torque = |answer: &Result<Estimate, Missing>| {
            answer.as_ref().map_or(f64::NAN, |found| found.torque_nm)
        };
        answers.iter().map(torque).collect()
    }

    fn delay_ms(&self, answers: &[Result<Estimate, Missing>]) -> Option<f64> {
        let rows: Vec<usize> = (0..answers.len())
            .filter(|row| self.usable[*row] && !self.phases.stands[*row])
            .collect();
        let torques = Self::torques_nm(answers);
        let lag = statistics::lag_rows(&torques, &self.log.joint_torque_nm, &rows)?;
        Some(1e3 * lag * self.log.period_s)
    }

    fn noise_nm(&self, answers: &[Result<Estimate, Missing>]) -> Option<f64> {
        let rows: Vec<usize> = (0..answers.len())
            .filter(|row| self.usable[*row] && self.phases.stands[*row])
            .collect();
        statistics::noise(&Self::torques_nm(answers), &rows)
    }

    fn drift(&self, errors: &[f64]) -> Option<Drift> {
        let hold = self.phases.longest_hold()?;
        Drift::over(&errors[hold.clone()], &self.log.time_s[hold])
    }

    fn coverage(&self, answers: &[Result<Estimate, Missing>], errors: &[f64]) -> Option<f64> {
        const SIGMAS: f64 = 1.96;
        let inside: Vec<bool> = answers
            .iter()
            .zip(errors)
            .filter(|(_, error)| error.is_finite())
            .filter_map(|(answer, error)| {
                let std_nm = answer.as_ref().ok()?.std_nm?;
                Some(error.abs() <= SIGMAS * std_nm)
            })
            .collect();
        let count = inside.iter().filter(|inside| **inside).count();
        (!inside.is_empty()).then(|| count as f64 / inside.len() as f64)
    }
}
