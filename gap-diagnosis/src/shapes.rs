//! Torques of no named law: anything smooth over position, velocity, load, time, acceleration, or the motion of the other
//! joints, what fades from the joint's own past, and a steady vibration. They tell whether something with a structure is left, and over what.
//!
//! Each family is a linear combination of its columns, all of them small at first sight (a normal prior); what it is
//! worth is its Bayes factor against nothing, with the size of the prior that suits it best (type II maximum likelihood:
//! MacKay, Neural Computation 4 (1992) 415-447).

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use crate::observe::Channel;
use crate::twin::{JointTwin, Row};
use crate::waves::Waves;
use crate::whiten::series;

/// Hats over a variable.
const HATS: usize = 12;
/// Hats over time, one a second but no more than this.
const HATS_OVER_TIME: usize = 40;
/// Hats over each of two variables at once.
const HATS_OF_TWO: usize = 5;
/// Times over which what was fades: as far apart as two exponentials that sum to nearly any between them, from less than the band
/// shows to a tenth of a usual recording.
const FADING_S: [f64; 6] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0];
/// Frequencies of vibration that are tried, from the first to the last.
const VIBRATION_HZ: [f64; 2] = [0.3, 14.0];
/// Parts of a step in which the strongest one is sought anew.
const FINER: usize = 8;
/// The slowest motion whose frequency is looked for, and its harmonics.
const MOTION_HZ_LEAST: f64 = 0.03;
const MOTION_HARMONICS: i32 = 3;
/// Prior deviations of a coefficient that are tried, in powers of this factor.
const PRIOR_STEP: f64 = 2.5;
const PRIORS: i32 = 14;

/// Pushes last one of these, are looked for on a grid of half that, and are at most so many.
const PUSH_S: [f64; 3] = [0.15, 0.3, 0.6];
const PUSHES: usize = 6;
/// Below this part of the root mean square velocity a joint may stick or turn round, and friction is nobody's law.
const PUSHED_MOVING: f64 = 0.2;
/// The variable of pushes at a few moments, in words.
pub const PUSHES_OVER: &str = "time, as pushes";

/// Torques over one variable.
#[derive(Clone, Debug)]
pub struct Family {
    /// The variable, in words.
    pub over: &'static str,
    /// One value a row, Nm times a coefficient.
    pub columns: Vec<Vec<f64>>,
    /// Families of this kind that were tried before one was chosen.
    pub tried: f64,
}

/// All families along a joint's recordings; a residual tells at which frequency it may vibrate.
pub fn families(twin: &JointTwin<'_>, residual_nm: &[f64]) -> Vec<Family> {
    let rows = &twin.rows;
    let mut all = Vec::new();
    let mut add = |over, columns: Vec<Vec<f64>>| {
        all.push(Family {
            over,
            columns,
            tried: 1.0,
        });
    };
    let sign = |row: &Row| row.velocity_rad_s.signum();
    let each = |of: &dyn Fn(&Row) -> f64| rows.iter().map(of).collect::<Vec<f64>>();
    let velocity_rad_s = each(&|row| row.velocity_rad_s);
    let acceleration_rad_s2 = each(&|row| row.acceleration_rad_s2);
    let position = hats(&each(&|row| row.position_rad), HATS);
    add("position", position.clone());
    add("position and direction", signed(&position, rows, sign));
    add("velocity", hats(&velocity_rad_s, HATS));
    let of_two = hats(&each(&|row| row.position_rad), HATS_OF_TWO);
    let of_two = products(&of_two, &hats(&velocity_rad_s, HATS_OF_TWO));
    add("position and velocity", of_two);
    let load = hats(&each(&|row| row.load_nm), HATS);
    add("load and direction", signed(&load, rows, sign));
    add("acceleration", hats(&acceleration_rad_s2, HATS));
    let jerk_rad_s3 = jerk(rows);
    add("jerk", hats(&jerk_rad_s3, HATS));
    // any torque in proportion to the motion and to what fades from it, as of springs and dampers in whatever arrangement
    let mut past = faded(rows, &acceleration_rad_s2);
    past.extend([velocity_rad_s, acceleration_rad_s2, jerk_rad_s3]);
    add("the motion's past", past.into_iter().map(scaled).collect());
    add("the direction's past", faded(rows, &each(&sign)));
    let travelled = hats(&travelled(rows), HATS);
    add(
        "travel since the last reversal",
        signed(&travelled, rows, sign),
    );
    let time_s = each(&|row| row.time_s);
    let seconds = time_s.iter().copied().fold(0.0, f64::max);
    let time = hats(&time_s, HATS_OVER_TIME.min(seconds as usize).max(2));
    add("time and direction", signed(&time, rows, sign));
    add("time", time);
    let others = twin.others();
    if !others.is_empty() {
        add("motion of the other joints", others);
    }
    all.extend(vibration(rows, residual_nm));
    all.extend(pushes(rows, residual_nm));
    all
}

/// The channels in which a torque shows that acts on the motor's side, on the link's, or between command and drive.
pub fn on_sides(family: &Family, rows: &[Row]) -> Vec<Family> {
    let motor_only = |column: &Vec<f64>| -> Vec<f64> {
        rows.iter()
            .zip(column)
            .map(|(row, value)| {
                if row.channel == Channel::Motor {
                    *value
                } else {
                    0.0
                }
            })
            .collect()
    };
    let behind_gear = |column: &Vec<f64>| -> Vec<f64> {
        rows.iter()
            .zip(column)
            .map(|(row, value)| {
                if row.channel == Channel::Drive {
                    0.0
                } else {
                    *value
                }
            })
            .collect()
    };
    let has_link = rows
        .iter()
        .any(|row| matches!(row.channel, Channel::Torsion | Channel::Link));
    let side = |of: &dyn Fn(&Vec<f64>) -> Vec<f64>| Family {
        columns: family.columns.iter().map(of).collect(),
        ..family.clone()
    };
    let drive_only = |column: &Vec<f64>| -> Vec<f64> {
        let values = rows.iter().zip(column);
        values
            .map(|(row, value)| {
                if row.channel == Channel::Drive {
                    *value
                } else {
                    0.0
                }
            })
            .collect()
    };
    let mut sides = vec![side(&motor_only)];
    if rows.iter().any(|row| row.channel == Channel::Drive) {
        sides.push(side(&drive_only));
    }
    if has_link {
        sides.push(side(&behind_gear));
    }
    sides
}

/// Nats by which a family explains more than nothing: information matrix and vector of its columns, in whitened units.
pub fn evidence_nats(information: DMatrix<f64>, vector: &DVector<f64>, tried: f64) -> f64 {
    let size = information.diagonal().max();
    if !(size.is_finite() && size > 0.0) {
        return 0.0;
    }
    let eigen = information.symmetric_eigen();
    let turned = eigen.eigenvectors.tr_mul(vector);
    (0..PRIORS)
        .map(|step| {
            let variance = PRIOR_STEP.powi(2 * step) / size;
            eigen
                .eigenvalues
                .iter()
                .zip(turned.iter())
                .map(|(lambda, b)| {
                    let seen = 1.0 + variance * lambda.max(0.0);
                    0.5 * (variance * b * b / seen - seen.ln())
                })
                .sum::<f64>()
        })
        .fold(0.0, f64::max)
        - tried.ln()
}

/// Linear hats between quantiles of a variable: they sum to one everywhere.
fn hats(values: &[f64], count: usize) -> Vec<Vec<f64>> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let mut knots: Vec<f64> = (0..count)
        .map(|k| sorted[last * k / (count - 1).max(1)])
        .collect();
    knots.dedup();
    if knots.len() < 2 {
        return Vec::new();
    }
    (0..knots.len())
        .map(|k| {
            values
                .iter()
                .map(|value| {
                    let below = k.checked_sub(1).map(|k| knots[k]);
                    let above = knots.get(k + 1).copied();
                    let up = below.map_or(1.0, |b| (value - b) / (knots[k] - b));
                    let down = above.map_or(1.0, |a| (a - value) / (a - knots[k]));
                    up.min(down).clamp(0.0, 1.0)
                })
                .collect()
        })
        .collect()
}

fn signed(columns: &[Vec<f64>], rows: &[Row], sign: impl Fn(&Row) -> f64) -> Vec<Vec<f64>> {
    columns
        .iter()
        .map(|column| {
            column
                .iter()
                .zip(rows)
                .map(|(value, row)| value * sign(row))
                .collect()
        })
        .collect()
}

/// In units of its own size: of what differs in kind nobody knows which is more.
fn scaled(column: Vec<f64>) -> Vec<f64> {
    let square = column.iter().map(|x| x * x).sum::<f64>() / column.len().max(1) as f64;
    let size = square.sqrt().max(1e-300);
    column.into_iter().map(|x| x / size).collect()
}

/// Every product of one of these with one of those.
fn products(these: &[Vec<f64>], those: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let each = |one: &Vec<f64>, other: &Vec<f64>| -> Vec<f64> {
        let both = one.iter().zip(other);
        both.map(|(one, other)| one * other).collect()
    };
    let with_all = |one| those.iter().map(move |other| each(one, other));
    these.iter().flat_map(with_all).collect()
}

/// What there was before, as it fades over each of the times.
fn faded(rows: &[Row], values: &[f64]) -> Vec<Vec<f64>> {
    let over = |time_s: &f64| {
        let mut now = 0.0;
        let fades = series(rows).into_iter().flat_map(|of| {
            let first = of.start;
            of.map(move |k| (k, k > first))
        });
        let fades = fades.map(|(k, goes_on)| {
            let share = if goes_on {
                -((rows[k - 1].time_s - rows[k].time_s) / time_s).exp_m1()
            } else {
                1.0
            };
            now += share * (values[k] - now);
            now
        });
        fades.collect()
    };
    FADING_S.iter().map(over).collect()
}

fn jerk(rows: &[Row]) -> Vec<f64> {
    (0..rows.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(1), (k + 1).min(rows.len() - 1));
            let (a, b) = (&rows[from], &rows[to]);
            let time_s = b.time_s - a.time_s;
            if a.stretch != b.stretch || a.channel != b.channel || time_s <= 0.0 {
                return 0.0;
            }
            (b.acceleration_rad_s2 - a.acceleration_rad_s2) / time_s
        })
        .collect()
}

/// Way since the last change of direction.
fn travelled(rows: &[Row]) -> Vec<f64> {
    let mut travelled = Vec::with_capacity(rows.len());
    let mut way_rad = 0.0;
    for (k, row) in rows.iter().enumerate() {
        let before = k.checked_sub(1).map(|k| &rows[k]);
        let goes_on = before.is_some_and(|before| {
            before.stretch == row.stretch
                && before.channel == row.channel
                && before.velocity_rad_s * row.velocity_rad_s > 0.0
        });
        way_rad = match before {
            Some(before) if goes_on => way_rad + (row.position_rad - before.position_rad).abs(),
            _ => 0.0,
        };
        travelled.push(way_rad);
    }
    travelled
}

/// A time in which a joint moves one way.
#[derive(Clone, Copy, Debug)]
struct Moment {
    stretch: usize,
    from_s: f64,
    to_s: f64,
    /// What constant torque takes off the squares of a residual.
    square: f64,
}

impl Moment {
    fn holds(&self, row: &Row) -> bool {
        row.stretch == self.stretch && (self.from_s..self.to_s).contains(&row.time_s)
    }

    fn meets(&self, other: &Self) -> bool {
        self.stretch == other.stretch && self.from_s < other.to_s && other.from_s < self.to_s
    }
}

/// Constant torques in the few moments in which most is left, one family for each number of them. They are the best of as many
/// as there are ways to choose them.
fn pushes(rows: &[Row], residual_nm: &[f64]) -> Vec<Family> {
    let mut moments = moments(rows, residual_nm);
    let among = moments.len() as f64;
    moments.sort_by(|a, b| b.square.total_cmp(&a.square));
    let mut chosen: Vec<Moment> = Vec::new();
    for moment in moments {
        if chosen.len() < PUSHES && !chosen.iter().any(|other| other.meets(&moment)) {
            chosen.push(moment);
        }
    }
    let column = |moment: &Moment| -> Vec<f64> {
        let is_in = rows.iter().map(|row| f64::from(moment.holds(row)));
        is_in.collect()
    };
    let columns: Vec<Vec<f64>> = chosen.iter().map(column).collect();
    let mut tried = 1.0;
    (1..=columns.len())
        .map(|count| {
            tried *= among / count as f64;
            Family {
                over: PUSHES_OVER,
                columns: columns[..count].to_vec(),
                tried,
            }
        })
        .collect()
}

/// Every time of one of the lengths in which a joint moves one way throughout.
fn moments(rows: &[Row], residual_nm: &[f64]) -> Vec<Moment> {
    let motor: Vec<(&Row, f64)> = rows
        .iter()
        .zip(residual_nm.iter().copied())
        .filter(|(row, _)| row.channel == Channel::Motor)
        .collect();
    let square = motor.iter().map(|(row, _)| row.velocity_rad_s.powi(2));
    let moving_rad_s = PUSHED_MOVING * (square.sum::<f64>() / motor.len().max(1) as f64).sqrt();
    let mut all = Vec::new();
    for length_s in PUSH_S {
        let place = |row: &Row| (row.stretch, (2.0 * row.time_s / length_s).floor() as i64);
        let mut start = 0;
        while start < motor.len() {
            let (first, _) = motor[start];
            let (stretch, step) = place(first);
            let from_s = 0.5 * length_s * step as f64;
            let mut moment = Moment {
                stretch,
                from_s,
                to_s: from_s + length_s,
                square: 0.0,
            };
            let inside = || {
                motor[start..]
                    .iter()
                    .take_while(|(row, _)| moment.holds(row))
            };
            let (mut sum_nm, mut count) = (0.0, 0.0);
            for (_, left_nm) in inside() {
                sum_nm += left_nm;
                count += 1.0;
            }
            let way = first.velocity_rad_s.signum();
            let moves = inside().all(|(row, _)| way * row.velocity_rad_s > moving_rad_s);
            if moves {
                moment.square = sum_nm * sum_nm / f64::max(count, 1.0);
                all.push(moment);
            }
            let begins = |(row, _): &(&Row, f64)| place(row) != (stretch, step);
            let next = motor[start..].iter().position(begins);
            start = next.map_or(motor.len(), |ahead| start + ahead);
        }
    }
    all
}

/// Sine and cosine over time at the frequency at which the residual of the motor's channel is strongest.
fn vibration(rows: &[Row], residual_nm: &[f64]) -> Option<Family> {
    strongest_hz(rows, residual_nm, VIBRATION_HZ).map(|found| waves(rows, found))
}

/// Sine and cosine over time at a frequency, and how many were tried.
fn waves(rows: &[Row], (hz, tried): (f64, usize)) -> Family {
    let angles = || rows.iter().map(|row| TAU * hz * row.time_s);
    Family {
        over: "time, as a vibration",
        columns: vec![
            angles().map(f64::sin).collect(),
            angles().map(f64::cos).collect(),
        ],
        tried: tried as f64,
    }
}

/// A steady vibration, unless its frequency is one of the motion, this joint's or another's: what follows the motion vibrates
/// with it. `others`: velocities of the other joints, row by row.
pub fn foreign_vibration(rows: &[Row], residual_nm: &[f64], others: &[Vec<f64>]) -> Option<Family> {
    let found = strongest_hz(rows, residual_nm, VIBRATION_HZ)?;
    let count = rows.len().max(1) as f64;
    let mean_rad = rows.iter().map(|row| row.position_rad).sum::<f64>() / count;
    let own: Vec<f64> = rows.iter().map(|row| row.position_rad - mean_rad).collect();
    let swings_with = |motion: &Vec<f64>| {
        let moving_hz = strongest_hz(rows, motion, [MOTION_HZ_LEAST, VIBRATION_HZ[1]]);
        moving_hz.is_some_and(|(moving_hz, _)| {
            let apart_hz = |harmonic: i32| (found.0 - f64::from(harmonic) * moving_hz).abs();
            (1..=MOTION_HARMONICS).any(|harmonic| apart_hz(harmonic) < 2.0 * step_hz(rows))
        })
    };
    let mut motions = std::iter::once(&own).chain(others);
    (!motions.any(swings_with)).then(|| waves(rows, found))
}

/// Half of what the rows' time tells apart.
fn step_hz(rows: &[Row]) -> f64 {
    let end_s = rows.iter().map(|row| row.time_s).fold(0.0, f64::max);
    0.5 / end_s.max(1.0)
}

/// The frequency at which a series has most power in the motor's channel, and how many were tried.
fn strongest_hz(rows: &[Row], values: &[f64], range_hz: [f64; 2]) -> Option<(f64, usize)> {
    let motor: Vec<(f64, f64)> = rows
        .iter()
        .zip(values)
        .filter(|(row, _)| row.channel == Channel::Motor)
        .map(|(row, value)| (row.time_s, *value))
        .collect();
    let step_hz = step_hz(rows);
    let tried = ((range_hz[1] - range_hz[0]) / step_hz) as usize;
    let strongest = |first_hz: f64, step_hz: f64, tried: usize| {
        let angles_rad = motor.iter().map(|(time_s, _)| TAU * time_s);
        let mut waves = Waves::from(angles_rad, first_hz, step_hz);
        let powers = (0..tried).map(|k| {
            let (mut sin_sum, mut cos_sum) = (0.0, 0.0);
            for ([sin, cos], (_, value)) in waves.now().iter().zip(&motor) {
                sin_sum += sin * value;
                cos_sum += cos * value;
            }
            waves.turn();
            (k, sin_sum * sin_sum + cos_sum * cos_sum)
        });
        powers.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    };
    let near = strongest(range_hz[0], step_hz, tried)?;
    let near_hz = range_hz[0] + near as f64 * step_hz;
    let finer = strongest(near_hz - step_hz, step_hz / FINER as f64, 2 * FINER + 1)?;
    let away = finer as f64 - FINER as f64;
    Some((near_hz + away / FINER as f64 * step_hz, tried))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hats_sum_to_one_and_follow_a_line() {
        let values: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.1).collect();
        let hats = hats(&values, 5);
        for k in 0..100 {
            let sum: f64 = hats.iter().map(|hat| hat[k]).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{k}: {sum}");
        }
    }

    #[test]
    fn what_fades_does_so_over_each_time_and_not_across_recordings() {
        let rows: Vec<Row> = (0..120)
            .map(|k| Row {
                stretch: usize::from(k >= 60),
                ..Row::at_rest(f64::from(k % 60) / 60.0)
            })
            .collect();
        let stepped: Vec<f64> = (0..120).map(|k| f64::from(k % 60 >= 30)).collect();
        for (column, time_s) in faded(&rows, &stepped).iter().zip(FADING_S) {
            for of in [&column[..60], &column[60..]] {
                assert!(of[..30].iter().all(|value| *value == 0.0));
                let expected = -(-0.5 / time_s).exp_m1();
                assert!((of[59] - expected).abs() < 1e-9, "{}", of[59]);
            }
        }
    }

    #[test]
    fn what_is_late_behind_the_motion_lies_in_its_past() {
        let rows: Vec<Row> = (0..1800)
            .map(|k| Row::at_rest(f64::from(k) / 60.0))
            .collect();
        let swings = [(0.3, 1.0), (1.1, 0.3), (3.7, 0.1)];
        let acceleration_rad_s2 = each_of(&rows, |time_s| {
            let swing = |(hz, size): (f64, f64)| size * (TAU * hz * time_s).sin();
            swings.map(swing).iter().sum()
        });
        // two low-passes after each other are in none of the columns
        let late = |time_constant_s: f64, values: &[f64]| -> Vec<f64> {
            let mut now = 0.0;
            let share = -(-1.0 / 60.0 / time_constant_s).exp_m1();
            let steps = values.iter().map(|value| {
                now += share * (value - now);
                now
            });
            steps.collect()
        };
        let torque_nm = late(0.05, &late(0.2, &acceleration_rad_s2));
        let mut past = faded(&rows, &acceleration_rad_s2);
        past.push(acceleration_rad_s2);
        let columns = DMatrix::from_fn(rows.len(), past.len(), |row, k| past[k][row]);
        let target = DVector::from_vec(torque_nm);
        let fit = columns.clone().svd(true, true).solve(&target, 1e-12);
        let left = &target - columns * fit.expect("both sides of the decomposition are there");
        assert!(left.norm() < 0.01 * target.norm(), "{}", left.norm());
    }

    fn each_of(rows: &[Row], value: impl Fn(f64) -> f64) -> Vec<f64> {
        rows.iter().map(|row| value(row.time_s)).collect()
    }

    #[test]
    fn products_are_of_every_two() {
        let (these, those) = (hats(&[0.0, 1.0, 2.0], 3), hats(&[0.0, 2.0, 1.0], 2));
        let all = products(&these, &those);
        assert_eq!(all.len(), 6);
        let sums = (0..3).map(|k| all.iter().map(|column| column[k]).sum::<f64>());
        assert!(sums.into_iter().all(|sum| (sum - 1.0).abs() < 1e-12));
    }

    #[test]
    fn a_vibration_is_foreign_unless_the_motion_swings_with_it() {
        let rows: Vec<Row> = (0..1800)
            .map(|k| {
                let time_s = f64::from(k) / 60.0;
                Row {
                    position_rad: 0.2 + (TAU * 0.31 * time_s).sin(),
                    ..Row::at_rest(time_s)
                }
            })
            .collect();
        let at = |hz: f64| -> Vec<f64> {
            let angles = rows.iter().map(|row| TAU * hz * row.time_s + 0.7);
            angles.map(f64::sin).collect()
        };
        let vibration = foreign_vibration(&rows, &at(4.693), &[]).expect("none of the motion's");
        let along = |column: &Vec<f64>| -> f64 {
            let both = column.iter().zip(at(4.693));
            both.map(|(a, b)| a * b).sum::<f64>() / 900.0
        };
        let size = along(&vibration.columns[0]).hypot(along(&vibration.columns[1]));
        assert!((size - 1.0).abs() < 0.01, "{size}");
        for harmonic in [1.0, 2.0, 3.0] {
            assert!(foreign_vibration(&rows, &at(0.31 * harmonic), &[]).is_none());
        }
        // nor with another joint's
        assert!(foreign_vibration(&rows, &at(4.693), &[at(1.2), at(4.693)]).is_none());
    }

    #[test]
    fn pushes_are_found_where_they_are_and_not_where_the_joint_turns() {
        let rows: Vec<Row> = (0..1800)
            .map(|k| {
                let time_s = f64::from(k) / 60.0;
                Row {
                    velocity_rad_s: (TAU * 0.25 * time_s).sin(),
                    ..Row::at_rest(time_s)
                }
            })
            .collect();
        // while the joint moves, and once where it turns round
        let pushed_s = [(4.5, 5.1), (10.8, 11.4), (15.8, 16.2)];
        let is_pushed = |row: &Row| {
            let mut pushes = pushed_s.iter();
            pushes.any(|(from_s, to_s)| (*from_s..*to_s).contains(&row.time_s))
        };
        let residual_nm: Vec<f64> = rows.iter().map(|row| f64::from(is_pushed(row))).collect();
        let families = pushes(&rows, &residual_nm);
        assert_eq!(families.len(), PUSHES);
        assert!(families.iter().all(|of| of.over == PUSHES_OVER));
        let two = &families[1].columns;
        for column in two {
            let inside = rows.iter().zip(column).filter(|(_, value)| **value > 0.0);
            let (mut count, mut within) = (0, 0);
            for (row, _) in inside {
                count += 1;
                within += usize::from(is_pushed(row) && !(15.0..17.0).contains(&row.time_s));
            }
            assert_eq!(count, within);
            assert!(count >= 30, "{count}");
        }
        assert!(families[1].tried > families[0].tried);
    }

    #[test]
    fn noise_is_worth_nothing_and_a_shape_its_size() {
        let information = DMatrix::identity(4, 4) * 100.0;
        let none = evidence_nats(information.clone(), &DVector::from_element(4, 10.0), 1.0);
        assert!(none.abs() < 1.0, "{none}");
        let vector = DVector::from_element(4, 100.0);
        let there = evidence_nats(information, &vector, 1.0);
        // half the square taken off, less what four free values cost
        assert!((150.0..200.0).contains(&there), "{there}");
    }
}
