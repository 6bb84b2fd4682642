//! From recordings of slow motion to the harmonics of both directions.

use joint_model::friction::Direction;
use recording::{Recording, Signal};
use robot::Robot;
use serde::Serialize;

use super::harmonics::{harmonics, longest};
use super::series::{self, AngleSeries, ROWS_MIN, rows_per_revolution};
use super::spectrum::Spectrum;
use super::{Harmonic, SpectralLine};
use crate::IdentificationError;
use crate::statistics::root_mean_square;
use crate::steady_motion::constant::{FrictionRow, Span, SteadyMotion, same_speed};

/// Position-dependent friction of one joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PeriodicAnalysis {
    /// The joint's name.
    pub joint: String,
    /// Motor turns per joint turn.
    pub gear_ratio: f64,
    /// Motion along the joint's axis.
    pub positive: DirectionAnalysis,
    /// Motion against it.
    pub negative: DirectionAnalysis,
    /// Harmonics of both directions together, largest first: what `position_dependent_friction` of a robot file takes.
    pub combined: Vec<Harmonic>,
}

/// Position-dependent friction in one direction of motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DirectionAnalysis {
    /// Velocity asked for.
    pub reference_rad_s: f64,
    /// Harmonics above the noise, largest first: a row of Table III.
    pub harmonics: Vec<Harmonic>,
    /// Mean friction level over the whole revolutions.
    pub mean_nm: f64,
    /// Whole motor revolutions analysed, over all stretches.
    pub revolutions: usize,
    /// Root mean square of the zero-mean friction.
    pub rms_nm: f64,
    /// Root mean square of what the harmonics leave of it.
    pub residual_rms_nm: f64,
    /// Zero-mean friction at motor angles `2π·i/n`, the mean over revolutions (Fig. 5).
    pub mean_revolution_nm: Vec<f64>,
    /// Amplitude spectrum of the longest stretch, up to half the points of a revolution, and what noise reaches.
    pub spectrum: Vec<SpectralLine>,
}

/// Analyses the slowest constant-velocity motion of `joint` in each direction.
///
/// The first and last `settling_s` of each stretch are dropped, see [`crate::friction::SETTLING_S`]; gravity is that of
/// the robot's rigid bodies. What varies over more than a motor revolution is taken for a trend and removed.
///
/// # Errors
/// [`IdentificationError`], naming joint and signal: as [`crate::friction::measure_steady`], and where a direction has
/// no whole motor revolution or too few rows in one.
pub fn analyse_periodic(
    recordings: &[Recording],
    robot: &Robot,
    joint: &str,
    settling_s: f64,
) -> Result<PeriodicAnalysis, IdentificationError> {
    let motion = SteadyMotion::new(recordings, robot, joint, settling_s)?;
    let positive = Slowest::of(&motion, joint, Direction::Positive)?;
    let negative = Slowest::of(&motion, joint, Direction::Negative)?;
    let rows: Vec<&Vec<FrictionRow>> = positive.rows.iter().chain(&negative.rows).collect();
    let rows_per_revolution = rows_per_revolution(&rows);
    if rows_per_revolution < ROWS_MIN {
        let what = "rows in a motor revolution";
        return Err(too_short(joint, what, rows_per_revolution, ROWS_MIN));
    }
    let points = series::points(rows_per_revolution);
    let positive_series = positive.series(joint, points)?;
    let negative_series = negative.series(joint, points)?;
    let all: Vec<&AngleSeries> = positive_series.iter().chain(&negative_series).collect();
    let gear_ratio = motion.gear_ratio();
    Ok(PeriodicAnalysis {
        joint: joint.to_owned(),
        gear_ratio,
        positive: analysis(positive.reference_rad_s, &positive_series, gear_ratio),
        negative: analysis(negative.reference_rad_s, &negative_series, gear_ratio),
        combined: harmonics(&all, gear_ratio).harmonics,
    })
}

/// The slowest stretches of one direction.
struct Slowest {
    direction: Direction,
    reference_rad_s: f64,
    rows: Vec<Vec<FrictionRow>>,
}

impl Slowest {
    fn of(
        motion: &SteadyMotion,
        joint: &str,
        direction: Direction,
    ) -> Result<Self, IdentificationError> {
        let of_direction = |span: &&Span| Direction::of(span.reference_rad_s) == direction;
        let references = motion.spans().iter().filter(of_direction);
        let slowest = references
            .map(|span| span.reference_rad_s)
            .min_by(|a, b| a.abs().total_cmp(&b.abs()));
        let reference_rad_s = slowest.ok_or_else(|| {
            let what = match direction {
                Direction::Positive => "stretches of constant positive velocity",
                Direction::Negative => "stretches of constant negative velocity",
            };
            too_short(joint, what, 0.0, 1.0)
        })?;
        let slow = motion.spans().iter();
        let slow = slow.filter(|span| same_speed(span.reference_rad_s, reference_rad_s));
        Ok(Self {
            direction,
            reference_rad_s,
            rows: slow
                .map(|span| motion.friction_rows(span))
                .collect::<Result<_, _>>()?,
        })
    }

    fn series(&self, joint: &str, points: usize) -> Result<Vec<AngleSeries>, IdentificationError> {
        let whole = |rows: &Vec<FrictionRow>| AngleSeries::new(rows, self.direction, points);
        let series: Vec<AngleSeries> = self.rows.iter().filter_map(whole).collect();
        if series.is_empty() {
            let what = match self.direction {
                Direction::Positive => "whole motor revolutions at the slowest positive velocity",
                Direction::Negative => "whole motor revolutions at the slowest negative velocity",
            };
            return Err(too_short(joint, what, 0.0, 1.0));
        }
        Ok(series)
    }
}

fn too_short(joint: &str, what: &'static str, found: f64, needed: f64) -> IdentificationError {
    IdentificationError::TooShort {
        joint: joint.to_owned(),
        signal: Signal::MotorPositionRad,
        what,
        found,
        needed,
    }
}

fn analysis(reference_rad_s: f64, series: &[AngleSeries], gear_ratio: f64) -> DirectionAnalysis {
    let stretches: Vec<&AngleSeries> = series.iter().collect();
    let found = harmonics(&stretches, gear_ratio);
    let levels_nm = series
        .iter()
        .flat_map(|series| series.level_nm.iter().copied());
    let revolutions: usize = series.iter().map(AngleSeries::revolutions).sum();
    let turned = |series: &AngleSeries| series.mean_nm * series.revolutions() as f64;
    DirectionAnalysis {
        reference_rad_s,
        mean_nm: series.iter().map(turned).sum::<f64>() / revolutions as f64,
        revolutions,
        rms_nm: root_mean_square(levels_nm),
        residual_rms_nm: found.residual_rms_nm,
        mean_revolution_nm: mean_revolution(series),
        spectrum: longest(&stretches)
            .and_then(|series| Spectrum::new(series, &series.level_nm))
            .map_or_else(Vec::new, |spectrum| spectrum.lines()),
        harmonics: found.harmonics,
    }
}

/// Mean over all revolutions at each point of one; every stretch holds whole revolutions.
fn mean_revolution(series: &[AngleSeries]) -> Vec<f64> {
    let points = series.first().map_or(0, |series| series.points);
    let mut mean_nm = vec![0.0; points];
    let revolutions: usize = series.iter().map(AngleSeries::revolutions).sum();
    for series in series {
        for (index, level_nm) in series.level_nm.iter().enumerate() {
            let point = (series.first + index as i64).rem_euclid(points as i64);
            mean_nm[point as usize] += level_nm / revolutions as f64;
        }
    }
    mean_nm
}
