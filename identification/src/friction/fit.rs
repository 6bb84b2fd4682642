//! One model fitted to one direction by weighted least squares.

use serde::Serialize;

use super::least_squares::{solve, unit_errors};
use super::speeds::{Point, grouped};
use super::stribeck::{self, StribeckFit};
use super::{FrictionModel, Parameter};

/// The least mean square of misses, in scatters, that differs from none: rounding of the scatter's own floor.
const ROUNDING_SQUARED: f64 = 1e-12;

/// One model in one direction of motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DirectionFit {
    /// The model fitted.
    pub model: FrictionModel,
    /// In the order of [`FrictionModel::symbols`].
    pub parameters: Vec<Parameter>,
    /// Measurements fitted.
    pub measurements: usize,
    /// Different speeds among them.
    pub speeds: usize,
    /// Table I, eq (6): `T̃ᵀ W T̃`, with `T̃` the mean friction at each speed less the model's, and `W` the inverse of
    /// the variance of one measurement at that speed. (The paper calls `W` the covariance itself, but its values
    /// count standard deviations.)
    pub weighted_residual_variance: f64,
    /// Table I: `1 + weighted_residual_variance / (speeds - parameters)`; none without a speed to spare. The
    /// printed pairs obey this with six speeds, although the paper tells of eight.
    pub mse_per_dof: Option<f64>,
    /// Root mean square of measured less fitted friction.
    pub rms_nm: f64,
    /// Weighted sum of squared misses of all measurements over the measurements to spare: about one where the model
    /// is right. Standard errors are scaled by its root. None without a measurement to spare.
    pub reduced_chi_squared: Option<f64>,
    /// Information criterion of Akaike, corrected for small samples; none where there are too few measurements.
    pub aicc: Option<f64>,
    /// Information criterion of Schwarz.
    pub bic: f64,
}

impl DirectionFit {
    /// Fits a model; none where the speeds cannot tell its parameters.
    pub(super) fn new(model: FrictionModel, points: &[Point]) -> Option<Self> {
        let groups = grouped(points);
        if groups.len() < model.parameter_count() {
            return None;
        }
        let solution = Solution::new(model, points)?;
        let level_nm = |speed_rad_s| level_nm(model, &solution.values, speed_rad_s);
        let (count, parameters) = (points.len() as f64, model.parameter_count() as f64);
        let misses = points.iter().map(|p| p.level_nm - level_nm(p.speed_rad_s));
        let squares: f64 = misses.clone().map(|miss_nm| miss_nm.powi(2)).sum();
        let scatters = points.iter().map(|p| p.scatter_nm);
        let chi_squared: f64 = misses
            .zip(scatters)
            .map(|(miss, s)| (miss / s).powi(2))
            .sum();
        let weighted_residual_variance = groups
            .iter()
            .map(|g| ((g.level_nm - level_nm(g.speed_rad_s)) / g.scatter_nm).powi(2))
            .sum();
        let spare = count - parameters;
        let reduced_chi_squared = (spare > 0.0).then(|| chi_squared / spare);
        let spare_speeds = groups.len() as f64 - parameters;
        let log_likelihood = count * (chi_squared / count).max(ROUNDING_SQUARED).ln();
        // The scale of the misses is a parameter too.
        let estimated = parameters + 1.0;
        let spare_aicc = count - estimated - 1.0;
        Some(Self {
            model,
            parameters: solution.parameters(model, reduced_chi_squared),
            measurements: points.len(),
            speeds: groups.len(),
            weighted_residual_variance,
            mse_per_dof: (spare_speeds > 0.0)
                .then(|| 1.0 + weighted_residual_variance / spare_speeds),
            rms_nm: (squares / count).sqrt(),
            reduced_chi_squared,
            aicc: (spare_aicc > 0.0).then(|| {
                log_likelihood + 2.0 * estimated + 2.0 * estimated * (estimated + 1.0) / spare_aicc
            }),
            bic: log_likelihood + estimated * count.ln(),
        })
    }

    /// Friction that opposes the motion at a speed, by the fitted model.
    #[must_use]
    pub fn level_nm(&self, speed_rad_s: f64) -> f64 {
        let values: Vec<f64> = self.parameters.iter().map(|p| p.value).collect();
        level_nm(self.model, &values, speed_rad_s)
    }

    /// Estimate of a parameter by its symbol, such as `"Vc"`.
    #[must_use]
    pub fn parameter(&self, symbol: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|p| p.symbol == symbol)
    }
}

fn level_nm(model: FrictionModel, values: &[f64], speed_rad_s: f64) -> f64 {
    match (model, values) {
        (FrictionModel::Stribeck, &[f0, fv, fs, vc]) => {
            let columns = stribeck::linear_columns(vc)(speed_rad_s);
            columns.iter().zip([f0, fv, fs]).map(|(x, c)| x * c).sum()
        }
        // Coulomb and viscous friction is the polynomial's beginning.
        _ => values
            .iter()
            .rev()
            .fold(0.0, |sum, c| sum * speed_rad_s + c),
    }
}

/// Parameter values with their standard errors for misses of one scatter.
struct Solution {
    values: Vec<f64>,
    unit_errors: Vec<Option<f64>>,
    vc_at_bound: bool,
}

impl Solution {
    fn new(model: FrictionModel, points: &[Point]) -> Option<Self> {
        match model {
            FrictionModel::CoulombViscous => Self::linear(points, &|v| [1.0, v]),
            FrictionModel::Cubic => Self::linear(points, &|v| [1.0, v, v * v, v * v * v]),
            FrictionModel::Stribeck => Self::stribeck(points, &stribeck::fit(points)?),
        }
    }

    fn linear<const N: usize>(
        points: &[Point],
        columns: &impl Fn(f64) -> [f64; N],
    ) -> Option<Self> {
        Some(Self {
            values: solve(points, columns)?.to_vec(),
            unit_errors: unit_errors(points, columns)?.map(Some).to_vec(),
            vc_at_bound: false,
        })
    }

    /// Where `Vc` is on its bound or undetermined, the others' errors are those for this `Vc`.
    fn stribeck(points: &[Point], fit: &StribeckFit) -> Option<Self> {
        let free = unit_errors(points, &stribeck::derivatives(fit)).filter(|_| !fit.at_bound);
        let unit_errors = match free {
            Some(errors) => errors.map(Some).to_vec(),
            None => {
                let [f0, fv, fs] = unit_errors(points, &stribeck::linear_columns(fit.vc_rad_s))?;
                vec![Some(f0), Some(fv), Some(fs), None]
            }
        };
        Some(Self {
            values: vec![fit.f0_nm, fit.fv_nm_s_rad, fit.fs_nm, fit.vc_rad_s],
            unit_errors,
            vc_at_bound: fit.at_bound,
        })
    }

    fn parameters(&self, model: FrictionModel, reduced_chi_squared: Option<f64>) -> Vec<Parameter> {
        let estimates = self.values.iter().zip(&self.unit_errors);
        model
            .symbols()
            .iter()
            .zip(estimates)
            .map(|(&(symbol, unit), (&value, unit_error))| Parameter {
                symbol,
                unit,
                value,
                standard_error: unit_error
                    .zip(reduced_chi_squared)
                    .map(|(error, variance)| error * variance.sqrt()),
                at_bound: self.vc_at_bound && symbol == "Vc",
            })
            .collect()
    }
}
