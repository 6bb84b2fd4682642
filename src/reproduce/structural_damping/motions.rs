//! The motions: swings, a slow sweep and holds to calibrate; other swings, other holds and a held minute to judge; an hour of
//! swings, steps and holds that never repeat, to count false alarms.
//!
//! SD does not print its motions; these load the joint with up to 15 Nm, its rated torque, by swinging the link.

use std::f64::consts::TAU;
use std::fmt::Write;

/// A motion from rest to rest.
#[derive(Clone, Copy)]
pub struct Motion {
    /// Of its files.
    pub name: &'static str,
    /// When it is over.
    pub duration_s: f64,
    pub(super) position_rad: fn(f64) -> f64,
}

/// SD Fig. 7.
pub const CALIBRATION: Motion = Motion {
    name: "first",
    duration_s: 106.0,
    position_rad: calibration_rad,
};

/// SD Fig. 9.
pub const JUDGEMENT: Motion = Motion {
    name: "second",
    duration_s: 128.0,
    position_rad: judgement_rad,
};

/// An hour with nobody near.
pub const ROUTINE: Motion = Motion {
    name: "routine",
    duration_s: 3600.0,
    position_rad: routine_rad,
};

/// Between waypoints; a spline through them follows 3.3 Hz.
const WAYPOINT_S: f64 = 0.02;

impl Motion {
    /// The text of a waypoint file.
    pub fn waypoints(&self, joint: &str) -> String {
        let mut text = format!("time_s,{joint}.reference_position_rad\n");
        let begin_rad = (self.position_rad)(0.0);
        let count = (self.duration_s / WAYPOINT_S) as usize;
        for point in 0..count {
            let time_s = point as f64 * WAYPOINT_S;
            let position_rad = (self.position_rad)(time_s) - begin_rad;
            let _ = writeln!(text, "{time_s:.2},{position_rad:.9}");
        }
        text
    }
}

/// 0 to 1 with neither velocity nor acceleration at the ends.
fn rise(share: f64) -> f64 {
    let x = share.clamp(0.0, 1.0);
    x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x)
}

/// A move that begins at a time and takes another.
fn step(time_s: f64, begin_s: f64, takes_s: f64, rad: f64) -> f64 {
    rad * rise((time_s - begin_s) / takes_s)
}

/// Sines `[amplitude, frequency, phase]` between two times, blended in and out over 2 s.
fn swing(time_s: f64, [begin_s, end_s]: [f64; 2], sines: &[[f64; 3]]) -> f64 {
    const BLEND_S: f64 = 2.0;
    let share = ((time_s - begin_s) / BLEND_S).clamp(0.0, 1.0)
        * ((end_s - time_s) / BLEND_S).clamp(0.0, 1.0);
    let sum: f64 = sines
        .iter()
        .map(|[rad, hz, phase]| rad * (TAU * hz * time_s + phase).sin())
        .sum();
    share * share * (3.0 - 2.0 * share) * sum
}

fn calibration_rad(time_s: f64) -> f64 {
    const STEPS_RAD: [f64; 9] = [0.4, 0.5, 0.6, -0.5, -0.6, -1.3, -0.7, 1.9, -1.3];
    let swings = [
        (
            [0.0, 20.0],
            &[[0.3, 0.9, 0.0], [0.2, 0.37, 0.0], [0.03, 2.3, 0.0]][..],
        ),
        ([21.0, 38.0], &[[0.1, 2.7, 0.0], [0.5, 0.21, 0.0]][..]),
        ([92.0, 104.0], &[[0.06, 3.3, 1.0], [0.35, 0.13, 0.0]][..]),
    ];
    let swung: f64 = swings
        .iter()
        .map(|(span, sines)| swing(time_s, *span, sines))
        .sum();
    let swept = step(time_s, 39.0, 5.0, 1.3)
        + step(time_s, 46.0, 10.0, -2.6)
        + step(time_s, 58.0, 5.0, 1.3);
    let stepped: f64 = STEPS_RAD
        .iter()
        .enumerate()
        .map(|(place, rad)| step(time_s, 64.0 + 3.0 * place as f64, 0.5 + rad.abs(), *rad))
        .sum();
    swung + swept + stepped
}

fn judgement_rad(time_s: f64) -> f64 {
    let swings = [
        ([0.0, 16.0], &[[0.35, 0.7, 0.5], [0.08, 1.9, 0.0]][..]),
        ([17.0, 30.0], &[[0.08, 3.1, 0.0], [0.3, 0.31, 0.0]][..]),
        ([114.0, 126.0], &[[0.7, 0.45, 0.0], [0.1, 1.3, 0.0]][..]),
    ];
    let swung: f64 = swings
        .iter()
        .map(|(span, sines)| swing(time_s, *span, sines))
        .sum();
    // the hold between the first two steps is the held minute
    let steps = [
        [31.0, 1.2, 1.1],
        [95.0, 1.5, -1.7],
        [100.0, 4.0, -0.5],
        [107.0, 0.8, 0.8],
        [111.0, 0.4, 0.3],
    ];
    let stepped: f64 = steps
        .iter()
        .map(|[begin_s, takes_s, rad]| step(time_s, *begin_s, *takes_s, *rad))
        .sum();
    swung + stepped
}

/// Blocks of swings, every fourth one a step, a hold and the way back, all of their own size and speed.
fn routine_rad(time_s: f64) -> f64 {
    const BLOCK_S: f64 = 12.0;
    const SPEED_RAD_S: f64 = 2.2;
    const ACCELERATION_RAD_S2: f64 = 22.0;
    let block = (time_s / BLOCK_S).floor();
    let begin_s = block * BLOCK_S;
    let of = |base: f64| spread(block + 1.0, base);
    if block % 4.0 == 3.0 {
        let rad = 1.3 * (2.0 * of(2.0) - 1.0);
        return step(time_s, begin_s, 1.2, rad) - step(time_s, begin_s + 10.0, 1.2, rad);
    }
    let hz = 0.15 + 1.35 * of(3.0);
    let most_rad = (SPEED_RAD_S / (TAU * hz)).min(ACCELERATION_RAD_S2 / (TAU * hz).powi(2));
    let rad = (0.1 + 0.8 * of(2.0)).min(most_rad);
    let fast = [0.04 * of(7.0), 1.5 + 1.5 * of(5.0), 0.0];
    let span = [begin_s, begin_s + BLOCK_S];
    swing(time_s, span, &[[rad, hz, TAU * of(5.0)], fast])
}

/// The index-th of numbers that fill 0 to 1 evenly (van der Corput, 1935).
fn spread(index: f64, base: f64) -> f64 {
    let (mut left, mut digit, mut value) = (index, 1.0, 0.0);
    while left >= 1.0 {
        digit /= base;
        value += digit * (left % base).floor();
        left = (left / base).floor();
    }
    value
}
