//! The fit of eq (7): linear but for `Vc`, which has bounds.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{DVector, Dyn, OMatrix, U4, Vector4};

use super::least_squares::solve;
use super::speeds::Point;

/// Values of `Vc` tried first, evenly spaced in its logarithm over the bounds: with the speeds of PA10-05 (0.005 to
/// 0.8 rad/s) one a factor of 1.8 from the next, closer than two minima of the sum of squares lie.
const TRIED: usize = 10;

/// Of the search for the ends of a range of `Vc`, which begin a few times apart: to a part in a thousand.
const HALVINGS: usize = 14;

/// Coefficients of eq (7) for one direction, as magnitudes.
#[derive(Clone, Copy, Debug)]
pub(super) struct StribeckFit {
    pub f0_nm: f64,
    pub fv_nm_s_rad: f64,
    pub fs_nm: f64,
    pub vc_rad_s: f64,
    /// `Vc` would leave its bounds.
    pub at_bound: bool,
}

/// The columns of eq (7) that `F0`, `Fv` and `Fs` multiply.
pub(super) fn linear_columns(vc_rad_s: f64) -> impl Fn(f64) -> [f64; 3] {
    move |speed_rad_s| [1.0, speed_rad_s, -(-speed_rad_s / vc_rad_s).exp_m1()]
}

/// Derivatives of eq (7) by `F0`, `Fv`, `Fs` and `Vc`.
pub(super) fn derivatives(fit: &StribeckFit) -> impl Fn(f64) -> [f64; 4] {
    let StribeckFit {
        fs_nm, vc_rad_s, ..
    } = *fit;
    move |speed_rad_s| {
        let [one, speed, rise] = linear_columns(vc_rad_s)(speed_rad_s);
        let ratio = speed_rad_s / vc_rad_s;
        [one, speed, rise, -fs_nm * ratio / vc_rad_s * (-ratio).exp()]
    }
}

/// A quarter of the smallest speed and twice the largest.
pub(super) fn vc_bounds(points: &[Point]) -> [f64; 2] {
    let speeds = || points.iter().map(|point| point.speed_rad_s);
    [
        speeds().fold(f64::INFINITY, f64::min) / 4.0,
        speeds().fold(0.0, f64::max) * 2.0,
    ]
}

/// Fits eq (7) with `Vc` between a quarter of the smallest speed and twice the largest: outside, the speeds show only
/// one end of the exponential, and `Fs` trades with `F0` or `Fv`.
pub(super) fn fit(points: &[Point]) -> Option<StribeckFit> {
    let [least, most] = vc_bounds(points);
    let step = (most / least).ln() / (TRIED - 1) as f64;
    let tried: Vec<(StribeckFit, f64)> = (0..TRIED)
        .map(|index| least * (step * index as f64).exp())
        .filter_map(|vc_rad_s| at_vc(points, vc_rad_s, false))
        .collect();
    let inside = (0..tried.len())
        .filter(|&index| is_lowest_nearby(&tried, index))
        .filter_map(|index| descend(points, &tried[index].0))
        .filter(|vc| (least..=most).contains(vc))
        .map(|vc| (vc, false));
    inside
        .chain([(least, true), (most, true)])
        .filter_map(|(vc_rad_s, at_bound)| at_vc(points, vc_rad_s, at_bound))
        .min_by(|(_, a), (_, b)| a.total_cmp(b))
        .map(|(fit, _)| fit)
}

/// The range of `Vc`, within its bounds, over which the weighted squares of the best fits rise by no more than `rise`.
pub(super) fn vc_range(points: &[Point], fit: &StribeckFit, rise: f64) -> [f64; 2] {
    let squares = |vc_rad_s| at_vc(points, vc_rad_s, false).map_or(f64::INFINITY, |tried| tried.1);
    let most = squares(fit.vc_rad_s) + rise;
    vc_bounds(points).map(|bound| {
        let (mut inside, mut outside) = (fit.vc_rad_s.ln(), bound.ln());
        if squares(bound) <= most {
            return bound;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            if squares(middle.exp()) <= most {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside.exp()
    })
}

fn is_lowest_nearby(tried: &[(StribeckFit, f64)], index: usize) -> bool {
    let here = tried[index].1;
    tried[index.saturating_sub(1)..tried.len().min(index + 2)]
        .iter()
        .all(|(_, squares)| here <= *squares)
}

/// Best coefficients for a given `Vc`, and their weighted sum of squared misses.
fn at_vc(points: &[Point], vc_rad_s: f64, at_bound: bool) -> Option<(StribeckFit, f64)> {
    let columns = linear_columns(vc_rad_s);
    let [f0_nm, fv_nm_s_rad, fs_nm] = solve(points, &columns)?;
    let miss = |point: &Point| {
        let [one, speed, rise] = columns(point.speed_rad_s);
        let fitted_nm = f0_nm * one + fv_nm_s_rad * speed + fs_nm * rise;
        ((point.level_nm - fitted_nm) / point.scatter_nm).powi(2)
    };
    let fit = StribeckFit {
        f0_nm,
        fv_nm_s_rad,
        fs_nm,
        vc_rad_s,
        at_bound,
    };
    Some((fit, points.iter().map(miss).sum()))
}

/// The `Vc` that Levenberg and Marquardt's method reaches from a start.
fn descend(points: &[Point], start: &StribeckFit) -> Option<f64> {
    let problem = Problem {
        points,
        parameters: Vector4::new(
            start.f0_nm,
            start.fv_nm_s_rad,
            start.fs_nm,
            start.vc_rad_s.ln(),
        ),
    };
    let (reached, report) = LevenbergMarquardt::new().minimize(problem);
    report
        .termination
        .was_successful()
        .then(|| reached.parameters[3].exp())
}

/// Eq (7) in `F0`, `Fv`, `Fs` and `ln Vc`, which keeps `Vc` positive.
struct Problem<'a> {
    points: &'a [Point],
    parameters: Vector4<f64>,
}

impl Problem<'_> {
    fn fit(&self) -> StribeckFit {
        let [f0_nm, fv_nm_s_rad, fs_nm, ln_vc] = self.parameters.into();
        StribeckFit {
            f0_nm,
            fv_nm_s_rad,
            fs_nm,
            vc_rad_s: ln_vc.exp(),
            at_bound: false,
        }
    }
}

impl LeastSquaresProblem<f64, Dyn, U4> for Problem<'_> {
    type ParameterStorage = Owned<f64, U4>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, U4>;

    fn set_params(&mut self, parameters: &Vector4<f64>) {
        self.parameters = *parameters;
    }

    fn params(&self) -> Vector4<f64> {
        self.parameters
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let fit = self.fit();
        let columns = linear_columns(fit.vc_rad_s);
        let misses = self.points.iter().map(|point| {
            let [one, speed, rise] = columns(point.speed_rad_s);
            let fitted_nm = fit.f0_nm * one + fit.fv_nm_s_rad * speed + fit.fs_nm * rise;
            (fitted_nm - point.level_nm) / point.scatter_nm
        });
        Some(DVector::from_iterator(self.points.len(), misses))
    }

    fn jacobian(&self) -> Option<OMatrix<f64, Dyn, U4>> {
        let fit = self.fit();
        let derivatives = derivatives(&fit);
        let mut jacobian = OMatrix::<f64, Dyn, U4>::zeros(self.points.len());
        for (mut row, point) in jacobian.row_iter_mut().zip(self.points) {
            let [one, speed, rise, by_vc] = derivatives(point.speed_rad_s);
            for (element, value) in row.iter_mut().zip([one, speed, rise, by_vc * fit.vc_rad_s]) {
                *element = value / point.scatter_nm;
            }
        }
        Some(jacobian)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use levenberg_marquardt::differentiate_numerically;

    fn points(level_nm: impl Fn(f64) -> f64) -> Vec<Point> {
        [0.02, 0.04, 0.06, 0.08, 0.1, 0.2, 0.3, 0.4]
            .map(|speed_rad_s| Point {
                speed_rad_s,
                asked_rad_s: speed_rad_s,
                level_nm: level_nm(speed_rad_s),
                scatter_nm: 0.1,
                trial: 0,
            })
            .to_vec()
    }

    #[test]
    fn the_derivatives_are_those_of_the_misses() {
        let points = points(|v| 2.0 + v);
        let mut problem = Problem {
            points: &points,
            parameters: Vector4::new(2.3, 0.6, -1.2, 0.07_f64.ln()),
        };
        let numeric = differentiate_numerically(&mut problem).unwrap();
        let analytic = problem.jacobian().unwrap();
        assert!((numeric - analytic).amax() < 1e-5);
    }

    #[test]
    fn every_row_of_table_ii_is_found_again() {
        let table_ii = [
            [34.9647, 29.7153, 2.8103, 0.3376],
            [36.7050, 26.4796, 2.2885, 0.6172],
            [39.9709, 35.3200, 6.2713, 0.0685],
            [41.3113, 35.8947, 5.9018, 0.0709],
            [18.3053, 17.6413, 2.2282, 0.0430],
            [18.7327, 17.8371, 2.7240, 0.0405],
            [30.4416, 28.5552, 19.7181, 0.3278],
            [30.6897, 29.4670, 21.7854, 0.3676],
            [3.7145, 0.7493, 1.0792, 0.0386],
            [4.1271, 0.7919, 1.3756, 0.0393],
            [5.5090, 0.5859, 0.9983, 0.0126],
            [5.7954, 0.5711, 0.9967, 0.0135],
            [2.2980, 0.6062, -1.1803, 0.0759],
            [2.3027, 0.6836, -1.1470, 0.0690],
        ];
        for [f0, fv, fs, vc] in table_ii {
            let found = fit(&points(|v| f0 + fv * v + fs * (1.0 - (-v / vc).exp()))).unwrap();
            assert!(!found.at_bound);
            assert!((found.vc_rad_s / vc - 1.0).abs() < 1e-3, "{vc}: {found:?}");
            assert!((found.fs_nm / fs - 1.0).abs() < 1e-2, "{fs}: {found:?}");
            assert!((found.f0_nm - f0).abs() < 1e-2, "{f0}: {found:?}");
            assert!(
                (found.fv_nm_s_rad / fv - 1.0).abs() < 1e-2,
                "{fv}: {found:?}"
            );
        }
    }

    #[test]
    fn an_exponential_too_fast_for_the_speeds_ends_on_the_bound() {
        let found = fit(&points(|v| {
            5.0 + v - 2.0 * (-v / 0.002).exp() + 0.01 * v.powi(3)
        }));
        assert!(found.unwrap().at_bound || found.unwrap().vc_rad_s > 0.4);
        let found = fit(&points(|v| 2.0 + v - 0.5 * v * v)).unwrap();
        assert!(found.at_bound);
        assert_eq!(found.vc_rad_s, 0.8);
    }
}
