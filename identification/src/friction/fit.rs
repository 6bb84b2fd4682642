//! One model fitted to one direction by weighted least squares.

use serde::Serialize;

use super::least_squares::{solve, unit_errors};
use super::speeds::{Point, grouped, independent};
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
    /// is right. None without a measurement to spare.
    pub reduced_chi_squared: Option<f64>,
    /// Between which `Vc` eq (7) fits within two standard errors; within its bounds, which are a quarter of the smallest
    /// speed and twice the largest. None for the other models.
    pub vc_range_rad_s: Option<[f64; 2]>,
    /// Whether that range ends within the bounds: if not, the speeds do not determine `Vc`, nor `Fs` and `Fv`.
    pub vc_is_determined: bool,
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
        let between_speeds: f64 = groups
            .iter()
            .map(|g| {
                g.count as f64 * ((g.level_nm - level_nm(g.speed_rad_s)) / g.scatter_nm).powi(2)
            })
            .sum();
        let birge = reduced_chi_squared.map(|within| {
            let between = if spare_speeds > 0.0 {
                between_speeds / spare_speeds
            } else {
                0.0
            };
            within.max(between).max(1.0).sqrt()
        });
        let uncertain = birge.map(|birge| independent(points, birge));
        let errors = uncertain
            .as_ref()
            .map(|points| solution.errors(model, points));
        let log_likelihood = count * (chi_squared / count).max(ROUNDING_SQUARED).ln();
        // The scale of the misses is a parameter too.
        let estimated = parameters + 1.0;
        let spare_aicc = count - estimated - 1.0;
        Some(Self {
            model,
            parameters: solution.parameters(model, errors.as_ref()),
            vc_range_rad_s: errors.as_ref().and_then(|errors| errors.vc_range_rad_s),
            vc_is_determined: errors.is_none_or(|errors| errors.vc_is_determined),
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

/// Parameter values, and for eq (7) the fit they came from.
struct Solution {
    values: Vec<f64>,
    stribeck: Option<StribeckFit>,
}

/// How uncertain the parameters are.
struct Errors {
    standard: Vec<Option<f64>>,
    vc_range_rad_s: Option<[f64; 2]>,
    vc_is_determined: bool,
}

impl Solution {
    fn new(model: FrictionModel, points: &[Point]) -> Option<Self> {
        let linear = |values: Option<Vec<f64>>| {
            Some(Self {
                values: values?,
                stribeck: None,
            })
        };
        match model {
            FrictionModel::CoulombViscous => {
                linear(solve(points, &viscous_columns).map(|values| values.to_vec()))
            }
            FrictionModel::Cubic => {
                linear(solve(points, &cubic_columns).map(|values| values.to_vec()))
            }
            FrictionModel::Stribeck => {
                let fit = stribeck::fit(points)?;
                Some(Self {
                    values: vec![fit.f0_nm, fit.fv_nm_s_rad, fit.fs_nm, fit.vc_rad_s],
                    stribeck: Some(fit),
                })
            }
        }
    }

    /// By one point for each speed: trials of one speed share their errors, so they do not count as so many.
    fn errors(&self, model: FrictionModel, points: &[Point]) -> Errors {
        let standard = |errors: Option<Vec<f64>>| match errors {
            Some(errors) => errors.into_iter().map(Some).collect(),
            None => vec![None; self.values.len()],
        };
        let linear = |errors| Errors {
            standard: standard(errors),
            vc_range_rad_s: None,
            vc_is_determined: true,
        };
        match (&self.stribeck, model) {
            (Some(fit), _) => stribeck_errors(points, fit),
            (None, FrictionModel::Cubic) => {
                linear(unit_errors(points, &cubic_columns).map(|errors| errors.to_vec()))
            }
            (None, _) => {
                linear(unit_errors(points, &viscous_columns).map(|errors| errors.to_vec()))
            }
        }
    }

    fn parameters(&self, model: FrictionModel, errors: Option<&Errors>) -> Vec<Parameter> {
        let at_bound = self.stribeck.is_some_and(|fit| fit.at_bound);
        let symbols = model.symbols().iter().zip(&self.values).enumerate();
        symbols
            .map(|(index, (&(symbol, unit), &value))| Parameter {
                symbol,
                unit,
                value,
                standard_error: errors.and_then(|errors| errors.standard[index]),
                at_bound: at_bound && symbol == "Vc",
            })
            .collect()
    }
}

fn viscous_columns(speed_rad_s: f64) -> [f64; 2] {
    [1.0, speed_rad_s]
}

fn cubic_columns(speed_rad_s: f64) -> [f64; 4] {
    [1.0, speed_rad_s, speed_rad_s.powi(2), speed_rad_s.powi(3)]
}

/// `Vc` by its profile: the squares rise unevenly on both sides of it. Where `Vc` is on its bound or undetermined, the others'
/// errors are those for this `Vc`.
fn stribeck_errors(points: &[Point], fit: &StribeckFit) -> Errors {
    let [least, most] = stribeck::vc_bounds(points);
    let vc_range_rad_s = stribeck::vc_range(points, fit, 4.0);
    let vc_is_determined = vc_range_rad_s[0] > least && vc_range_rad_s[1] < most && !fit.at_bound;
    let free = unit_errors(points, &stribeck::derivatives(fit)).filter(|_| !fit.at_bound);
    let standard = match free {
        Some([f0, fv, fs, _]) => {
            let [low, high] = stribeck::vc_range(points, fit, 1.0);
            vec![Some(f0), Some(fv), Some(fs), Some(0.5 * (high - low))]
        }
        None => match unit_errors(points, &stribeck::linear_columns(fit.vc_rad_s)) {
            Some([f0, fv, fs]) => vec![Some(f0), Some(fv), Some(fs), None],
            None => vec![None; 4],
        },
    };
    Errors {
        standard,
        vc_range_rad_s: Some(vc_range_rad_s),
        vc_is_determined,
    }
}
