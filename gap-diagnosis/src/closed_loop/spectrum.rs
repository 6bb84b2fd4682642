//! At how many cycles a turn of the motor a residual repeats.

use std::f64::consts::TAU;

use joint_twin::Row;
use joint_twin::on_all_cores::OnAllCores;
use joint_twin::signal::waves::{PERIODS_MIN, Waves};
use nalgebra::DMatrix;

/// Fewest and most cycles per motor turn that are looked for.
pub const CYCLES: [f64; 2] = [0.5, 24.0];
/// [`PERIODS_MIN`] of a whole number of cycles that a peak is at, as of what repeats with a shaft, or of which a multiple is known to
/// repeat: what comes twice a turn mostly comes once too.
const PERIODS_MIN_WHOLE: f64 = 2.0;
/// Steps between two numbers of cycles that the range can tell apart.
const OVERSAMPLING: f64 = 3.0;
/// Numbers of cycles that differ by less than this part are one.
pub const SAME: f64 = 0.01;
/// Of the fastest speed; slower is as good as standing.
const MOVING: f64 = 0.05;
/// Whitened squares that waves at a peak take off one channel at least. An effect that repeats with an angle costs 24 nats or
/// more, which are 67 squares in all channels, of which there are four: smaller peaks are not worth a name whatever makes them.
const GAIN_MIN: f64 = 17.0;
/// The most numbers of cycles that are tried.
const TRIED_MAX: usize = 1500;
/// So many numbers of cycles are tried at a time.
const TOGETHER: usize = 16;

/// Cycles per motor turn at which a gain peaks above `GAIN_MIN`, the highest first, as far as the rows' range of angles tells
/// them apart and below `most`. Of less than four periods only what is a whole number of cycles and has the most gain of all: a
/// smooth shape has more the fewer the cycles, and small peaks beside.
///
/// `gains` gets a sine and a cosine of each row's motor angle times each of some numbers of cycles, one pair of columns after the
/// other, and tells each pair's gain.
pub fn peaks(
    rows: &[&Row],
    most: f64,
    gains: impl Fn(DMatrix<f64>) -> Vec<f64> + Sync,
    count: usize,
) -> Vec<f64> {
    let angles = || rows.iter().map(|row| row.motor_angle_rad);
    let (low, high) = angles().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    let turns = (high - low) / TAU;
    let least = |periods: f64| CYCLES[0].max(periods / turns.max(1e-9));
    let lowest = least(PERIODS_MIN_WHOLE);
    let highest = CYCLES[1].min(most);
    // where the range ends at few periods what is slower has more, and the end is no peak
    let before_lowest = if lowest < least(PERIODS_MIN) {
        f64::INFINITY
    } else {
        0.0
    };
    let step = (1.0 / (OVERSAMPLING * turns.max(1e-9))).max((highest - lowest) / TRIED_MAX as f64);
    if lowest >= highest || rows.len() < 20 {
        return Vec::new();
    }
    let tried = ((highest - lowest) / step) as usize + 1;
    let gains = (0..tried).step_by(TOGETHER).on_all_cores(|first| {
        let mut waves = Waves::from(angles(), lowest + first as f64 * step, step);
        let count = TOGETHER.min(tried - first);
        let mut pairs = Vec::with_capacity(2 * count * rows.len());
        for _ in 0..count {
            pairs.extend(waves.now().iter().map(|[sin, _]| *sin));
            pairs.extend(waves.now().iter().map(|[_, cos]| *cos));
            waves.turn();
        }
        gains(DMatrix::from_vec(rows.len(), 2 * count, pairs))
    });
    let gains: Vec<f64> = gains.flatten().collect();
    let mut found: Vec<(f64, f64)> = (0..tried)
        .filter(|&k| {
            let before = k.checked_sub(1).map_or(before_lowest, |k| gains[k]);
            let after = gains.get(k + 1).copied().unwrap_or(0.0);
            gains[k] > GAIN_MIN.max(before) && gains[k] >= after
        })
        .map(|k| (settled(lowest + k as f64 * step, turns), gains[k]))
        .filter(|(cycles, gain)| {
            let is_most = || gains.iter().all(|other| other <= gain);
            *cycles >= least(PERIODS_MIN) || cycles.fract() == 0.0 && is_most()
        })
        .collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found
        .into_iter()
        .take(count)
        .map(|(cycles, _)| cycles)
        .collect()
}

/// Cycles per motor turn that are too few for [`peaks`] and worth a look, because these many are known to repeat: whole
/// parts of a whole number.
pub fn below(known: impl IntoIterator<Item = f64>, turns: f64) -> Vec<f64> {
    let range = PERIODS_MIN_WHOLE / turns..PERIODS_MIN / turns;
    let mut found = Vec::new();
    for cycles in known.into_iter().filter(|cycles| cycles.fract() == 0.0) {
        let parts = (2..=cycles as u32).map(|divisor| cycles / f64::from(divisor));
        found.extend(parts.filter(|part| part.fract() == 0.0 && range.contains(part)));
    }
    found
}

/// Cycles per motor turn of which samples at this rate see two a cycle or more, at the speed of half of the rows that move.
pub fn most_seen(rows: &[Row], gear_ratio: f64, rate_hz: f64) -> f64 {
    let mut turns_s: Vec<f64> = rows
        .iter()
        .map(|row| (row.velocity_rad_s * gear_ratio / TAU).abs())
        .collect();
    turns_s.sort_by(f64::total_cmp);
    let fastest = turns_s.last().copied().unwrap_or(0.0);
    turns_s.retain(|speed| *speed > MOVING * fastest);
    let usual = turns_s.get(turns_s.len() / 2).copied().unwrap_or(0.0);
    0.5 * rate_hz / usual.max(1e-9)
}

/// What repeats with a shaft repeats a whole number of times: taken where the range cannot tell it from the peak.
fn settled(cycles: f64, turns: f64) -> f64 {
    let whole = cycles.round();
    if whole >= 1.0 && (whole - cycles).abs() < 0.5 / turns {
        whole
    } else {
        cycles
    }
}

#[cfg(test)]
mod tests {
    use joint_twin::signal::beside::Beside;

    use super::*;

    #[test]
    fn what_comes_twice_a_turn_is_looked_for_once_a_turn_too() {
        // three periods are too few for a peak
        assert_eq!(below([2.0], 3.0), [1.0]);
        assert_eq!(below([6.0], 1.5), [2.0]);
        // one is a shape that anything may have, and five are found anyway
        assert!(below([2.0], 1.0).is_empty());
        assert!(below([2.0], 5.0).is_empty());
        assert!(below([1.0, 2.3], 3.0).is_empty());
    }

    #[test]
    fn a_ripple_is_found_at_its_cycles_whatever_the_speed() {
        let rows: Vec<Row> = (0..2000)
            .map(|k| {
                let t = f64::from(k) * 0.01;
                Row {
                    velocity_rad_s: 30.0 * t.cos(),
                    motor_angle_rad: 30.0 * t.sin(),
                    time_s: t,
                    ..Row::default()
                }
            })
            .collect();
        let known = rows.iter().map(|row| row.motor_angle_rad).collect();
        let target: Vec<f64> = rows
            .iter()
            .map(|row| (2.0 * row.motor_angle_rad + 0.4).sin() + 3.0 * row.motor_angle_rad)
            .collect();
        let beside = Beside::new(&[known], &target);
        let all: Vec<&Row> = rows.iter().collect();
        let gains = |waves: DMatrix<f64>| beside.gains(&waves);
        assert_eq!(peaks(&all, f64::INFINITY, gains, 2)[0], 2.0);
        // a wave too small to be worth a name is not looked at
        let small = |waves| gains(waves).iter().map(|gain| 0.01 * gain).collect();
        assert!(peaks(&all, f64::INFINITY, small, 2).is_empty());
        // half of the rows that move turn faster than 3.5 times a second
        let most = most_seen(&rows, 1.0, 10.0);
        assert!((most - 1.5).abs() < 0.1, "{most}");
        assert!(
            peaks(&all, most, gains, 2)
                .iter()
                .all(|cycles| *cycles <= 2.0)
        );
    }

    #[test]
    fn two_or_three_periods_are_a_peak_where_a_shaft_may_repeat_them() {
        // two and a half turns of the motor
        let angle_rad = |k: usize| 0.5 * 2.5 * TAU * (k as f64 * 0.01).sin();
        let rows: Vec<Row> = (0..2000)
            .map(|k| Row {
                motor_angle_rad: angle_rad(k),
                time_s: k as f64 * 0.01,
                ..Row::default()
            })
            .collect();
        let all: Vec<&Row> = rows.iter().collect();
        let found = |shape: fn(f64) -> f64| {
            let column = |of: &dyn Fn(f64) -> f64| -> Vec<f64> {
                rows.iter().map(|row| of(row.motor_angle_rad)).collect()
            };
            let beside = Beside::new(&[column(&|_| 1.0)], &column(&shape));
            let gains = |waves: DMatrix<f64>| beside.gains(&waves);
            let peaks = peaks(&all, f64::INFINITY, gains, 2).into_iter();
            // of fewer than four periods
            peaks.filter(|cycles| *cycles < 1.6).collect::<Vec<f64>>()
        };
        assert_eq!(found(|x| (x + 0.7).sin()), [1.0]);
        // no whole number, and a shape that goes with position
        assert!(found(|x| (1.5 * x).sin()).is_empty());
        assert!(found(|x| 0.1 * x * x + 0.3 * x).is_empty());
    }
}
