//! Continuous piecewise-linear least squares with knees found by the fit.
//!
//! `y(x) = a + b·x + Σ c_i·max(x - k_i, 0)`: continuous by construction, `c_i` the change of slope at knee `k_i`. For
//! given knees it is linear, and every sum it needs over the samples beyond a knee is a suffix sum of the samples sorted
//! by x, so a pair of knees costs the same however many samples there are: all pairs of a grid are tried, then the best
//! is moved in ever smaller steps. Standard errors come from the fit linearised in all parameters, knees included
//! (Muggeo, Statistics in Medicine 22 (2003) 3055-3071, eq 4).

use nalgebra::{DMatrix, DVector};

/// Knees tried on a side.
const GRID: usize = 80;

/// The search ends with steps of this share of the range of x.
const RESOLUTION: f64 = 1e-7;

/// A knee that may not move on by this share of the range is on its bound.
const BOUND: f64 = 2e-3;

/// The samples of one region at least; a slope through fewer says nothing.
const LEAST_SAMPLES: usize = 10;

/// Samples sorted by x, with sums over each and all after it. Coordinates from `centre`, for digits.
pub(super) struct Samples {
    centre: [f64; 2],
    x: Vec<f64>,
    y: Vec<f64>,
    suffix: Vec<Sums>,
    /// Samples that a region must hold.
    least: usize,
}

#[derive(Clone, Copy, Default)]
struct Sums {
    n: f64,
    x: f64,
    xx: f64,
    y: f64,
    xy: f64,
    yy: f64,
}

impl Sums {
    /// `Σ max(x - k1, 0)·max(x - k2, 0)` over the samples beyond both.
    fn hinges(&self, k1: f64, k2: f64) -> f64 {
        self.xx - (k1 + k2) * self.x + k1 * k2 * self.n
    }
}

/// A law with its knees and the linearised covariance of its parameters, before noise is known.
#[derive(Clone, Debug)]
pub(super) struct HingeFit {
    centre: [f64; 2],
    /// `a, b, c...` about the centre.
    coefficients: DVector<f64>,
    /// From the centre.
    knees: Vec<f64>,
    /// Which knees are on their bounds.
    pub at_bound: Vec<bool>,
    /// Sum of squared residuals.
    pub squares: f64,
    /// `(JᵀJ)⁻¹`, parameters in the order `a, b, c..., k...`.
    inverse: DMatrix<f64>,
}

impl Samples {
    /// Nothing where x is not finite somewhere or does not vary.
    pub fn new(x: &[f64], y: &[f64]) -> Option<Self> {
        let count = x.len().min(y.len());
        let mean = |values: &[f64]| values[..count].iter().sum::<f64>() / count as f64;
        let centre = [mean(x), mean(y)];
        let mut pairs: Vec<(f64, f64)> = x
            .iter()
            .zip(y)
            .map(|(x, y)| (x - centre[0], y - centre[1]))
            .collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let finite = pairs.iter().all(|(x, y)| x.is_finite() && y.is_finite());
        if !finite || pairs.first()?.0 >= pairs.last()?.0 {
            return None;
        }
        let (x, y): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
        Some(Self {
            centre,
            suffix: suffix_sums(&x, &y),
            least: LEAST_SAMPLES.max(count / 100),
            x,
            y,
        })
    }

    pub fn count(&self) -> usize {
        self.x.len()
    }

    /// Smallest and largest x.
    pub fn range(&self) -> [f64; 2] {
        [self.x[0], self.x[self.count() - 1]].map(|x| x + self.centre[0])
    }

    fn width(&self) -> f64 {
        self.x[self.count() - 1] - self.x[0]
    }

    /// The best law with one knee less than `regions`, 1 to 3; nothing where the samples are too few for it.
    pub fn fit(&self, regions: usize) -> Option<HingeFit> {
        let knees = match regions {
            1 => Some(vec![]),
            2 => self.search((0..GRID).map(|knee| vec![knee])),
            _ => self.search(
                (0..GRID)
                    .flat_map(|first| (first + 1..GRID).map(move |second| vec![first, second])),
            ),
        }?;
        let (coefficients, squares) = self.linear(&knees)?;
        Some(HingeFit {
            centre: self.centre,
            at_bound: (0..knees.len())
                .map(|knee| self.is_at_bound(&knees, knee))
                .collect(),
            inverse: self.inverse(&coefficients, &knees)?,
            coefficients,
            knees,
            squares,
        })
    }

    /// The best of these places on the grid, refined.
    fn search(&self, places: impl Iterator<Item = Vec<usize>>) -> Option<Vec<f64>> {
        let spacing = self.width() / (GRID + 1) as f64;
        let on_grid = |place: usize| self.x[0] + spacing * (place + 1) as f64;
        let (start, squares) = places
            .map(|places| places.into_iter().map(on_grid).collect::<Vec<f64>>())
            .filter_map(|knees| self.squares(&knees).map(|squares| (knees, squares)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(self.refine(start, squares, spacing))
    }

    /// Moves the knees, one or both, in steps that halve whenever none makes the fit better.
    fn refine(&self, mut knees: Vec<f64>, mut squares: f64, mut step: f64) -> Vec<f64> {
        while step > RESOLUTION * self.width() {
            let moves = [-1.0, 0.0, 1.0_f64];
            let better = moves
                .iter()
                .flat_map(|first| moves.iter().map(move |second| [*first, *second]))
                .map(|by| -> Vec<f64> {
                    let moved = knees.iter().zip(by).map(|(knee, by)| knee + by * step);
                    moved.collect()
                })
                .filter_map(|moved| self.squares(&moved).map(|squares| (moved, squares)))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .filter(|(_, found)| *found < squares);
            match better {
                Some(found) => (knees, squares) = found,
                None => step *= 0.5,
            }
        }
        knees
    }

    /// Nothing where a region would be too small.
    fn squares(&self, knees: &[f64]) -> Option<f64> {
        self.allows(knees)
            .then(|| self.linear(knees))?
            .map(|(_, squares)| squares)
    }

    fn allows(&self, knees: &[f64]) -> bool {
        let mut from = 0;
        for knee in knees {
            let to = self.beyond(*knee);
            if to < from + self.least {
                return false;
            }
            from = to;
        }
        self.count() >= from + self.least
    }

    fn is_at_bound(&self, knees: &[f64], knee: usize) -> bool {
        [-1.0, 1.0].into_iter().any(|way| {
            let mut moved = knees.to_vec();
            moved[knee] += way * BOUND * self.width();
            !self.allows(&moved)
        })
    }

    /// Index of the first sample beyond x.
    fn beyond(&self, x: f64) -> usize {
        self.x.partition_point(|sample| *sample <= x)
    }

    /// Coefficients `a, b, c...` for given knees and the sum of squared residuals, by the normal equations.
    fn linear(&self, knees: &[f64]) -> Option<(DVector<f64>, f64)> {
        let all = self.suffix[0];
        let size = 2 + knees.len();
        let mut normal = DMatrix::zeros(size, size);
        let mut right = DVector::zeros(size);
        normal[(0, 0)] = all.n;
        normal[(1, 0)] = all.x;
        normal[(1, 1)] = all.xx;
        right[0] = all.y;
        right[1] = all.xy;
        for (index, knee) in knees.iter().enumerate() {
            let after = self.suffix[self.beyond(*knee)];
            normal[(2 + index, 0)] = after.x - knee * after.n;
            normal[(2 + index, 1)] = after.xx - knee * after.x;
            right[2 + index] = after.xy - knee * after.y;
            for (earlier, first) in knees[..=index].iter().enumerate() {
                normal[(2 + index, 2 + earlier)] = after.hinges(*first, *knee);
            }
        }
        // Reads the lower triangle.
        let coefficients = normal.cholesky()?.solve(&right);
        let squares = all.yy - coefficients.dot(&right);
        squares
            .is_finite()
            .then(|| (coefficients, squares.max(0.0)))
    }

    /// `(JᵀJ)⁻¹` of the law linearised in coefficients and knees. Nothing where a knee does not matter.
    fn inverse(&self, coefficients: &DVector<f64>, knees: &[f64]) -> Option<DMatrix<f64>> {
        let size = coefficients.len() + knees.len();
        let mut normal = DMatrix::zeros(size, size);
        for x in &self.x {
            let gradient = gradient(*x, coefficients, knees);
            normal.ger(1.0, &gradient, &gradient, 1.0);
        }
        // Scaled to ones on the diagonal: slopes and knees differ much in size.
        let scale = normal.diagonal().map(|square| square.sqrt().recip());
        let scaled = DMatrix::from_fn(size, size, |r, c| normal[(r, c)] * scale[r] * scale[c]);
        let inverse = scaled.cholesky()?.inverse();
        let unscaled = DMatrix::from_fn(size, size, |r, c| inverse[(r, c)] * scale[r] * scale[c]);
        unscaled
            .iter()
            .all(|value| value.is_finite())
            .then_some(unscaled)
    }

    /// Sum of squares about the mean.
    pub fn squares_about_mean(&self) -> f64 {
        self.y.iter().map(|y| y * y).sum()
    }
}

/// Derivatives of the law at x by `a, b, c..., k...`.
fn gradient(x: f64, coefficients: &DVector<f64>, knees: &[f64]) -> DVector<f64> {
    let beyond = |knee: &f64| if x > *knee { 1.0 } else { 0.0 };
    let hinges = knees.iter().map(|knee| (x - knee).max(0.0));
    let moves = knees
        .iter()
        .zip(coefficients.iter().skip(2))
        .map(|(knee, change)| -change * beyond(knee));
    DVector::from_iterator(
        coefficients.len() + knees.len(),
        [1.0, x].into_iter().chain(hinges).chain(moves),
    )
}

fn suffix_sums(x: &[f64], y: &[f64]) -> Vec<Sums> {
    let mut suffix = vec![Sums::default(); x.len() + 1];
    for index in (0..x.len()).rev() {
        let (x, y, after) = (x[index], y[index], suffix[index + 1]);
        suffix[index] = Sums {
            n: after.n + 1.0,
            x: after.x + x,
            xx: after.xx + x * x,
            y: after.y + y,
            xy: after.xy + x * y,
            yy: after.yy + y * y,
        };
    }
    suffix
}

impl HingeFit {
    /// Parameters, knees included.
    pub fn parameters(&self) -> usize {
        self.coefficients.len() + self.knees.len()
    }

    pub fn regions(&self) -> usize {
        1 + self.knees.len()
    }

    /// The law at x.
    pub fn value(&self, x: f64) -> f64 {
        let x = x - self.centre[0];
        let gradient = gradient(x, &self.coefficients, &self.knees);
        let linear = gradient.rows(0, self.coefficients.len());
        self.centre[1] + linear.dot(&self.coefficients)
    }

    /// Variance of the law at x per unit of noise variance.
    pub fn value_variance(&self, x: f64) -> f64 {
        self.variance(&gradient(
            x - self.centre[0],
            &self.coefficients,
            &self.knees,
        ))
    }

    /// Slope of each region and its variance per unit of noise variance.
    pub fn slopes(&self) -> Vec<(f64, f64)> {
        let slope = |region: usize| {
            let mut sum = DVector::zeros(self.parameters());
            sum.rows_mut(1, 1 + region).fill(1.0);
            let value = sum.rows(0, self.coefficients.len()).dot(&self.coefficients);
            (value, self.variance(&sum))
        };
        (0..self.regions()).map(slope).collect()
    }

    /// Each knee and its variance per unit of noise variance.
    pub fn knees(&self) -> Vec<(f64, f64)> {
        let first = self.coefficients.len();
        let knees = self.knees.iter().enumerate();
        knees
            .map(|(index, knee)| {
                let place = first + index;
                (knee + self.centre[0], self.inverse[(place, place)])
            })
            .collect()
    }

    fn variance(&self, gradient: &DVector<f64>) -> f64 {
        (&self.inverse * gradient).dot(gradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evenly spaced x from -10 to 10, and a line with hinges.
    fn line(slope: f64, hinges: &[(f64, f64)]) -> (Vec<f64>, Vec<f64>) {
        let x: Vec<f64> = (0..=2000).map(|i| f64::from(i) * 0.01 - 10.0).collect();
        let y = x.iter().map(|x| {
            let bends = hinges
                .iter()
                .map(|(knee, change)| change * (x - knee).max(0.0));
            7.0 + slope * x + bends.sum::<f64>()
        });
        let y = y.collect();
        (x, y)
    }

    #[test]
    fn exact_laws_are_found_exactly() {
        let (x, y) = line(0.5, &[(-4.2, 3.0), (1.37, -2.0)]);
        let fit = Samples::new(&x, &y).unwrap().fit(3).unwrap();
        assert!(fit.squares < 1e-6, "{}", fit.squares);
        for ((knee, _), truth) in fit.knees().into_iter().zip([-4.2, 1.37]) {
            assert!((knee - truth).abs() < 1e-3, "{knee}");
        }
        for ((slope, _), truth) in fit.slopes().into_iter().zip([0.5, 3.5, 1.5]) {
            assert!((slope - truth).abs() < 1e-3, "{slope}");
        }
        assert!((fit.value(-10.0) - 2.0).abs() < 1e-3);
        assert_eq!(fit.at_bound, [false, false]);
    }

    #[test]
    fn more_regions_never_fit_worse() {
        let (x, y) = line(0.5, &[(-4.2, 3.0), (1.37, -2.0)]);
        let samples = Samples::new(&x, &y).unwrap();
        let squares: Vec<f64> = [1, 2, 3].map(|n| samples.fit(n).unwrap().squares).into();
        assert!(squares[0] > squares[1] && squares[1] > squares[2]);
    }

    #[test]
    fn a_knee_that_runs_into_the_edge_says_so() {
        let (x, y) = line(0.5, &[(9.95, 40.0)]);
        let fit = Samples::new(&x, &y).unwrap().fit(2).unwrap();
        assert_eq!(fit.at_bound, [true]);
    }

    #[test]
    fn what_does_not_vary_has_no_law() {
        assert!(Samples::new(&[1.0; 50], &[2.0; 50]).is_none());
        assert!(Samples::new(&[], &[]).is_none());
        assert!(Samples::new(&[1.0, f64::NAN], &[2.0, 3.0]).is_none());
    }
}
