//! SD eq (14): parameters within bounds that make the squared torque error smallest, from many starts.
//!
//! Levenberg and Marquardt's method on `u`, where a parameter is `low + (high - low)/(1 + e^-u)`, over the logarithm where both
//! bounds are positive; so bounds hold and no step leaves them. The Jacobian is taken by differences: what is fitted is an
//! estimator running over a recording, thresholds and memory included.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn};
use rayon::prelude::*;
use serde::Serialize;

/// One parameter of a fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameter {
    pub name: &'static str,
    pub start: f64,
    pub bounds: [f64; 2],
}

/// What was found for one parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fitted {
    /// As in the robot file.
    pub name: String,
    /// The value.
    pub value: f64,
    /// One standard deviation, from the misses' size and how long they stay alike.
    pub std_error: f64,
    /// Where the search ended at the latest.
    pub bounds: [f64; 2],
    /// It ended there: the data ask for more than was thought possible, or do not tell the parameter.
    pub at_bound: bool,
}

/// The best fit of all starts.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub fitted: Vec<Fitted>,
    pub rms: f64,
    /// Starts from which the search came within 1 % of the best.
    pub agreeing_starts: usize,
}

/// Of the way between the bounds: closer counts as on the bound.
const BOUND_SHARE: f64 = 1e-3;
/// Step of the differences in `u`: large enough to pass a sample or two of a threshold, small beside the curve's bend.
const STEP: f64 = 1e-3;
/// `u` of a start on a bound: 0.2 % inside.
const U_MAX: f64 = 6.0;
/// Evaluations per parameter that one start may take.
const PATIENCE: usize = 12;

/// What values of the parameters leave in each row.
pub(super) type Misses<'a> = dyn Fn(&[f64]) -> Vec<f64> + Sync + 'a;

impl Parameter {
    fn is_log(&self) -> bool {
        self.bounds[0] > 0.0
    }

    fn value(&self, u: f64) -> f64 {
        let share = 1.0 / (1.0 + (-u).exp());
        let [low, high] = self.bounds;
        if self.is_log() {
            (low.ln() + share * (high / low).ln()).exp()
        } else {
            low + share * (high - low)
        }
    }

    fn share(&self, value: f64) -> f64 {
        let [low, high] = self.bounds;
        if self.is_log() {
            (value / low).ln() / (high / low).ln()
        } else {
            (value - low) / (high - low)
        }
    }

    fn u(&self, value: f64) -> f64 {
        let share = self.share(value);
        (share / (1.0 - share)).ln().clamp(-U_MAX, U_MAX)
    }
}

/// Finds the parameters whose `misses` are smallest. The first start is the given one, the others spread over the bounds.
pub(super) fn fit(parameters: &[Parameter], starts: usize, misses: &Misses<'_>) -> Solution {
    let given = DVector::from_iterator(
        parameters.len(),
        parameters
            .iter()
            .map(|parameter| parameter.u(parameter.start)),
    );
    let spread = (1..starts).map(|start| {
        DVector::from_iterator(
            parameters.len(),
            (0..parameters.len()).map(|place| {
                let share = 0.05 + 0.9 * halton(start, place);
                (share / (1.0 - share)).ln()
            }),
        )
    });
    let begun: Vec<DVector<f64>> = std::iter::once(given).chain(spread).collect();
    let ends: Vec<(DVector<f64>, f64)> = begun
        .into_par_iter()
        .map(|u| {
            let problem = Problem {
                parameters,
                misses,
                u,
            };
            let (reached, report) = LevenbergMarquardt::new()
                .with_patience(PATIENCE)
                .with_tol(1e-8)
                .minimize(problem);
            (reached.u, report.objective_function)
        })
        .filter(|(_, squares)| squares.is_finite())
        .collect();
    let best = ends
        .iter()
        .min_by(|(_, a), (_, b)| a.total_cmp(b))
        .map(|(u, squares)| (u.clone(), *squares));
    let (u, least) = best.unwrap_or((DVector::zeros(parameters.len()), f64::INFINITY));
    let agreeing_starts = ends.iter().filter(|(_, squares)| *squares <= 1.01 * least);
    let agreeing_starts = agreeing_starts.count();
    let problem = Problem {
        parameters,
        misses,
        u,
    };
    problem.solution(agreeing_starts)
}

struct Problem<'a> {
    parameters: &'a [Parameter],
    misses: &'a Misses<'a>,
    u: DVector<f64>,
}

impl Problem<'_> {
    fn values(&self, u: &DVector<f64>) -> Vec<f64> {
        let pairs = self.parameters.iter().zip(u.iter());
        pairs.map(|(parameter, u)| parameter.value(*u)).collect()
    }

    fn misses_at(&self, u: &DVector<f64>) -> DVector<f64> {
        DVector::from_vec((self.misses)(&self.values(u)))
    }

    /// Derivatives of the misses by `u`.
    fn slopes(&self) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = (0..self.u.len())
            .into_par_iter()
            .map(|place| {
                let [mut before, mut after] = [self.u.clone(), self.u.clone()];
                before[place] -= STEP;
                after[place] += STEP;
                (self.misses_at(&after) - self.misses_at(&before)) / (2.0 * STEP)
            })
            .collect();
        DMatrix::from_columns(&columns)
    }

    fn solution(&self, agreeing_starts: usize) -> Solution {
        let misses = self.misses_at(&self.u);
        let rows = misses.len().max(1) as f64;
        let variance = misses.norm_squared() / rows;
        let slopes = self.slopes();
        let inverse = (slopes.transpose() * &slopes)
            .pseudo_inverse(1e-12)
            .unwrap_or_else(|_| DMatrix::zeros(self.u.len(), self.u.len()));
        let alike = alike_rows(misses.as_slice());
        let fitted = self
            .parameters
            .iter()
            .enumerate()
            .map(|(place, parameter)| {
                let u = self.u[place];
                let value = parameter.value(u);
                let by_u = (parameter.value(u + STEP) - parameter.value(u - STEP)) / (2.0 * STEP);
                let share = parameter.share(value);
                Fitted {
                    name: parameter.name.to_owned(),
                    value,
                    std_error: by_u.abs() * (inverse[(place, place)] * variance * alike).sqrt(),
                    bounds: parameter.bounds,
                    at_bound: !(BOUND_SHARE..=1.0 - BOUND_SHARE).contains(&share),
                }
            });
        Solution {
            fitted: fitted.collect(),
            rms: variance.sqrt(),
            agreeing_starts,
        }
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, u: &DVector<f64>) {
        self.u.copy_from(u);
    }

    fn params(&self) -> DVector<f64> {
        self.u.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let misses = self.misses_at(&self.u);
        misses.iter().all(|miss| miss.is_finite()).then_some(misses)
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        Some(self.slopes())
    }
}

/// How many rows in a row tell as much as one: `1 + 2 Σ ρ_k` over the misses' autocorrelation until it first vanishes.
fn alike_rows(misses: &[f64]) -> f64 {
    let mean = misses.iter().sum::<f64>() / misses.len().max(1) as f64;
    let product = |lag: usize| -> f64 {
        let pairs = misses.iter().zip(&misses[lag..]);
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum()
    };
    let own = product(0);
    if own <= 0.0 {
        return 1.0;
    }
    let correlations = (1..misses.len() / 4).map(|lag| product(lag) / own);
    1.0 + 2.0
        * correlations
            .take_while(|correlation| *correlation > 0.0)
            .sum::<f64>()
}

/// A low-discrepancy sequence (Halton 1960): the index-th point in the dimension of the place-th prime.
fn halton(index: usize, place: usize) -> f64 {
    const PRIMES: [usize; 32] = [
        2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89,
        97, 101, 103, 107, 109, 113, 127, 131,
    ];
    let base = PRIMES[place % PRIMES.len()];
    let (mut left, mut digit, mut value) = (index, 1.0, 0.0);
    while left > 0 {
        digit /= base as f64;
        value += digit * (left % base) as f64;
        left /= base;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decay_is_found_from_far_away_with_its_errors() {
        // y = 3 e^(-x/0.5), with a known ripple of 0.01
        let row = |k: usize| k as f64 * 0.01;
        let misses = |values: &[f64]| -> Vec<f64> {
            (0..300)
                .map(|k| {
                    let ripple = if k % 2 == 0 { 0.01 } else { -0.01 };
                    values[0] * (-row(k) / values[1]).exp() - (3.0 * (-row(k) / 0.5).exp() + ripple)
                })
                .collect()
        };
        let parameter = |name, start, bounds| Parameter {
            name,
            start,
            bounds,
        };
        let found = fit(
            &[
                parameter("size", 100.0, [0.1, 1000.0]),
                parameter("time", 20.0, [0.01, 50.0]),
            ],
            8,
            &misses,
        );
        assert!((found.fitted[0].value - 3.0).abs() < 0.01);
        assert!((found.fitted[1].value - 0.5).abs() < 0.01);
        assert!((found.rms - 0.01).abs() < 1e-3);
        let error = found.fitted[1].std_error;
        assert!(error > 1e-5 && error < 1e-2, "{error}");
        assert!(found.fitted.iter().all(|fitted| !fitted.at_bound));
    }

    #[test]
    fn what_lies_outside_ends_on_the_bound_and_says_so() {
        let misses = |values: &[f64]| vec![values[0] - 7.0, 0.1 * (values[0] - 7.0)];
        let parameter = Parameter {
            name: "x",
            start: 1.0,
            bounds: [-2.0, 2.0],
        };
        let found = fit(&[parameter], 3, &misses);
        assert!(found.fitted[0].at_bound, "{:?}", found.fitted);
        assert!(found.fitted[0].value > 1.99);
    }
}
