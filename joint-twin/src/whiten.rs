//! Making residuals as good as independent: an autoregressive filter and a scale for each channel.
//!
//! What a residual holds whatever the model is noise, which differs from sample to sample, and what the twin itself is
//! off, which lasts. Plain least squares believes such a sample several times over. The filter is made for the sum of
//! both (Yule and Walker's equations, solved by Levinson and Durbin's recursion) and applied to measurement and
//! regressors alike. It is never made from the residual: a filter that takes the gap for noise cannot see the gap.

use std::ops::Range;

use crate::Row;
use crate::observe::{Channel, SPREAD_S};

/// Of the autoregressive filters.
const ORDER: usize = 8;
/// What a residual holds whatever the model: noise of the sensors, and what the twin itself is off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Floor {
    /// Standard deviation of what differs from sample to sample.
    pub quick_nm: f64,
    /// Standard deviation of what changes slowly.
    pub slow_nm: f64,
    /// Samples over which the slow part falls to 1/e.
    pub slow_samples: f64,
}

impl Floor {
    fn covariance(&self, lag: usize) -> f64 {
        let slow = self.slow_nm.powi(2) * (-(lag as f64) / self.slow_samples.max(1e-9)).exp();
        if lag == 0 {
            self.quick_nm.powi(2) + slow
        } else {
            slow
        }
    }
}

/// Where one channel of one stretch lies in the rows.
pub fn series(rows: &[Row]) -> Vec<Range<usize>> {
    let mut found: Vec<Range<usize>> = Vec::new();
    for (k, row) in rows.iter().enumerate() {
        match found.last_mut() {
            Some(last)
                if rows[last.start].channel == row.channel
                    && rows[last.start].stretch == row.stretch =>
            {
                last.end = k + 1;
            }
            _ => found.push(k..k + 1),
        }
    }
    found
}

/// How much less a row near a turn counts, as near as the low-pass spreads it twice: by so many times the deviation elsewhere. Nobody
/// knows exactly how friction turns round. Set on development cases: four logs of a servo have load-dependent friction of 0.39 to 0.50 with
/// it; with 15, of 0.39 to 0.68 in three.
const TURNS: f64 = 5.0;
/// The same of a joint that stands: it holds any torque up to its breakaway, and what it holds tells nothing.
const STANDS: f64 = 15.0;
/// Of the torque that accelerates the joint, the twin is off by this part: sensors and twin are not at the same instant.
const INERTIAL: f64 = 0.02;
/// Of the difference that softer gears of links make that no encoder shows, so many times may be wrong: their damping is not known
/// either, and what they do shakes this joint's own gear.
const UNSEEN: f64 = 2.0;
/// Of the torque that swings the rotor above the band, friction within it is off by this part.
const VIBRATING: f64 = 0.2;
/// Of friction that falls as the joint gets faster, this part does so earlier or later: a gear that sticks and slips does it so quickly
/// that how it lets go decides, which no law of steady motion tells.
const FALLING: f64 = 0.3;
/// Slower than this part of the fastest is as good as standing, unless the joint has gone so far as slowly: by then its friction is
/// as much law as a quick joint's. Who only passes through, before or after a turn, has not.
const STANDING: f64 = 0.03;
const SLID_RAD: f64 = 1e-2;
/// Slower than this part of the fastest it stands.
const STILL: f64 = 0.003;

/// Of each row, by how near its joint is to a turn or to rest, how hard it accelerates, what swings beside it and whether it vibrates: 1 in
/// even motion.
fn weights(rows: &[Row], series: &[Range<usize>], floor: impl Fn(&Row) -> Floor) -> Vec<f64> {
    let fastest = rows
        .iter()
        .map(|row| row.velocity_rad_s.abs())
        .fold(0.0, f64::max);
    let mut weights = vec![1.0; rows.len()];
    for of in series {
        let rows = &rows[of.clone()];
        let slow = Slow::of(rows, fastest);
        let Floor {
            quick_nm, slow_nm, ..
        } = floor(&rows[0]);
        let deviation_nm = quick_nm.hypot(slow_nm).max(1e-12);
        for (row, weight) in rows.iter().zip(&mut weights[of.clone()]) {
            let turns = TURNS * near(&slow.turns_s, row.time_s);
            let stands = STANDS * near(&slow.stands_s, row.time_s);
            let hard = INERTIAL * row.inertial_nm / deviation_nm;
            let unseen = UNSEEN * row.unseen_nm / deviation_nm;
            let aliased = row.aliased_nm / deviation_nm;
            let swings = VIBRATING * row.vibrating_nm / deviation_nm;
            let falls = FALLING * row.falling_nm / deviation_nm;
            // a beat is as quick as noise
            let beating = row.beating_nm / quick_nm.max(1e-12);
            // all three are of how friction lets go
            let less = turns.max(stands).max(falls).powi(2)
                + hard * hard
                + unseen * unseen
                + swings * swings
                + aliased * aliased
                + beating * beating;
            *weight = 1.0 / (1.0 + less).sqrt();
        }
    }
    weights
}

/// How near a time is to one of these, 1 at it.
fn near(times_s: &[f64], time_s: f64) -> f64 {
    let after = times_s.partition_point(|at| *at < time_s);
    let nearest_s = [after.checked_sub(1), Some(after)]
        .into_iter()
        .flatten()
        .filter_map(|k| times_s.get(k))
        .map(|at| (at - time_s).abs())
        .fold(f64::INFINITY, f64::min);
    (-(nearest_s / (2.0 * SPREAD_S)).powi(2)).exp()
}

/// When a joint is slow and has not gone far since it was so.
#[derive(Default)]
struct Slow {
    /// For no longer than the low-pass spreads an instant: it turns.
    turns_s: Vec<f64>,
    /// For longer: it stands.
    stands_s: Vec<f64>,
}

impl Slow {
    fn of(rows: &[Row], fastest_rad_s: f64) -> Self {
        let mut all = Self::default();
        let mut spell_s: Vec<f64> = Vec::new();
        let mut way_rad = 0.0;
        for pair in rows.windows(2) {
            let [before, row] = [&pair[0], &pair[1]];
            let turns = before.velocity_rad_s * row.velocity_rad_s <= 0.0;
            let part = row.velocity_rad_s.abs() / fastest_rad_s;
            if turns || !(STILL..STANDING).contains(&part) {
                way_rad = 0.0;
            } else {
                way_rad += (row.position_rad - before.position_rad).abs();
            }
            if turns || part < STANDING && way_rad < SLID_RAD {
                spell_s.push(row.time_s);
            } else {
                all.end(&mut spell_s);
            }
        }
        all.end(&mut spell_s);
        all
    }

    fn end(&mut self, spell_s: &mut Vec<f64>) {
        let ends = spell_s.first().zip(spell_s.last());
        let stands = ends.is_some_and(|(first, last)| last - first > 2.0 * SPREAD_S);
        let all = if stands {
            &mut self.stands_s
        } else {
            &mut self.turns_s
        };
        all.append(spell_s);
    }
}

/// How one channel is made independent and of unit variance.
#[derive(Clone, Debug)]
struct Filter {
    /// Of the samples before, the oldest first.
    coefficients: [f64; ORDER],
    scale_nm: f64,
}

/// Filters for all rows.
#[derive(Clone, Debug)]
pub struct Whitener {
    series: Vec<Range<usize>>,
    /// Of each series.
    filters: Vec<Filter>,
    /// Of each row.
    weights: Vec<f64>,
}

impl Whitener {
    /// One filter for each channel, the same in all stretches.
    pub fn new(rows: &[Row], floor: impl Fn(&Row) -> Floor + Copy) -> Self {
        let series = series(rows);
        let filters = series
            .iter()
            .map(|of| Filter::of(floor(&rows[of.start])))
            .collect();
        Self {
            weights: weights(rows, &series, floor),
            series,
            filters,
        }
    }

    /// With rows that count less by what nobody can tell of them, row by row.
    #[must_use]
    pub fn doubting(mut self, doubts_nm: &[f64]) -> Self {
        for (of, filter) in self.series.iter().zip(&self.filters) {
            for k in of.clone() {
                let doubt = doubts_nm[k] / filter.scale_nm;
                self.weights[k] = 1.0 / (self.weights[k].powi(-2) + doubt * doubt).sqrt();
            }
        }
        self
    }

    /// The same for one channel's rows alone, with where those rows are.
    pub fn only(&self, rows: &[Row], channel: Channel) -> (Self, Vec<usize>) {
        let mut part = Self {
            series: Vec::new(),
            filters: Vec::new(),
            weights: Vec::new(),
        };
        let mut places = Vec::new();
        for (of, filter) in self.series.iter().zip(&self.filters) {
            if rows[of.start].channel == channel {
                let first = places.len();
                places.extend(of.clone());
                part.series.push(first..places.len());
                part.filters.push(filter.clone());
                part.weights.extend_from_slice(&self.weights[of.clone()]);
            }
        }
        (part, places)
    }

    /// How much a row counts, 0 to 1, as a factor of its residual.
    pub fn weight(&self, row: usize) -> f64 {
        self.weights[row]
    }

    /// Filters, scales and weighs a column.
    pub fn apply(&self, column_nm: &[f64]) -> Vec<f64> {
        let mut white = vec![0.0; column_nm.len()];
        for (of, filter) in self.series.iter().zip(&self.filters) {
            for k in of.clone() {
                let before = &column_nm[of.start..k];
                let expected_nm = match before.last_chunk() {
                    Some(before) => filter.expected_nm(before),
                    // what lies before the first is not there
                    None => {
                        let mut padded = [0.0; ORDER];
                        padded[ORDER - before.len()..].copy_from_slice(before);
                        filter.expected_nm(&padded)
                    }
                };
                white[k] = self.weights[k] * (column_nm[k] - expected_nm) / filter.scale_nm;
            }
        }
        white
    }
}

impl Filter {
    fn of(floor: Floor) -> Self {
        let covariance: Vec<f64> = (0..=ORDER).map(|lag| floor.covariance(lag)).collect();
        let (newest_first, variance) = levinson(&covariance);
        let mut coefficients = [0.0; ORDER];
        for (value, coefficient) in coefficients.iter_mut().rev().zip(newest_first) {
            *value = coefficient;
        }
        Self {
            coefficients,
            scale_nm: variance.sqrt().max(1e-12),
        }
    }

    /// What the samples before let expect of one.
    #[inline]
    fn expected_nm(&self, before_nm: &[f64; ORDER]) -> f64 {
        let [a, b, c, d, e, f, g, h]: [f64; ORDER] =
            std::array::from_fn(|k| self.coefficients[k] * before_nm[k]);
        // no sum waits for all before it
        ((a + b) + (c + d)) + ((e + f) + (g + h))
    }
}

/// Coefficients that predict a sample from those before it, newest first, and the variance they leave.
fn levinson(covariance: &[f64]) -> (Vec<f64>, f64) {
    let order = covariance.len().saturating_sub(1);
    let mut coefficients = vec![0.0; order];
    let mut error = covariance.first().copied().unwrap_or(0.0);
    if error <= 0.0 {
        return (coefficients, 0.0);
    }
    for k in 0..order {
        let past: f64 = (0..k).map(|j| coefficients[j] * covariance[k - j]).sum();
        let reflection = (covariance[k + 1] - past) / error;
        let before = coefficients.clone();
        coefficients[k] = reflection;
        for j in 0..k {
            coefficients[j] = before[j] - reflection * before[k - 1 - j];
        }
        error *= 1.0 - reflection * reflection;
    }
    (coefficients, error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_order_process_is_found() {
        // covariance of x[k] = 0.8·x[k-1] + e
        let covariance: Vec<f64> = (0..4).map(|lag| 0.8_f64.powi(lag)).collect();
        let (found, left) = levinson(&covariance);
        assert!((left - 0.36).abs() < 1e-9, "{left}");
        assert!((found[0] - 0.8).abs() < 1e-9, "{found:?}");
        assert!(found[1].abs() < 1e-9 && found[2].abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn where_friction_falls_by_more_than_a_reversal_shakes_it_less_counts() {
        let floor = |_: &Row| Floor {
            quick_nm: 1.0,
            ..Floor::default()
        };
        let weight = |falling_nm: f64, at_s: f64| {
            let rows: Vec<Row> = (0..600)
                .map(|k| Row {
                    velocity_rad_s: if k < 300 { -1.0 } else { 1.0 },
                    falling_nm,
                    time_s: 0.01 * f64::from(k),
                    ..Row::default()
                })
                .collect();
            Whitener::new(&rows, floor).weight((100.0 * at_s) as usize)
        };
        let far_s = 1.5;
        assert!(weight(0.1, far_s) > 0.99 && weight(10.0, far_s) < 0.4);
        // at the reversal it is what that does already
        let turn_s = 3.0;
        assert_eq!(weight(5.0, turn_s), weight(0.0, turn_s));
        assert!(weight(100.0, turn_s) < 0.6 * weight(0.0, turn_s));
    }

    #[test]
    fn who_stands_counts_less_than_who_turns() {
        // 2 s this way, at rest for a while, 2 s that way
        let weight = |rest_s: f64| {
            let row = |k: i32| {
                let time_s = 0.01 * f64::from(k);
                let velocity_rad_s = match time_s {
                    before if before < 2.0 => 1.0,
                    after if after > 2.0 + rest_s => -1.0,
                    _ => 0.0,
                };
                Row {
                    velocity_rad_s,
                    time_s,
                    ..Row::default()
                }
            };
            let rows: Vec<Row> = (0..400).map(row).collect();
            let floor = |_: &Row| Floor {
                quick_nm: 1.0,
                ..Floor::default()
            };
            Whitener::new(&rows, floor).weight((100.0 * (2.0 + 0.5 * rest_s)) as usize)
        };
        let [turning, standing] = [0.02, 1.0].map(weight);
        assert!(standing < 0.1 && turning > 0.15, "{standing}, {turning}");
    }

    #[test]
    fn who_slides_slowly_counts_and_who_stands_does_not() {
        let rows = |slow_rad_s: f64| -> Vec<Row> {
            let speeds = (0..600).map(|k| if k < 300 { slow_rad_s } else { 1.0 });
            let mut position_rad = 0.0;
            let row = |(k, velocity_rad_s): (usize, f64)| {
                position_rad += 0.01 * velocity_rad_s;
                Row {
                    velocity_rad_s,
                    position_rad,
                    time_s: 0.01 * k as f64,
                    ..Row::default()
                }
            };
            speeds.enumerate().map(row).collect()
        };
        let floor = |_: &Row| Floor {
            quick_nm: 1.0,
            ..Floor::default()
        };
        let middle = |slow_rad_s: f64| Whitener::new(&rows(slow_rad_s), floor).weight(150);
        assert!(middle(0.02) > 0.99, "{}", middle(0.02));
        assert!(middle(0.001) < 0.1, "{}", middle(0.001));
    }
}
