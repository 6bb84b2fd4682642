//! How well the robot followed and how well its torque was estimated, summed up row by row.

use std::collections::BTreeMap;

use estimators::Kind;
use joint_model::rigid_body::Chain;
use recording::Signal;
use robot::Robot;
use serde::{Deserialize, Serialize};
use shm_types::messages::{Command, LoopState, PerJoint, Readings, TorqueEstimate, Validity};

use crate::estimators::of;
use crate::relay::CycleMessages;

/// File of the relay's report in the instance's directory.
pub const TRACKING_REPORT_FILE: &str = "tracking-report.json";

/// Rows this long after the first moving one count as after the start (PA10-05 tells the two apart).
const START_S: f64 = 2.0;

/// Means and maxima of an error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorSummary {
    /// Rows counted.
    pub count: u64,
    /// Mean with its sign; of a distance, the mean distance.
    pub mean: f64,
    /// Mean magnitude.
    pub mean_magnitude: f64,
    /// Root mean square.
    pub rms: f64,
    /// Largest magnitude.
    pub max: f64,
    /// Largest magnitude after the first two seconds.
    pub max_after_start: f64,
}

/// The same, being summed.
#[derive(Clone, Copy, Debug, Default)]
struct ErrorSum {
    count: u64,
    sum: f64,
    magnitude_sum: f64,
    square_sum: f64,
    max: f64,
    max_after_start: f64,
}

impl ErrorSum {
    fn add(&mut self, error: f64, after_start: bool) {
        if !error.is_finite() {
            return;
        }
        self.count += 1;
        self.sum += error;
        self.magnitude_sum += error.abs();
        self.square_sum += error * error;
        self.max = self.max.max(error.abs());
        if after_start {
            self.max_after_start = self.max_after_start.max(error.abs());
        }
    }

    fn summary(&self) -> Option<ErrorSummary> {
        let count = self.count as f64;
        (self.count > 0).then(|| ErrorSummary {
            count: self.count,
            mean: self.sum / count,
            mean_magnitude: self.magnitude_sum / count,
            rms: (self.square_sum / count).sqrt(),
            max: self.max,
            max_after_start: self.max_after_start,
        })
    }
}

/// One joint's results.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointTracking {
    /// Its name.
    pub joint: String,
    /// Reference minus link position.
    pub position_error_rad: Option<ErrorSummary>,
    /// What the feedback had to add, joint side.
    pub feedback_torque_nm: Option<ErrorSummary>,
    /// Estimate minus the torque truly transmitted, estimator by estimator.
    pub estimate_errors_nm: BTreeMap<Kind, ErrorSummary>,
    /// Estimators that never gave a torque, each with the signal that was never measured.
    pub missing_signals: BTreeMap<Kind, String>,
    /// What is estimated to push the link from outside.
    pub external_torque_nm: Option<ErrorSummary>,
    /// How often that went beyond its threshold.
    pub contacts: u64,
    /// When it did for the first time, from the first row in which the loop was running.
    pub first_contact_s: Option<f64>,
}

/// The relay's account of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackingReport {
    /// Where positions and torques to compare with come from: `plant`, or the robot's own `sensors`.
    pub compared_with: String,
    /// Per joint.
    pub joints: Vec<JointTracking>,
    /// Distance of the tool from where it should be.
    pub end_effector_error_m: Option<ErrorSummary>,
    /// Rows in which the loop was running.
    pub running_rows: u64,
    /// Rows written to the recording.
    pub recorded_rows: u64,
    /// Cycles the loop has run that never reached the relay.
    pub lost_rows: u64,
    /// Messages that came too late for their row.
    pub late_messages: u64,
    /// Messages of cycles that cannot be.
    pub refused_messages: u64,
    /// The recordings written, in order; a relay that was killed leaves one, its successor goes on in the next.
    pub recordings: Vec<String>,
    /// Why recording ended early, if it did.
    pub recording_error: Option<String>,
}

/// What torque estimators live on.
const ESTIMATED_FROM: [Signal; 3] = [
    Signal::MotorPositionRad,
    Signal::LinkPositionRad,
    Signal::MotorTorqueNm,
];

#[derive(Clone, Copy, Debug, Default)]
struct JointSums {
    position_rad: ErrorSum,
    feedback_nm: ErrorSum,
    estimates_nm: [ErrorSum; Kind::ALL.len()],
    /// The estimators that the service has for this joint.
    running: [bool; Kind::ALL.len()],
    /// Which of [`ESTIMATED_FROM`] were measured at least once.
    measured: [bool; ESTIMATED_FROM.len()],
    external_nm: ErrorSum,
    is_contact: bool,
    contacts: u64,
    first_contact_s: Option<f64>,
}

impl JointSums {
    fn add_estimates(
        &mut self,
        estimate: &TorqueEstimate,
        joint: usize,
        torque_nm: f64,
        since_s: f64,
    ) {
        let after_start = since_s > START_S;
        for (place, kind) in Kind::ALL.into_iter().enumerate() {
            let said = of(estimate, kind);
            self.running[place] |= said.validity[joint] != Validity::Absent as u32;
            let [estimate_nm, _] = said.valid_nm(joint);
            self.estimates_nm[place].add(estimate_nm - torque_nm, after_start);
        }
        self.external_nm
            .add(estimate.external.torque_nm[joint], after_start);
        let is_contact = (estimate.external.contact_joints >> joint) & 1 == 1;
        if is_contact && !self.is_contact {
            self.contacts += 1;
            self.first_contact_s.get_or_insert(since_s);
        }
        self.is_contact = is_contact;
    }

    fn note_measured(&mut self, readings: &Readings, joint: usize) {
        let values = [
            readings.motor_position_rad[joint],
            readings.link_position_rad[joint],
            readings.motor_torque_nm[joint],
        ];
        for (measured, value) in self.measured.iter_mut().zip(values) {
            *measured |= value.is_finite();
        }
    }

    fn missing_signals(&self) -> BTreeMap<Kind, String> {
        let running = Kind::ALL.into_iter().zip(self.running);
        let missing = |kind: Kind| {
            let all = ESTIMATED_FROM.into_iter().zip(self.measured);
            let mut never = all.filter(|(_, measured)| !measured);
            never.find(|(signal, _)| kind.needs().contains(signal))
        };
        running
            .filter(|(_, running)| *running)
            .filter_map(|(kind, _)| Some((kind, missing(kind)?.0.to_string())))
            .collect()
    }

    fn estimate_errors_nm(&self) -> BTreeMap<Kind, ErrorSummary> {
        let sums = Kind::ALL.into_iter().zip(&self.estimates_nm);
        sums.filter_map(|(kind, sum)| Some((kind, sum.summary()?)))
            .collect()
    }
}

/// Sums up rows of one robot.
#[derive(Clone, Debug)]
pub struct Tracking {
    chain: Chain,
    names: Vec<String>,
    gear_ratios: Vec<f64>,
    joints: Vec<JointSums>,
    end_effector_m: ErrorSum,
    running_rows: u64,
    first_running_ns: Option<u64>,
    saw_truth: bool,
}

impl Tracking {
    /// Nothing summed yet.
    pub fn new(robot: &Robot) -> Self {
        Self {
            chain: robot.chain.clone(),
            names: robot
                .joints
                .iter()
                .map(|joint| joint.name.clone())
                .collect(),
            gear_ratios: robot.joints.iter().map(|joint| joint.gear_ratio).collect(),
            joints: vec![JointSums::default(); robot.joints.len()],
            end_effector_m: ErrorSum::default(),
            running_rows: 0,
            first_running_ns: None,
            saw_truth: false,
        }
    }

    /// Adds one row; rows in which the loop was not running do not count.
    pub fn add(&mut self, row: &CycleMessages) {
        let running = row
            .status
            .is_some_and(|status| LoopState::from_raw(status.state) == Some(LoopState::Running));
        let (Some(sample), Some(command), true) = (&row.sample, &row.command, running) else {
            return;
        };
        self.running_rows += 1;
        let first_ns = *self
            .first_running_ns
            .get_or_insert(sample.header.measured_at_ns);
        let since_s = sample.header.measured_at_ns.saturating_sub(first_ns) as f64 * 1e-9;
        let after_start = since_s > START_S;
        let position_rad = self.link_position_rad(row);
        self.saw_truth |= row.truth.is_some();
        for (joint, sums) in self.joints.iter_mut().enumerate() {
            sums.position_rad.add(
                command.reference_position_rad[joint] - position_rad[joint],
                after_start,
            );
            sums.feedback_nm.add(
                command.feedback_torque_nm[joint] * self.gear_ratios[joint],
                after_start,
            );
            sums.note_measured(&sample.readings, joint);
            let sensor_nm = sample.readings.joint_torque_nm[joint];
            let torque_nm = row
                .truth
                .map_or(sensor_nm, |truth| truth.joint_torque_nm[joint]);
            if let Some(estimate) = &row.estimate {
                sums.add_estimates(estimate, joint, torque_nm, since_s);
            }
        }
        self.end_effector_m
            .add(self.tool_distance_m(command, &position_rad), after_start);
    }

    /// Where the links are: as the plant says, else the link encoder, else the motor over the gear ratio.
    fn link_position_rad(&self, row: &CycleMessages) -> PerJoint {
        if let Some(truth) = &row.truth {
            return truth.link_position_rad;
        }
        let mut position_rad = row
            .sample
            .map_or([f64::NAN; _], |sample| sample.readings.link_position_rad);
        for (joint, gear_ratio) in self.gear_ratios.iter().enumerate() {
            if !position_rad[joint].is_finite() {
                position_rad[joint] = row
                    .sample
                    .map_or(f64::NAN, |sample| sample.readings.motor_position_rad[joint])
                    / gear_ratio;
            }
        }
        position_rad
    }

    fn tool_distance_m(&self, command: &Command, position_rad: &PerJoint) -> f64 {
        let count = self.names.len();
        let wanted = self
            .chain
            .tool_pose(&command.reference_position_rad[..count]);
        let found = self.chain.tool_pose(&position_rad[..count]);
        (wanted.translation.vector - found.translation.vector).norm()
    }

    /// What has been summed.
    pub fn report(&self) -> TrackingReport {
        let joints = self
            .names
            .iter()
            .zip(&self.joints)
            .map(|(name, sums)| JointTracking {
                joint: name.clone(),
                position_error_rad: sums.position_rad.summary(),
                feedback_torque_nm: sums.feedback_nm.summary(),
                estimate_errors_nm: sums.estimate_errors_nm(),
                missing_signals: sums.missing_signals(),
                external_torque_nm: sums.external_nm.summary(),
                contacts: sums.contacts,
                first_contact_s: sums.first_contact_s,
            });
        TrackingReport {
            compared_with: if self.saw_truth { "plant" } else { "sensors" }.to_owned(),
            joints: joints.collect(),
            end_effector_error_m: self.end_effector_m.summary(),
            running_rows: self.running_rows,
            ..TrackingReport::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimator_whose_signal_was_never_measured_is_told_with_it() {
        let mut sums = JointSums::default();
        let mut readings = Readings::default();
        readings.motor_position_rad[0] = 1.0;
        readings.motor_torque_nm[0] = 0.1;
        sums.note_measured(&readings, 0);
        let mut message = TorqueEstimate::default();
        message.structural_damping.validity[0] = Validity::Held as u32;
        message.residual.validity[0] = Validity::Valid as u32;
        sums.add_estimates(&message, 0, 0.0, 0.0);
        let missing = sums.missing_signals();
        assert_eq!(
            missing.into_iter().collect::<Vec<_>>(),
            [(Kind::StructuralDamping, "link_position_rad".to_owned())]
        );
    }

    #[test]
    fn sums_are_mean_rms_and_maximum() {
        let mut sum = ErrorSum::default();
        assert_eq!(sum.summary(), None);
        for (error, after_start) in [(3.0, false), (-1.0, true), (f64::NAN, true), (-2.0, true)] {
            sum.add(error, after_start);
        }
        let summary = sum.summary().expect("three values");
        assert_eq!(
            (
                summary.count,
                summary.mean,
                summary.mean_magnitude,
                summary.max,
                summary.max_after_start
            ),
            (3, 0.0, 2.0, 3.0, 2.0)
        );
        assert!((summary.rms - (14.0_f64 / 3.0).sqrt()).abs() < 1e-12);
    }
}
