//! Friction at evenly spaced motor angles over whole revolutions, without mean and slow trend.

use std::f64::consts::TAU;

use joint_model::friction::Direction;

use crate::steady_motion::constant::FrictionRow;

/// The most points per motor revolution: 13 for each of the 39 cycles that Table III reaches.
const POINTS_MAX: usize = 512;

/// The least: harmonics up to the eighth.
const POINTS_MIN: usize = 16;

/// Rows averaged into a point, at least on average.
const ROWS_PER_POINT: f64 = 4.0;

/// One stretch. The i-th value is the mean level of the rows within half a step of motor angle
/// `(first + i)·2π/points`.
#[derive(Clone, Debug)]
pub(super) struct AngleSeries {
    pub points: usize,
    pub first: i64,
    /// Positive opposes the motion; mean and trend removed.
    pub level_nm: Vec<f64>,
    pub mean_nm: f64,
}

/// The least rows in a motor revolution.
pub(super) const ROWS_MIN: f64 = POINTS_MIN as f64 * ROWS_PER_POINT;

/// Rows in a motor revolution, in the stretch that has fewest.
pub(super) fn rows_per_revolution(stretches: &[&Vec<FrictionRow>]) -> f64 {
    let of_stretch = |rows: &&Vec<FrictionRow>| {
        let (least, most) = angle_range(rows);
        rows.len() as f64 * TAU / (most - least)
    };
    stretches
        .iter()
        .map(of_stretch)
        .fold(f64::INFINITY, f64::min)
}

/// Points per revolution that so many rows can fill: even, so that a line lies at half of them.
pub(super) fn points(rows_per_revolution: f64) -> usize {
    let points = (rows_per_revolution / ROWS_PER_POINT).min(POINTS_MAX as f64) as usize;
    points - points % 2
}

fn angle_range(rows: &[FrictionRow]) -> (f64, f64) {
    rows.iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), row| {
            (
                least.min(row.motor_position_rad),
                most.max(row.motor_position_rad),
            )
        })
}

impl AngleSeries {
    /// Averages rows into points; none where they hold no whole revolution.
    pub fn new(rows: &[FrictionRow], direction: Direction, points: usize) -> Option<Self> {
        let place = |angle_rad: f64| (angle_rad * points as f64 / TAU).round();
        let (least, most) = angle_range(rows);
        let (start, end) = (place(least), place(most));
        // Rows at the ends fill their points only in part.
        let revolutions = ((end - start - 1.0) / points as f64).floor();
        // Beyond 2^53 neighbouring points have no angles of their own.
        if !(revolutions >= 1.0 && start.abs().max(end.abs()) < 1.0 / f64::EPSILON) {
            return None;
        }
        let mut sums = vec![Sum::default(); (end - start) as usize + 1];
        for row in rows {
            let nearest = place(row.motor_position_rad);
            let sum = &mut sums[(nearest - start) as usize];
            sum.level_nm += direction.sign() * row.friction_nm;
            sum.off_centre += row.motor_position_rad * points as f64 / TAU - nearest;
            sum.rows += 1.0;
        }
        let mut level_nm = centred(&means(&sums), &sums);
        level_nm.drain(..1);
        level_nm.truncate(revolutions as usize * points);
        let mean_nm = level_nm.iter().sum::<f64>() / level_nm.len() as f64;
        remove_trend(&mut level_nm, points);
        Some(Self {
            points,
            first: start as i64 + 1,
            level_nm,
            mean_nm,
        })
    }

    pub fn revolutions(&self) -> usize {
        self.level_nm.len() / self.points
    }

    /// Motor angle of each point.
    pub fn angles_rad(&self) -> impl Iterator<Item = f64> {
        let step_rad = TAU / self.points as f64;
        (0..self.level_nm.len()).map(move |i| (self.first + i as i64) as f64 * step_rad)
    }
}

/// The rows nearest to a point.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    level_nm: f64,
    /// Of the rows from the point, in steps between points.
    off_centre: f64,
    rows: f64,
}

/// Means of the points; a point without rows, from an encoder coarser than the points, lies between its neighbours.
fn means(sums: &[Sum]) -> Vec<f64> {
    let mut level_nm: Vec<f64> = sums.iter().map(|sum| sum.level_nm / sum.rows).collect();
    let filled: Vec<usize> = (0..sums.len()).filter(|i| sums[*i].rows > 0.0).collect();
    for pair in filled.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        for i in from + 1..to {
            let part = (i - from) as f64 / (to - from) as f64;
            level_nm[i] = level_nm[from] + part * (level_nm[to] - level_nm[from]);
        }
    }
    level_nm
}

/// Moves each mean along the local slope to its point. A few rows do not lie evenly about a point, and how they lie
/// repeats along the motion: left alone, that shows as harmonics of its own.
fn centred(means_nm: &[f64], sums: &[Sum]) -> Vec<f64> {
    let mut level_nm = means_nm.to_vec();
    for i in 1..means_nm.len().saturating_sub(1) {
        if sums[i].rows > 0.0 {
            let slope_nm = 0.5 * (means_nm[i + 1] - means_nm[i - 1]);
            level_nm[i] -= slope_nm * sums[i].off_centre / sums[i].rows;
        }
    }
    level_nm
}

/// Removes the mean, and over several revolutions the line from one revolution's mean to the next's. These means do
/// not see whole cycles per revolution, so harmonics stay whole, which a fitted polynomial would not leave so.
fn remove_trend(level_nm: &mut [f64], points: usize) {
    let means_nm: Vec<f64> = level_nm
        .chunks(points)
        .map(|revolution| revolution.iter().sum::<f64>() / points as f64)
        .collect();
    let middle = 0.5 * (points as f64 - 1.0);
    for (i, level_nm) in level_nm.iter_mut().enumerate() {
        let place = (i as f64 - middle) / points as f64;
        let before = (place.max(0.0) as usize).min(means_nm.len().saturating_sub(2));
        let after = (before + 1).min(means_nm.len() - 1);
        let trend_nm =
            means_nm[before] + (place - before as f64) * (means_nm[after] - means_nm[before]);
        *level_nm -= trend_nm;
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    fn rows(range_rad: (f64, f64), count: usize, law: impl Fn(f64) -> f64) -> Vec<FrictionRow> {
        let step_rad = (range_rad.1 - range_rad.0) / count as f64;
        (0..count)
            .map(|i| {
                let motor_position_rad = range_rad.0 + step_rad * i as f64;
                FrictionRow {
                    time_s: i as f64,
                    motor_position_rad,
                    friction_nm: law(motor_position_rad),
                    load_nm: 0.0,
                }
            })
            .collect()
    }

    #[test]
    fn keeps_harmonics_and_loses_mean_and_slope() {
        let law = |angle: f64| 20.0 + 0.05 * angle + 3.0 * (2.0 * angle).sin();
        for (from_rad, to_rad) in [(-20.0, 20.0), (20.0, -20.0)] {
            let rows = rows((from_rad, to_rad), 40_000, law);
            let direction = Direction::of(to_rad - from_rad);
            let series = AngleSeries::new(&rows, direction, 64).unwrap();
            assert_eq!(series.revolutions(), 6);
            for (angle_rad, level_nm) in series.angles_rad().zip(&series.level_nm) {
                let expected_nm = direction.sign() * 3.0 * (2.0 * angle_rad).sin();
                assert!((level_nm - expected_nm).abs() < 0.03, "{angle_rad}");
            }
        }
    }

    #[test]
    fn an_encoder_coarser_than_the_points_leaves_no_gap() {
        let coarse = |angle: f64| (angle / 0.3).round() * 0.3;
        let mut rows = rows((0.0, 15.0), 5000, f64::sin);
        for row in &mut rows {
            row.motor_position_rad = coarse(row.motor_position_rad);
        }
        let series = AngleSeries::new(&rows, Direction::Positive, 64).unwrap();
        assert!(series.level_nm.iter().all(|level| level.is_finite()));
    }

    #[test]
    fn less_than_a_revolution_is_none() {
        let rows = rows((0.0, 6.0), 5000, f64::sin);
        assert!(AngleSeries::new(&rows, Direction::Positive, 64).is_none());
    }
}
