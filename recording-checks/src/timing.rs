//! When a recorded command acts and when the torque beside it was read: as the robot file tells, or as the samples show.
//!
//! A command that was computed from a row acts from so many rows on, and its torque is measured at the row after that. Some
//! recorders write down the torque that acts from a row on instead: that is their order of work, and no effect. Where the
//! robot file tells no controller, nobody told a delay either.

use gap_report::DataFinding;
use joint_twin::control::is_slower_than_loop;
use joint_twin::on_all_cores::OnAllCores;
use recording::grid::{in_runs, runs};
use recording::{JointColumns, Recording, Signal};
use robot::{Control, ControlKind, Robot, RobotJoint};

use crate::follow::{answered_after, told_delay};

/// A torque that answers its command after a whole number of rows, nearly, was read in a loop that runs with the recording: a
/// faster one answers at any time.
const WHOLE_ROWS: f64 = 0.25;
/// A loop of which nobody told the rate, and that is faster than the recording: so many times.
const FASTER: f64 = 1000.0;

/// What is known of the recordings' timing.
pub struct Timing {
    /// The robot file's controller; where it tells none, one without a law and with the delay that the samples show.
    pub control: Option<Control>,
    /// Whether the robot file tells it.
    pub is_told: bool,
    /// Rows by which each joint's torque was read before the one that the command's delay makes it be read at.
    pub early_rows: Vec<usize>,
    /// What a reader of the report should know.
    pub findings: Vec<DataFinding>,
}

impl Timing {
    /// Of these recordings of a robot.
    pub fn of(robot: &Robot, recordings: &[&Recording]) -> Self {
        let told = robot.control.as_ref();
        let mut timing = Self {
            control: robot.control.clone(),
            is_told: told.is_some_and(|control| control.kind != ControlKind::Unknown),
            early_rows: vec![0; robot.joints.len()],
            findings: Vec::new(),
        };
        let Some(rate_hz) = recordings.first().map(|recording| recording.sample_rate_hz) else {
            return timing;
        };
        let after = |told: Option<f64>| -> Vec<Option<f64>> {
            let joints = robot.joints.iter();
            let of_joint = |joint| answered_after(&columns(recordings, joint), 1.0 / rate_hz, told);
            joints.on_all_cores(of_joint).collect()
        };
        match told.filter(|_| timing.is_told) {
            Some(control) if is_slower_than_loop(control, rate_hz) => {}
            Some(control) => {
                let told = told_delay(control.delay_cycles as usize);
                let early_rows = |after: f64| (told - after).round().max(0.0) as usize;
                let after = after(Some(told)).into_iter();
                timing.early_rows = after.map(|after| after.map_or(0, early_rows)).collect();
                timing.findings = early(robot, &timing.early_rows);
            }
            None => timing.control = presumed(robot, recordings, rate_hz, after(None)),
        }
        timing
    }

    /// Rows from a command to the torque that is measured of it.
    pub fn told_rows(&self) -> usize {
        let control = self.control.as_ref();
        told_delay(control.map_or(1, |control| control.delay_cycles as usize)) as usize
    }
}

/// A joint's signals in all recordings, run by run.
pub(crate) fn columns(recordings: &[&Recording], joint: &RobotJoint) -> Vec<JointColumns> {
    recordings
        .iter()
        .filter_map(|recording| Some((*recording, recording.joint(&joint.name).ok()?)))
        .flat_map(|(recording, columns)| in_runs(columns, &runs(recording)))
        .collect()
}

/// A controller of which nothing is known but when its commands act; none where nothing tells that.
fn presumed(
    robot: &Robot,
    recordings: &[&Recording],
    rate_hz: f64,
    after: Vec<Option<f64>>,
) -> Option<Control> {
    let mut rows: Vec<f64> = after.into_iter().flatten().collect();
    rows.sort_by(f64::total_cmp);
    let is_sent = |recording: &&Recording| {
        let mut joints = recording.joints.iter();
        joints.any(|joint| joint.signals.contains_key(&Signal::CommandTorqueNm))
    };
    // a rate may be told where the law is not
    let told = robot.control.as_ref();
    let faster = told.filter(|control| is_slower_than_loop(control, rate_hz));
    let fast_hz = faster.map_or(FASTER * rate_hz, |control| control.rate_hz);
    let (loop_hz, delay_cycles) = match rows.get(rows.len() / 2) {
        Some(rows) if faster.is_none() && is_held(*rows) => (rate_hz, rows.round() - 1.0),
        Some(rows) => (fast_hz, (fast_hz / rate_hz * rows).round()),
        None if recordings.iter().any(is_sent) => return robot.control.clone(),
        None => (fast_hz, 0.0),
    };
    let joints = robot.joints.len();
    Some(Control {
        rate_hz: loop_hz,
        kind: ControlKind::Unknown,
        proportional_nm_rad: vec![0.0; joints],
        derivative_nm_s_rad: vec![0.0; joints],
        feedback: robot::Feedback::default(),
        feedforward: robot::Feedforward::default(),
        velocity_filter_hz: 0.0,
        velocity_filter_order: 1,
        delay_cycles: delay_cycles.max(0.0) as u32,
    })
}

fn is_held(rows: f64) -> bool {
    let whole = rows.round();
    whole >= 1.0 && (rows - whole).abs() <= WHOLE_ROWS
}

fn early(robot: &Robot, early_rows: &[usize]) -> Vec<DataFinding> {
    let joints = robot.joints.iter().zip(early_rows);
    joints
        .filter(|(_, rows)| **rows > 0)
        .map(|(joint, rows)| DataFinding {
            joint: Some(joint.name.clone()),
            severity: "note".to_owned(),
            what: format!(
                "the recorded torque answers its command {rows} row(s) before the robot file's delay_cycles let it; it is taken \
                 for the torque that acts from its row on, and as much later"
            ),
            remedy: "set delay_cycles to what the controller does, if that is it".to_owned(),
        })
        .collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::follow::tests::command;

    const ROWS: usize = 20_000;

    /// A drive whose torque is in the row so many after its command's.
    fn recorded(after: usize) -> Recording {
        let command = command();
        let torque = (0..ROWS).map(|k| command[k.saturating_sub(after)]);
        let signals = [
            (Signal::MotorTorqueNm, torque.collect()),
            (Signal::CommandTorqueNm, command.clone()),
        ];
        Recording {
            time_s: (0..ROWS).map(|k| k as f64 / 1500.0).collect(),
            segment: None,
            joints: vec![JointColumns {
                name: "joint1".to_owned(),
                signals: signals.into(),
            }],
            sample_rate_hz: 1500.0,
            metadata: BTreeMap::new(),
            truncated: false,
        }
    }

    #[test]
    fn a_torque_that_acts_from_its_row_on_is_early_and_no_effect() {
        let robot = robot::load("shd17").unwrap();
        let delay = robot.control.as_ref().unwrap().delay_cycles as usize;
        let early = |after| Timing::of(&robot, &[&recorded(after)]).early_rows[0];
        assert_eq!(
            [early(delay + 1), early(delay), early(delay + 3)],
            [0, 1, 0]
        );
    }

    #[test]
    fn what_no_robot_file_tells_is_read_off_the_samples() {
        let mut robot = robot::load("shd17").unwrap();
        robot.control = None;
        let control = |after| Timing::of(&robot, &[&recorded(after)]).control.unwrap();
        assert_eq!([control(1), control(3)].map(|c| c.delay_cycles), [0, 2]);
        assert!(!is_slower_than_loop(&control(1), 1500.0));
        assert!(is_slower_than_loop(&control(0), 1500.0));
    }

    #[test]
    fn a_loop_of_which_only_the_rate_is_told_runs_at_that_rate() {
        let mut robot = robot::load("shd17").unwrap();
        let told = robot.control.as_mut().unwrap();
        (told.kind, told.rate_hz) = (ControlKind::Unknown, 15_000.0);
        let control = Timing::of(&robot, &[&recorded(2)]).control.unwrap();
        assert_eq!((control.rate_hz, control.delay_cycles), (15_000.0, 20));
        assert!(is_held(2.2) && !is_held(0.6) && !is_held(2.5) && !is_held(0.1));
    }
}
