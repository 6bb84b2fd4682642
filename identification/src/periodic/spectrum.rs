//! Fourier transform of a series and the floor of noise under it.

use std::f64::consts::{LN_2, PI};

use realfft::RealFftPlanner;
use serde::Serialize;

use super::series::AngleSeries;

/// Probability that noise alone shows a peak anywhere in a spectrum.
pub const FALSE_ALARM_PROBABILITY: f64 = 0.01;

/// Lines to either side of a line whose median tells the noise there: narrow enough to follow its colour, wide enough
/// that the lines of a few harmonics do not lift it and that it is known to about a tenth.
const NEIGHBOURS: usize = 50;

/// One line of the amplitude spectrum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpectralLine {
    /// Frequency.
    pub cycles_per_motor_rev: f64,
    /// Amplitude of the sine at this frequency.
    pub amplitude_nm: f64,
    /// What a peak must exceed to be taken for a harmonic.
    pub threshold_nm: f64,
}

/// Squared magnitudes of the lines above half a cycle per revolution, and the mean that noise has there.
pub(super) struct Spectrum {
    samples: usize,
    points: usize,
    revolutions: usize,
    /// Number of the first line: the slow trend below is removed.
    first_line: usize,
    power: Vec<f64>,
    noise: Vec<f64>,
}

impl Spectrum {
    /// The transform of `level_nm`, whose angles are those of the series. `None` where it cannot be transformed.
    pub fn new(series: &AngleSeries, level_nm: &[f64]) -> Option<Self> {
        let samples = level_nm.len();
        let transform = RealFftPlanner::new().plan_fft_forward(samples);
        let mut input = level_nm.to_vec();
        let mut output = transform.make_output_vec();
        transform.process(&mut input, &mut output).ok()?;
        let revolutions = series.revolutions();
        let first_line = revolutions / 2 + 1;
        // The line at half the points has no phase.
        let power: Vec<f64> = output[first_line..samples / 2]
            .iter()
            .map(|line| line.norm_sqr())
            .collect();
        Some(Self {
            samples,
            points: series.points,
            revolutions,
            first_line,
            noise: noise(&power),
            power,
        })
    }

    /// Power of noise has an exponential distribution: with mean `m` it exceeds `m·ln(L/p)` in any of `L` lines with
    /// probability `p`.
    fn threshold(&self, line: usize) -> f64 {
        self.noise[line] * (self.power.len() as f64 / FALSE_ALARM_PROBABILITY).ln()
    }

    /// The line that stands out most, in cycles per motor revolution, if noise would not show it.
    pub fn highest_peak(&self) -> Option<f64> {
        let excess = |line: &usize| self.power[*line] / self.threshold(*line);
        let highest = (0..self.power.len())
            .filter(|line| self.power[*line] > self.threshold(*line))
            .max_by(|a, b| excess(a).total_cmp(&excess(b)))?;
        Some(self.cycles(highest))
    }

    /// Variance per sample of the noise near a frequency.
    pub fn noise_variance(&self, cycles_per_motor_rev: f64) -> f64 {
        let line = (cycles_per_motor_rev * self.revolutions as f64).round() as usize;
        let line = line.saturating_sub(self.first_line);
        let noise = self.noise.get(line).or(self.noise.last());
        noise.copied().unwrap_or_default() / self.samples as f64
    }

    pub fn lines(&self) -> Vec<SpectralLine> {
        let line = |index: usize| {
            let cycles_per_motor_rev = self.cycles(index);
            let amplitude_nm = |power: f64| {
                2.0 * power.sqrt() / self.samples as f64 / kept(cycles_per_motor_rev, self.points)
            };
            SpectralLine {
                cycles_per_motor_rev,
                amplitude_nm: amplitude_nm(self.power[index]),
                threshold_nm: amplitude_nm(self.threshold(index)),
            }
        };
        (0..self.power.len()).map(line).collect()
    }

    fn cycles(&self, line: usize) -> f64 {
        (line + self.first_line) as f64 / self.revolutions as f64
    }
}

/// What the mean over a point's rows keeps of a sine's amplitude.
pub(super) fn kept(cycles_per_motor_rev: f64, points: usize) -> f64 {
    let half_step = PI * cycles_per_motor_rev / points as f64;
    if half_step == 0.0 {
        1.0
    } else {
        half_step.sin() / half_step
    }
}

/// Mean power of noise at each line. The median of its neighbours does not see a harmonic's few lines; an exponential
/// distribution's mean is its median over ln 2.
fn noise(power: &[f64]) -> Vec<f64> {
    (0..power.len())
        .map(|line| {
            let from = line.saturating_sub(NEIGHBOURS);
            let to = (line + NEIGHBOURS + 1).min(power.len());
            let mut near = power[from..to].to_vec();
            let middle = near.len() / 2;
            let (_, median, _) = near.select_nth_unstable_by(middle, f64::total_cmp);
            *median / LN_2
        })
        .collect()
}
