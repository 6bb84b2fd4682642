//! What is in a recording: time, signals, and how good they are.

use crate::builder::shown_rate_hz;
use crate::statistics::{noise_std, range, step};
use crate::{JointColumns, Recording, Signal};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A recording in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordingInfo {
    /// Control cycles.
    pub rows: usize,
    /// Number of trajectories.
    pub segments: usize,
    /// Sum over the trajectories of last time minus first.
    pub seconds: f64,
    /// The planned rate where the file or its mapping tells it, else the measured one.
    pub sample_rate_hz: f64,
    /// How the rows follow each other.
    pub timing: Timing,
    /// In the order of the file.
    pub joints: Vec<JointInfo>,
    /// What the recorder wrote about the run.
    pub metadata: BTreeMap<String, String>,
    /// The recorder was stopped before it finished the file.
    pub truncated: bool,
}

/// How the rows of a recording follow each other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// What the times show, gaps left out; `None` where no time passes.
    pub measured_rate_hz: Option<f64>,
    /// Standard deviation of the steps from row to row, gaps left out.
    pub jitter_std_s: f64,
    /// Largest difference of such a step from the planned one.
    pub jitter_max_s: f64,
    /// Steps longer than one and a half of the planned one.
    pub gaps: usize,
    /// The longest step.
    pub longest_gap_s: f64,
    /// When the longest step begins.
    pub longest_gap_at_s: f64,
    /// Rows that would fit into the gaps.
    pub lost_rows: usize,
    /// Rows of the same time as the one before.
    pub repeated_times: usize,
}

/// One joint's signals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointInfo {
    /// As the recording names it.
    pub joint: String,
    /// Those that have a value somewhere.
    pub signals: Vec<SignalInfo>,
}

/// One signal of a joint, in the unit that its name ends with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SignalInfo {
    /// The signal's name.
    pub signal: Signal,
    /// Smallest value.
    pub minimum: f64,
    /// Largest value.
    pub maximum: f64,
    /// Share of the rows that have no value.
    pub missing_share: f64,
    /// It never changes.
    pub constant: bool,
    /// The step that all values are multiples of, if there is one.
    pub step: Option<f64>,
    /// Standard deviation of the noise from row to row; `None` where there is none to be seen.
    pub noise_std: Option<f64>,
}

/// Of a smooth signal only the rounding of its numbers is left; that is no noise.
const ROUNDING: f64 = 1e-7;

/// Describes a recording.
#[must_use]
pub fn describe(recording: &Recording) -> RecordingInfo {
    let segments = recording.segments();
    let seconds = segments
        .iter()
        .map(|rows| recording.time_s[rows.end - 1] - recording.time_s[rows.start]);
    RecordingInfo {
        rows: recording.rows(),
        segments: segments.len(),
        seconds: seconds.sum(),
        sample_rate_hz: recording.sample_rate_hz,
        timing: timing(recording),
        joints: recording.joints.iter().map(joint_info).collect(),
        metadata: recording.metadata.clone(),
        truncated: recording.truncated,
    }
}

fn joint_info(joint: &JointColumns) -> JointInfo {
    let signals = joint.signals.iter();
    JointInfo {
        joint: joint.name.clone(),
        signals: signals
            .filter_map(|(signal, values)| signal_info(*signal, values))
            .collect(),
    }
}

fn signal_info(signal: Signal, values: &[f64]) -> Option<SignalInfo> {
    let [minimum, maximum] = range(values)?;
    let missing = values.iter().filter(|value| value.is_nan()).count();
    Some(SignalInfo {
        signal,
        minimum,
        maximum,
        missing_share: missing as f64 / values.len() as f64,
        constant: minimum == maximum,
        step: step(values),
        noise_std: noise_std(values).filter(|std| *std > ROUNDING * (maximum - minimum)),
    })
}

/// Steps from row to row that are no gap.
const REGULAR: f64 = 1.5;

pub(crate) fn timing(recording: &Recording) -> Timing {
    let planned_s = 1.0 / recording.sample_rate_hz;
    let mut timing = Timing {
        measured_rate_hz: shown_rate_hz(&recording.time_s, recording.segment.as_deref()),
        ..Timing::default()
    };
    let measured_s = timing
        .measured_rate_hz
        .map_or(planned_s, |rate_hz| 1.0 / rate_hz);
    let (mut regular, mut squares_s2) = (0_usize, 0.0);
    for rows in recording.segments() {
        for pair in recording.time_s[rows].windows(2) {
            let step_s = pair[1] - pair[0];
            if step_s == 0.0 {
                timing.repeated_times += 1;
            } else if step_s > REGULAR * measured_s {
                timing.gaps += 1;
                let lost_rows = (step_s / measured_s).round() as usize - 1;
                timing.lost_rows = timing.lost_rows.saturating_add(lost_rows);
                if step_s > timing.longest_gap_s {
                    (timing.longest_gap_s, timing.longest_gap_at_s) = (step_s, pair[0]);
                }
            } else {
                regular += 1;
                let off_s = step_s - measured_s;
                squares_s2 += off_s * off_s;
                timing.jitter_max_s = timing.jitter_max_s.max(off_s.abs());
            }
        }
    }
    if regular > 0 {
        timing.jitter_std_s = (squares_s2 / regular as f64).sqrt();
    }
    timing
}
