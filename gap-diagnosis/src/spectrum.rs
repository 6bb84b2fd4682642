//! At how many cycles a turn of the motor a residual repeats.

use std::f64::consts::TAU;

use crate::twin::Row;

/// Fewest and most cycles per motor turn that are looked for.
const CYCLES: [f64; 2] = [0.5, 24.0];
/// Periods of the slowest one within the recorded range.
const PERIODS_MIN: f64 = 2.0;
/// Steps between two numbers of cycles that the range can tell apart.
const OVERSAMPLING: f64 = 3.0;
/// The most numbers of cycles that are tried.
const TRIED_MAX: usize = 2000;

/// A peak over the angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Per motor turn.
    pub cycles_per_motor_rev: f64,
    /// Part of the residual's square that it explains.
    pub share: f64,
}

/// The highest peaks of a residual over the motor angle, one channel's rows; `sign` turns friction into a function of
/// the angle.
pub fn peaks(rows: &[&Row], residual_nm: &[f64], with_direction: bool, count: usize) -> Vec<Peak> {
    let angles = || rows.iter().map(|row| row.motor_angle_rad);
    let (low, high) = angles().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    let turns = (high - low) / TAU;
    let lowest = CYCLES[0].max(PERIODS_MIN / turns.max(1e-9));
    let step =
        (1.0 / (OVERSAMPLING * turns.max(1e-9))).max((CYCLES[1] - lowest) / TRIED_MAX as f64);
    if lowest >= CYCLES[1] || rows.len() < 20 {
        return Vec::new();
    }
    let values: Vec<f64> = rows
        .iter()
        .zip(residual_nm)
        .map(|(row, value)| {
            if with_direction {
                value * row.velocity_rad_s.signum()
            } else {
                *value
            }
        })
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let total: f64 = values
        .iter()
        .map(|x| (x - mean).powi(2))
        .sum::<f64>()
        .max(1e-300);
    let tried = ((CYCLES[1] - lowest) / step) as usize + 1;
    let power: Vec<f64> = (0..tried)
        .map(|k| {
            let cycles = lowest + k as f64 * step;
            let (mut sin_sum, mut cos_sum) = (0.0, 0.0);
            for (row, value) in rows.iter().zip(&values) {
                let (sin, cos) = (cycles * row.motor_angle_rad).sin_cos();
                sin_sum += sin * (value - mean);
                cos_sum += cos * (value - mean);
            }
            2.0 * (sin_sum * sin_sum + cos_sum * cos_sum) / (rows.len() as f64 * total)
        })
        .collect();
    let mut found: Vec<Peak> = (0..tried)
        .filter(|&k| {
            let before = k.checked_sub(1).map_or(0.0, |k| power[k]);
            let after = power.get(k + 1).copied().unwrap_or(0.0);
            power[k] > before && power[k] >= after
        })
        .map(|k| Peak {
            cycles_per_motor_rev: settled(lowest + k as f64 * step, turns),
            share: power[k],
        })
        .collect();
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    found.truncate(count);
    found
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
    use super::*;
    use crate::observe::Channel;

    #[test]
    fn a_ripple_is_found_at_its_cycles_whatever_the_speed() {
        let rows: Vec<Row> = (0..2000)
            .map(|k| {
                let t = f64::from(k) * 0.01;
                Row {
                    stretch: 0,
                    channel: Channel::Motor,
                    time_s: t,
                    position_rad: 0.0,
                    velocity_rad_s: 30.0 * t.cos(),
                    acceleration_rad_s2: 0.0,
                    load_nm: 0.0,
                    motor_angle_rad: 30.0 * t.sin(),
                    inertial_nm: 0.0,
                }
            })
            .collect();
        let residual: Vec<f64> = rows
            .iter()
            .map(|row| (2.0 * row.motor_angle_rad + 0.4).sin())
            .collect();
        let all: Vec<&Row> = rows.iter().collect();
        let found = peaks(&all, &residual, false, 2);
        assert_eq!(found[0].cycles_per_motor_rev, 2.0);
        assert!(found[0].share > 0.9, "{found:?}");
    }
}
