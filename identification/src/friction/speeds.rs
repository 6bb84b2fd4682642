//! Measurements of one direction by speed, with the weight of each.

use joint_model::friction::Direction;

use super::SteadyMeasurement;
use crate::steady_motion::constant::same_speed;

/// The least scatter relative to the largest friction, for measurements that agree to the last digit.
const ROUNDING: f64 = 1e-9;

/// One measurement as a fit sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub speed_rad_s: f64,
    /// The speed asked for, equal in all trials of one speed.
    pub asked_rad_s: f64,
    /// Positive opposes the motion.
    pub level_nm: f64,
    /// One standard deviation of a measurement at this speed.
    pub scatter_nm: f64,
    pub trial: usize,
}

/// Finite measurements of a direction, weighted by the scatter of the trials at each speed.
///
/// The variance at a speed is the mean of that of its trials and the pooled one of the direction, so the scatter is at
/// least 0.7 of the pooled: five trials tell their own only within a factor of two or so, and the speed whose trials
/// happen to agree would rule the fit. A speed measured once has the pooled variance. Where no speed was measured
/// twice, all weigh the same: as the root mean square of the standard deviations within the measurements.
pub(super) fn weighted(measurements: &[SteadyMeasurement], direction: Direction) -> Vec<Point> {
    let usable = |m: &&SteadyMeasurement| {
        m.direction() == direction
            && m.friction_nm.is_finite()
            && m.velocity_rad_s.is_finite()
            && m.velocity_rad_s != 0.0
    };
    let usable: Vec<&SteadyMeasurement> = measurements.iter().filter(usable).collect();
    let pooled_nm = pooled_scatter_nm(&usable);
    usable
        .iter()
        .map(|m| Point {
            speed_rad_s: m.speed_rad_s(),
            asked_rad_s: m.reference_rad_s.abs(),
            level_nm: m.level_nm(),
            scatter_nm: trial_variance(&usable, m).map_or(pooled_nm, |variance| {
                (0.5 * (variance + pooled_nm.powi(2))).sqrt()
            }),
            trial: m.trial,
        })
        .collect()
}

fn levels_at(measurements: &[&SteadyMeasurement], at: &SteadyMeasurement) -> Vec<f64> {
    let same = |m: &&&SteadyMeasurement| same_speed(m.reference_rad_s, at.reference_rad_s);
    measurements
        .iter()
        .filter(same)
        .map(|m| m.level_nm())
        .collect()
}

fn trial_variance(measurements: &[&SteadyMeasurement], at: &SteadyMeasurement) -> Option<f64> {
    let levels_nm = levels_at(measurements, at);
    let spare = levels_nm.len().checked_sub(1).filter(|spare| *spare > 0)?;
    Some(squares_about_mean(&levels_nm) / spare as f64)
}

fn pooled_scatter_nm(measurements: &[&SteadyMeasurement]) -> f64 {
    // Summed over measurements, each with its share of its speed's squares and freedom.
    let (mut squares, mut spare) = (0.0, 0.0);
    for m in measurements {
        let levels_nm = levels_at(measurements, m);
        let count = levels_nm.len() as f64;
        squares += squares_about_mean(&levels_nm) / count;
        spare += (count - 1.0) / count;
    }
    let count = measurements.len().max(1) as f64;
    let within = measurements.iter().map(|m| m.std_nm.powi(2)).sum::<f64>() / count;
    let scatter_nm = if spare > 0.5 {
        (squares / spare).sqrt()
    } else {
        within.sqrt()
    };
    let largest_nm = measurements
        .iter()
        .fold(0.0_f64, |largest, m| largest.max(m.friction_nm.abs()));
    let floor_nm = (ROUNDING * largest_nm).max(f64::MIN_POSITIVE.sqrt());
    if scatter_nm.is_finite() {
        scatter_nm.max(floor_nm)
    } else {
        floor_nm
    }
}

fn squares_about_mean(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|value| (value - mean).powi(2)).sum()
}

/// How well a drive's torque is known, as a share of friction: the digit of PA10-05's servo driver, 0.001 Nm (eq (1)), of the
/// 0.8 Nm or so that its large joints take. Trials repeat such errors, so their scatter does not tell.
const ACCURACY: f64 = 1e-3;

/// One point for each speed, with what really is uncertain about it: the mean's share of the scatter, enlarged by
/// `birge` where the model misses the speeds by more than the trials scatter, and the accuracy of the torque.
pub(super) fn independent(points: &[Point], birge: f64) -> Vec<Point> {
    let means = grouped(points).into_iter().enumerate();
    means
        .map(|(trial, group)| {
            let scatter_nm = birge * group.scatter_nm / (group.count as f64).sqrt();
            Point {
                speed_rad_s: group.speed_rad_s,
                asked_rad_s: group.speed_rad_s,
                level_nm: group.level_nm,
                scatter_nm: scatter_nm.hypot(ACCURACY * group.level_nm),
                trial,
            }
        })
        .collect()
}

/// All points at one speed.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpeedGroup {
    pub speed_rad_s: f64,
    pub level_nm: f64,
    pub scatter_nm: f64,
    pub count: usize,
}

/// Means of the points at each speed, which share their scatter.
pub(super) fn grouped(points: &[Point]) -> Vec<SpeedGroup> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.asked_rad_s.total_cmp(&b.asked_rad_s));
    let groups = sorted.chunk_by(|a, b| same_speed(a.asked_rad_s, b.asked_rad_s));
    groups
        .map(|group| {
            let mean =
                |of: fn(&Point) -> f64| group.iter().map(of).sum::<f64>() / group.len() as f64;
            SpeedGroup {
                speed_rad_s: mean(|p| p.speed_rad_s),
                level_nm: mean(|p| p.level_nm),
                scatter_nm: mean(|p| p.scatter_nm),
                count: group.len(),
            }
        })
        .collect()
}
