//! Least squares of several sines whose frequencies are nearly known.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::series::AngleSeries;

/// Steps of Gauss and Newton's method: from within half a line of the truth the first leaves about a tenth of the
/// error, each further one squares what is left.
const STEPS: usize = 4;

/// All stretches as one set of samples.
pub(super) struct Samples {
    /// Motor angle less `middle_rad`.
    angle_rad: Vec<f64>,
    level_nm: Vec<f64>,
    pub middle_rad: f64,
    /// Root mean square of `angle_rad`: the lever that frequencies are told by.
    pub spread_rad: f64,
}

/// `sin_nm·sin(k·θ) + cos_nm·cos(k·θ)` with `θ` from the middle of the samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tone {
    pub cycles_per_motor_rev: f64,
    pub sin_nm: f64,
    pub cos_nm: f64,
}

impl Tone {
    pub fn amplitude_nm(&self) -> f64 {
        self.sin_nm.hypot(self.cos_nm)
    }

    fn level_nm(&self, angle_rad: f64) -> f64 {
        let (sin, cos) = (self.cycles_per_motor_rev * angle_rad).sin_cos();
        self.sin_nm * sin + self.cos_nm * cos
    }
}

impl Samples {
    pub fn new(stretches: &[&AngleSeries]) -> Self {
        let mut angle_rad: Vec<f64> = stretches.iter().flat_map(|s| s.angles_rad()).collect();
        let count = angle_rad.len() as f64;
        let middle_rad = angle_rad.iter().sum::<f64>() / count;
        angle_rad.iter_mut().for_each(|angle| *angle -= middle_rad);
        Self {
            spread_rad: (angle_rad.iter().map(|angle| angle.powi(2)).sum::<f64>() / count).sqrt(),
            level_nm: stretches
                .iter()
                .flat_map(|s| s.level_nm.iter().copied())
                .collect(),
            angle_rad,
            middle_rad,
        }
    }

    pub fn count(&self) -> usize {
        self.angle_rad.len()
    }

    /// Amplitudes of sines with the given frequencies; none where two frequencies cannot be told apart.
    pub fn fit(&self, cycles: &[f64]) -> Option<Vec<Tone>> {
        let columns = |angle_rad: f64, row: &mut DVector<f64>| {
            for (index, cycles) in cycles.iter().enumerate() {
                let (sin, cos) = (cycles * angle_rad).sin_cos();
                (row[2 * index], row[2 * index + 1]) = (sin, cos);
            }
        };
        let solution = self.solve(2 * cycles.len(), columns)?;
        let tone = |(index, &cycles_per_motor_rev): (usize, &f64)| Tone {
            cycles_per_motor_rev,
            sin_nm: solution[2 * index],
            cos_nm: solution[2 * index + 1],
        };
        Some(cycles.iter().enumerate().map(tone).collect())
    }

    /// Moves each frequency, by no more than `reach` cycles per revolution, to where the sum of squares is least.
    pub fn refine(&self, cycles: &[f64], reach: f64) -> Option<Vec<f64>> {
        let mut refined = cycles.to_vec();
        for _ in 0..STEPS {
            let tones = self.fit(&refined)?;
            let columns = |angle_rad: f64, row: &mut DVector<f64>| {
                for (index, tone) in tones.iter().enumerate() {
                    let (sin, cos) = (tone.cycles_per_motor_rev * angle_rad).sin_cos();
                    row[3 * index] = sin;
                    row[3 * index + 1] = cos;
                    row[3 * index + 2] = angle_rad * (tone.sin_nm * cos - tone.cos_nm * sin);
                }
            };
            let solution = self.solve(3 * tones.len(), columns)?;
            for (index, (refined, start)) in refined.iter_mut().zip(cycles).enumerate() {
                *refined = (*refined + solution[3 * index + 2]).clamp(start - reach, start + reach);
            }
        }
        Some(refined)
    }

    /// Normal equations: sines over whole revolutions are close to orthogonal, so nothing is lost by squaring.
    fn solve(
        &self,
        count: usize,
        columns: impl Fn(f64, &mut DVector<f64>),
    ) -> Option<DVector<f64>> {
        let mut normal = DMatrix::zeros(count, count);
        let (mut right, mut row) = (DVector::zeros(count), DVector::zeros(count));
        for (&angle_rad, &level_nm) in self.angle_rad.iter().zip(&self.level_nm) {
            columns(angle_rad, &mut row);
            normal.syger(1.0, &row, &row, 1.0);
            right.axpy(level_nm, &row, 1.0);
        }
        let solution = Cholesky::new(normal)?.solve(&right);
        solution.iter().all(|x| x.is_finite()).then_some(solution)
    }

    /// What the tones leave of one stretch.
    pub fn residual_nm(&self, series: &AngleSeries, tones: &[Tone]) -> Vec<f64> {
        let left = |(angle_rad, level_nm): (f64, &f64)| {
            let fitted: f64 = tones
                .iter()
                .map(|tone| tone.level_nm(angle_rad - self.middle_rad))
                .sum();
            level_nm - fitted
        };
        series
            .angles_rad()
            .zip(&series.level_nm)
            .map(left)
            .collect()
    }
}
