//! Dominant harmonics: found one by one in what the earlier ones leave, then fitted together.

use std::f64::consts::{PI, TAU};

use robot::Effect;
use serde::Serialize;

use super::series::AngleSeries;
use super::spectrum::{Spectrum, kept};
use super::tones::{Samples, Tone};
use crate::statistics::root_mean_square;

/// The most harmonics looked for: as many periodic terms as a joint's model has room for.
pub const HARMONICS_MAX: usize = joint_model::friction::TERMS_MAX;

/// A measured frequency within this many standard errors of a whole order is taken for the order.
const AGREES: f64 = 3.0;

/// One harmonic of the friction level, `A·sin(k·θ_motor + φ)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Harmonic {
    /// Table III's `A`.
    pub amplitude_nm: f64,
    /// One standard deviation of the amplitude.
    pub amplitude_standard_error_nm: f64,
    /// Phase at motor angle zero, -π to π.
    pub phase_rad: f64,
    /// One standard deviation of the phase.
    pub phase_standard_error_rad: f64,
    /// `k`: the whole number where the data agree with it, else as measured.
    pub cycles_per_motor_rev: f64,
    /// Table III's `f`: cycles per radian of joint angle, `k·N/2π`.
    pub cycles_per_joint_rad: f64,
    /// The nearest order of the wave generator.
    pub order: u32,
    /// Measured cycles per motor revolution less `order`.
    pub order_deviation: f64,
    /// One standard deviation of the measured cycles per motor revolution.
    pub order_standard_error: f64,
}

impl Harmonic {
    /// As a robot file writes it.
    #[must_use]
    pub fn effect(&self) -> Effect {
        Effect::PositionDependentFriction {
            amplitude_nm: self.amplitude_nm,
            cycles_per_motor_rev: self.cycles_per_motor_rev,
            phase_rad: self.phase_rad,
        }
    }
}

/// Harmonics, largest first, and what they leave.
#[derive(Default)]
pub(super) struct Found {
    pub harmonics: Vec<Harmonic>,
    pub residual_rms_nm: f64,
}

/// The stretch with the finest lines.
pub(super) fn longest<'a>(stretches: &[&'a AngleSeries]) -> Option<&'a AngleSeries> {
    stretches
        .iter()
        .copied()
        .max_by_key(|series| series.level_nm.len())
}

/// The harmonics of some stretches: looked for in the longest and fitted to all.
pub(super) fn harmonics(stretches: &[&AngleSeries], gear_ratio: f64) -> Found {
    let samples = Samples::new(stretches);
    longest(stretches)
        .and_then(|longest| fitted(&samples, stretches, longest, gear_ratio))
        .unwrap_or_default()
}

fn fitted(
    samples: &Samples,
    stretches: &[&AngleSeries],
    longest: &AngleSeries,
    gear_ratio: f64,
) -> Option<Found> {
    let (cycles, tones) = search(samples, longest);
    let noise = Spectrum::new(longest, &samples.residual_nm(longest, &tones))?;
    let precisions: Vec<Precision> = tones
        .iter()
        .map(|tone| Precision::of(tone, samples, &noise))
        .collect();
    let measured = || cycles.iter().zip(&precisions);
    let tied: Vec<f64> = measured().map(|(cycles, p)| p.tie(*cycles)).collect();
    let tones = samples.fit(&tied)?;
    let left_nm = stretches
        .iter()
        .flat_map(|series| samples.residual_nm(series, &tones));
    let residual_rms_nm = root_mean_square(left_nm);
    let mut harmonics: Vec<Harmonic> = tones
        .iter()
        .zip(measured())
        .map(|(tone, (measured_cycles, precision))| {
            let fit = TiedTone {
                tone,
                measured_cycles: *measured_cycles,
                precision,
                middle_rad: samples.middle_rad,
                kept: kept(*measured_cycles, longest.points),
            };
            fit.harmonic(gear_ratio)
        })
        .collect();
    harmonics.sort_by(|a, b| b.amplitude_nm.total_cmp(&a.amplitude_nm));
    Some(Found {
        harmonics,
        residual_rms_nm,
    })
}

/// Frequencies and sines that stand out, each found in what the earlier ones leave.
fn search(samples: &Samples, longest: &AngleSeries) -> (Vec<f64>, Vec<Tone>) {
    let line = 1.0 / longest.revolutions() as f64;
    let (mut cycles, mut tones): (Vec<f64>, Vec<Tone>) = (Vec::new(), Vec::new());
    while cycles.len() < HARMONICS_MAX {
        let residual_nm = samples.residual_nm(longest, &tones);
        let peak = Spectrum::new(longest, &residual_nm).and_then(|s| s.highest_peak());
        // Less than a line from a tone already fitted it is that tone's own unsteadiness.
        let known = |peak: &f64| cycles.iter().any(|known| (known - peak).abs() < line);
        let Some(peak) = peak.filter(|peak| !known(peak)) else {
            break;
        };
        let more: Vec<f64> = cycles.iter().copied().chain([peak]).collect();
        let Some(refined) = samples.refine(&more, 0.5 * line) else {
            break;
        };
        let Some(fitted) = samples.fit(&refined) else {
            break;
        };
        (cycles, tones) = (refined, fitted);
    }
    (cycles, tones)
}

/// Standard errors of one sine in noise that is white near its frequency (Rife and Boorstyn, IEEE Trans. Information
/// Theory 20 (1974) 591-598: the Cramér-Rao bounds).
struct Precision {
    amplitude_nm: f64,
    cycles: f64,
    /// Of the phase at the middle of the samples.
    phase_rad: f64,
}

impl Precision {
    fn of(tone: &Tone, samples: &Samples, noise: &Spectrum) -> Self {
        let variance = noise.noise_variance(tone.cycles_per_motor_rev);
        let amplitude_nm = (2.0 * variance / samples.count() as f64).sqrt();
        let phase_rad = amplitude_nm / tone.amplitude_nm();
        Self {
            amplitude_nm,
            cycles: phase_rad / samples.spread_rad,
            phase_rad,
        }
    }

    fn tie(&self, cycles: f64) -> f64 {
        if self.agrees(cycles) {
            cycles.round()
        } else {
            cycles
        }
    }

    fn agrees(&self, cycles: f64) -> bool {
        (cycles - cycles.round()).abs() <= AGREES * self.cycles
    }
}

/// A fitted sine with all that makes it a harmonic.
struct TiedTone<'a> {
    tone: &'a Tone,
    /// Before it was taken for a whole order.
    measured_cycles: f64,
    precision: &'a Precision,
    middle_rad: f64,
    /// Part of the amplitude that the points keep.
    kept: f64,
}

impl TiedTone<'_> {
    fn harmonic(&self, gear_ratio: f64) -> Harmonic {
        let Self {
            tone, precision, ..
        } = *self;
        let order = self.measured_cycles.round();
        let cycles_per_motor_rev = tone.cycles_per_motor_rev;
        // A frequency that is only measured turns the phase on the way from the middle of the samples to angle zero.
        let lever_rad = if precision.agrees(self.measured_cycles) {
            0.0
        } else {
            self.middle_rad * precision.cycles
        };
        let phase_rad = tone.cos_nm.atan2(tone.sin_nm) - cycles_per_motor_rev * self.middle_rad;
        Harmonic {
            amplitude_nm: tone.amplitude_nm() / self.kept,
            amplitude_standard_error_nm: precision.amplitude_nm / self.kept,
            phase_rad: (phase_rad + PI).rem_euclid(TAU) - PI,
            phase_standard_error_rad: precision.phase_rad.hypot(lever_rad),
            cycles_per_motor_rev,
            cycles_per_joint_rad: cycles_per_motor_rev * gear_ratio / TAU,
            order: order as u32,
            order_deviation: self.measured_cycles - order,
            order_standard_error: precision.cycles,
        }
    }
}
