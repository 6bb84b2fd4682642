//! What a recording tells of a drive, and which of its torques act between two samples.

/// What the recording gives the simulation, at a constant rate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drive {
    /// Between two samples.
    pub period_s: f64,
    /// Of the first sample since the recording began.
    pub start_s: f64,
    /// Measured motor position over the gear ratio.
    pub motor_rad: Vec<f64>,
    /// Measured link position, where feedback is on it.
    pub link_rad: Option<Vec<f64>>,
    /// Torque sent, joint side.
    pub command_nm: Vec<f64>,
    /// What the torque did between two samples.
    pub between: Between,
}

/// What a torque does between two samples of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Between {
    /// It stays until the next: every command was recorded.
    #[default]
    Stays,
    /// It goes on to the next in a straight line: the loop is faster than the recording.
    Line,
}

/// The commands that the drive holds during a substep: each until the next is old enough, which may be within it.
pub(super) struct Held {
    /// In samples.
    pub(super) older: usize,
    pub(super) newer: usize,
    /// Of the substep.
    pub(super) share_of_newer: f64,
}

impl Held {
    /// In a substep of so many periods, for a command that is so many periods old at its beginning.
    pub(super) fn at(age: f64, periods: f64) -> Self {
        let older = (age - 1e-9).ceil().max(0.0);
        let share_of_older = ((age - (older - 1.0)) / periods).clamp(0.0, 1.0);
        Self {
            older: older as usize,
            newer: (older - 1.0).max(0.0) as usize,
            share_of_newer: 1.0 - share_of_older,
        }
    }
}

/// Between the values around a place; before the first and after the last one these.
pub(super) fn between(values: &[f64], at: f64) -> f64 {
    let last = values.len() - 1;
    let at = at.max(0.0);
    let before = (at as usize).min(last);
    let after = (before + 1).min(last);
    values[before] + (at - before as f64).min(1.0) * (values[after] - values[before])
}

/// The same along a curve that has no corner at a value: a cubic through the two around the place, with the slopes that their neighbours
/// tell (Catmull and Rom, Computer Aided Geometric Design, 1974, 317-326). After the last one it goes on as it went.
pub(super) fn smoothly_between(values: &[f64], at: f64) -> f64 {
    let last = values.len() - 1;
    let at = at.max(0.0);
    let before = at as usize;
    let value = |place: usize| match place.checked_sub(last) {
        Some(after) if after > 0 => {
            let step = values[last] - values[last.saturating_sub(1)];
            values[last] + after as f64 * step
        }
        _ => values[place],
    };
    let [a, b, c, d] = [
        value(before.saturating_sub(1)),
        value(before),
        value(before + 1),
        value(before + 2),
    ];
    let t = at - before as f64;
    let [slope, bend, twist] = [
        c - a,
        2.0 * a - 5.0 * b + 4.0 * c - d,
        3.0 * (b - c) + d - a,
    ];
    b + 0.5 * t * (slope + t * (bend + t * twist))
}
