//! Least squares on blocks of time, for any choice among many columns: sums of products are made once, every fit and
//! every held-out error comes from them.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::twin::Row;

/// Blocks of held-out data.
pub const BLOCKS: usize = 10;
/// Rows this near to a held-out block are not learnt from.
const GUARD_S: f64 = 0.5;
/// Sweeps of the descent by coordinates.
const SWEEPS: usize = 400;
/// A sweep that moves no coefficient further, in units of its own, is the last.
const STEP_MIN: f64 = 1e-9;

/// Part of the way to its end from which a coefficient is at it.
const AT_END: f64 = 0.999;
/// Eigenvalue of columns of length one below which they depend on one another.
const DEPENDENT: f64 = 1e-9;

/// Limits and prior of a column's coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// Smallest and largest.
    pub range: [f64; 2],
    /// Inverse variance of a normal prior about zero; zero for none.
    pub precision: f64,
}

impl Bound {
    /// No prior and no limits.
    pub const FREE: Self = Self {
        range: [f64::NEG_INFINITY, f64::INFINITY],
        precision: 0.0,
    };
    /// The end of the range at which a coefficient is; none within.
    pub fn end(&self, value: f64) -> Option<f64> {
        let [low, high] = self.range;
        if value <= AT_END * low {
            Some(low)
        } else {
            (value >= AT_END * high).then_some(high)
        }
    }

    /// At least zero.
    pub const POSITIVE: Self = Self {
        range: [0.0, f64::INFINITY],
        precision: 0.0,
    };
}

/// Sums of products of the columns and the target, over some rows.
#[derive(Clone, Debug)]
struct Products {
    columns: DMatrix<f64>,
    target: DVector<f64>,
    /// Precision times mean of each column's prior.
    pull: DVector<f64>,
    square: f64,
    rows: usize,
}

/// A regression on all rows.
#[derive(Clone, Debug)]
pub struct Regression {
    products: Products,
    bounds: Vec<Bound>,
}

/// A regression whose rows lie in blocks of time.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// On the rows of all blocks.
    pub all: Regression,
    /// Of each block alone.
    held_out: Vec<Products>,
    /// Of all but each block and its neighbourhood.
    learnt: Vec<Products>,
}

/// Coefficients of a choice of columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// In the order of the choice.
    pub coefficients: Vec<f64>,
    /// Sum of squares that remains.
    pub square: f64,
}

/// How a choice of columns predicts the blocks it was not fitted to.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOut {
    /// Sum of squared errors in each block.
    pub square: Vec<f64>,
}

impl HeldOut {
    /// Over all blocks.
    pub fn total(&self) -> f64 {
        self.square.iter().sum()
    }
}

/// Which block of time each row is in: all recordings laid end to end and cut in equal parts.
pub fn block_of(rows: &[Row]) -> Vec<usize> {
    let times = laid_end_to_end(rows);
    let end_s = times.iter().copied().fold(0.0, f64::max).max(1e-9);
    times
        .iter()
        .map(|time_s| ((time_s / end_s * BLOCKS as f64) as usize).min(BLOCKS - 1))
        .collect()
}

fn laid_end_to_end(rows: &[Row]) -> Vec<f64> {
    let stretches = rows.iter().map(|row| row.stretch + 1).max().unwrap_or(0);
    let span = |stretch: usize| -> (f64, f64) {
        rows.iter()
            .filter(|row| row.stretch == stretch)
            .fold((f64::INFINITY, 0.0), |(from, to), row| {
                (from.min(row.time_s), row.time_s.max(to))
            })
    };
    let mut offset_s = 0.0;
    let offsets: Vec<f64> = (0..stretches)
        .map(|stretch| {
            let (from_s, to_s) = span(stretch);
            let offset = offset_s - from_s;
            offset_s += (to_s - from_s).max(0.0);
            offset
        })
        .collect();
    rows.iter()
        .map(|row| row.time_s + offsets[row.stretch])
        .collect()
}

impl Products {
    fn zero(columns: usize) -> Self {
        Self {
            columns: DMatrix::zeros(columns, columns),
            target: DVector::zeros(columns),
            pull: DVector::zeros(columns),
            square: 0.0,
            rows: 0,
        }
    }

    fn of(x: &DMatrix<f64>, y: &DVector<f64>) -> Self {
        let count = x.ncols();
        let mut columns = DMatrix::zeros(count, count);
        for one in 0..count {
            for other in 0..=one {
                let product = x.column(one).dot(&x.column(other));
                columns[(one, other)] = product;
                columns[(other, one)] = product;
            }
        }
        Self {
            columns,
            target: x.tr_mul(y),
            pull: DVector::zeros(count),
            square: y.norm_squared(),
            rows: y.len(),
        }
    }

    fn of_rows(x: &DMatrix<f64>, y: &DVector<f64>, rows: &[usize]) -> Self {
        Self::of(&x.select_rows(rows), &y.select_rows(rows))
    }

    fn add(&mut self, other: &Self, factor: f64) {
        self.columns += factor * &other.columns;
        self.target += factor * &other.target;
        self.square += factor * other.square;
        self.rows = if factor > 0.0 {
            self.rows + other.rows
        } else {
            self.rows - other.rows
        };
    }

    /// Sum of squares that these coefficients leave.
    fn left(&self, chosen: &[usize], coefficients: &[f64]) -> f64 {
        let mut sum = self.square;
        for (a, &i) in coefficients.iter().zip(chosen) {
            sum -= 2.0 * a * self.target[i];
            for (b, &j) in coefficients.iter().zip(chosen) {
                sum += a * b * self.columns[(i, j)];
            }
        }
        sum.max(0.0)
    }

    /// Coefficients within their bounds that leave least, by descent along one coordinate after the other.
    fn solve(&self, chosen: &[usize], bounds: &[Bound]) -> Vec<f64> {
        let mut value = self.unbounded(chosen, bounds);
        let inside = chosen
            .iter()
            .zip(&value)
            .all(|(&i, x)| (bounds[i].range[0]..=bounds[i].range[1]).contains(x));
        if inside {
            return value;
        }
        for (x, &i) in value.iter_mut().zip(chosen) {
            *x = x.clamp(bounds[i].range[0], bounds[i].range[1]);
        }
        let columns = DMatrix::from_fn(chosen.len(), chosen.len(), |a, b| {
            self.columns[(chosen[a], chosen[b])]
        });
        let mut value = DVector::from_vec(value);
        for _ in 0..SWEEPS {
            let mut moved = 0.0_f64;
            for (a, &i) in chosen.iter().enumerate() {
                let own = columns[(a, a)];
                let diagonal = own + bounds[i].precision;
                if diagonal <= 0.0 {
                    continue;
                }
                let others = columns.column(a).dot(&value) - own * value[a];
                let [low, high] = bounds[i].range;
                let next = ((self.target[i] + self.pull[i] - others) / diagonal).clamp(low, high);
                moved = moved.max((next - value[a]).abs() * diagonal.sqrt());
                value[a] = next;
            }
            if moved < STEP_MIN * self.square.sqrt().max(1.0) {
                break;
            }
        }
        value.as_slice().to_vec()
    }

    /// Sum of squares that the best coefficients without limits and priors leave: columns may depend on one another.
    fn left_by_free(&self, chosen: &[usize]) -> f64 {
        if chosen.is_empty() {
            return self.square;
        }
        let count = chosen.len();
        let size = |i: usize| self.columns[(i, i)].sqrt().max(1e-150);
        let matrix = DMatrix::from_fn(count, count, |a, b| {
            let (i, j) = (chosen[a], chosen[b]);
            self.columns[(i, j)] / (size(i) * size(j))
        });
        let target = DVector::from_fn(count, |a, _| self.target[chosen[a]] / size(chosen[a]));
        let eigen = matrix.symmetric_eigen();
        let turned = eigen.eigenvectors.tr_mul(&target);
        let told: f64 = eigen
            .eigenvalues
            .iter()
            .zip(turned.iter())
            .filter(|(value, _)| **value > DEPENDENT)
            .map(|(value, along)| along * along / value)
            .sum();
        (self.square - told).max(0.0)
    }

    fn unbounded(&self, chosen: &[usize], bounds: &[Bound]) -> Vec<f64> {
        let count = chosen.len();
        let mut matrix =
            DMatrix::from_fn(count, count, |a, b| self.columns[(chosen[a], chosen[b])]);
        let target = DVector::from_fn(count, |a, _| self.target[chosen[a]] + self.pull[chosen[a]]);
        for (a, &i) in chosen.iter().enumerate() {
            // a hair of its own size keeps two equal columns apart
            let own = matrix[(a, a)];
            matrix[(a, a)] += bounds[i].precision + 1e-9 * own + 1e-12;
        }
        match matrix.cholesky() {
            Some(cholesky) => cholesky.solve(&target).iter().copied().collect(),
            None => vec![0.0; count],
        }
    }
}

/// Columns side by side, of so many rows each.
pub(crate) fn matrix<'a>(
    columns: impl IntoIterator<Item = &'a Vec<f64>>,
    rows: usize,
) -> DMatrix<f64> {
    let (mut values, mut count) = (Vec::new(), 0);
    for column in columns {
        values.extend_from_slice(column);
        count += 1;
    }
    DMatrix::from_vec(rows, count, values)
}

/// Precision times mean of each column's prior, where means are given.
fn pull(bounds: &[Bound], prior_means: &[f64]) -> DVector<f64> {
    DVector::from_fn(bounds.len(), |i, _| {
        bounds[i].precision * prior_means.get(i).copied().unwrap_or(0.0)
    })
}

impl Regression {
    /// From whitened columns and target, and means of the priors where they are not zero.
    pub fn new<'a>(
        columns: impl IntoIterator<Item = &'a Vec<f64>>,
        target: &[f64],
        bounds: &[Bound],
        prior_means: &[f64],
    ) -> Self {
        let x = matrix(columns, target.len());
        let y = DVector::from_column_slice(target);
        Self {
            products: Products {
                pull: pull(bounds, prior_means),
                ..Products::of(&x, &y)
            },
            bounds: bounds.to_vec(),
        }
    }

    /// How many rows.
    pub fn rows(&self) -> usize {
        self.products.rows
    }

    /// Fits a choice of columns.
    pub fn fit(&self, chosen: &[usize]) -> Fit {
        let coefficients = self.products.solve(chosen, &self.bounds);
        Fit {
            square: self.products.left(chosen, &coefficients),
            coefficients,
        }
    }

    /// Information about some columns' coefficients, with others refitted beside them: matrix and vector of the normal
    /// equations after the others are eliminated.
    pub fn information(&self, beside: &[usize], chosen: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        let products = &self.products.columns;
        let between = DMatrix::from_fn(beside.len(), chosen.len(), |a, b| {
            products[(beside[a], chosen[b])]
        });
        let own = DMatrix::from_fn(chosen.len(), chosen.len(), |a, b| {
            products[(chosen[a], chosen[b])]
        });
        let target = DVector::from_fn(chosen.len(), |a, _| self.products.target[chosen[a]]);
        let others = DMatrix::from_fn(beside.len(), beside.len(), |a, b| {
            let prior = if a == b {
                self.bounds[beside[a]].precision + 1e-9 * products[(beside[a], beside[a])]
            } else {
                0.0
            };
            products[(beside[a], beside[b])] + prior
        });
        let others_target = DVector::from_fn(beside.len(), |a, _| {
            self.products.target[beside[a]] + self.products.pull[beside[a]]
        });
        let Some(others) = others.cholesky() else {
            return (own, target);
        };
        let through = others.solve(&between);
        (
            own - between.transpose() * &through,
            target - through.transpose() * others_target,
        )
    }

    /// How far one choice of columns is from being imitated by another: the least of `‖Σ a·x − Σ b·z‖²` over the
    /// coefficients `b` of `others`, with `a` given. What `is_free` has neither limits nor a prior.
    pub fn distance(
        &self,
        chosen: &[usize],
        coefficients: &[f64],
        others: &[usize],
        is_free: bool,
    ) -> f64 {
        let mut imitated = self.products.clone();
        imitated.target = DVector::from_fn(self.bounds.len(), |i, _| {
            let products = chosen.iter().zip(coefficients);
            products
                .map(|(&j, a)| a * self.products.columns[(i, j)])
                .sum()
        });
        imitated.square = chosen
            .iter()
            .zip(coefficients)
            .map(|(&j, a)| a * imitated.target[j])
            .sum();
        if is_free {
            return imitated.left_by_free(others);
        }
        let found = imitated.solve(others, &self.bounds);
        imitated.left(others, &found)
    }
}

impl Blocks {
    /// From whitened columns and target, and means of the priors where they are not zero.
    pub fn new<'a>(
        columns: impl IntoIterator<Item = &'a Vec<f64>>,
        target: &[f64],
        bounds: &[Bound],
        prior_means: &[f64],
        rows: &[Row],
    ) -> Self {
        let x = matrix(columns, target.len());
        let y = DVector::from_column_slice(target);
        let blocks = block_of(rows);
        let times_s = laid_end_to_end(rows);
        let span: Vec<Range<f64>> = (0..BLOCKS)
            .map(|block| {
                let inside = || (0..rows.len()).filter(|k| blocks[*k] == block);
                let from = inside().map(|k| times_s[k]).fold(f64::INFINITY, f64::min);
                let to = inside().map(|k| times_s[k]).fold(0.0, f64::max);
                from - GUARD_S..to + GUARD_S
            })
            .collect();
        let select = |keep: &dyn Fn(usize) -> bool| -> Vec<usize> {
            (0..rows.len()).filter(|k| keep(*k)).collect()
        };
        let held_out: Vec<Products> = (0..BLOCKS)
            .map(|block| Products::of_rows(&x, &y, &select(&|k| blocks[k] == block)))
            .collect();
        let mut all = Products::zero(x.ncols());
        for products in &held_out {
            all.add(products, 1.0);
        }
        all.pull = pull(bounds, prior_means);
        let learnt = (0..BLOCKS)
            .map(|block| {
                let near = select(&|k| blocks[k] != block && span[block].contains(&times_s[k]));
                let mut learnt = all.clone();
                learnt.add(&held_out[block], -1.0);
                learnt.add(&Products::of_rows(&x, &y, &near), -1.0);
                learnt
            })
            .collect();
        Self {
            all: Regression {
                products: all,
                bounds: bounds.to_vec(),
            },
            held_out,
            learnt,
        }
    }

    /// Fits a choice of columns to all rows but a block, for each block, and predicts that.
    pub fn held_out(&self, chosen: &[usize]) -> HeldOut {
        let square = self
            .learnt
            .iter()
            .zip(&self.held_out)
            .map(|(learnt, held_out)| {
                let coefficients = learnt.solve(chosen, &self.all.bounds);
                held_out.left(chosen, &coefficients)
            })
            .collect();
        HeldOut { square }
    }

    /// Coefficients fitted to all rows but a block, for each block.
    pub fn folds(&self, chosen: &[usize]) -> Vec<Vec<f64>> {
        self.learnt
            .iter()
            .map(|learnt| learnt.solve(chosen, &self.all.bounds))
            .collect()
    }

    /// Covariance of a fit's coefficients from the scatter between blocks (Liang and Zeger's sandwich, by blocks).
    pub fn covariance(&self, chosen: &[usize], fit: &Fit) -> DMatrix<f64> {
        let count = chosen.len();
        let information = DMatrix::from_fn(count, count, |a, b| {
            let own = if a == b {
                self.all.bounds[chosen[a]].precision
                    + 1e-9 * self.all.products.columns[(chosen[a], chosen[a])]
            } else {
                0.0
            };
            self.all.products.columns[(chosen[a], chosen[b])] + own
        });
        let Some(inverse) = information.clone().cholesky().map(|own| own.inverse()) else {
            return DMatrix::from_diagonal_element(count, count, f64::INFINITY);
        };
        let mut scatter = DMatrix::zeros(count, count);
        for block in &self.held_out {
            let score = DVector::from_fn(count, |a, _| {
                let fitted: f64 = chosen
                    .iter()
                    .zip(&fit.coefficients)
                    .map(|(&j, x)| block.columns[(chosen[a], j)] * x)
                    .sum();
                block.target[chosen[a]] - fitted
            });
            scatter += &score * score.transpose();
        }
        // what is held by a prior is as unsure as the prior, however small the residual is
        let priors = DMatrix::from_fn(count, count, |a, b| {
            if a == b {
                self.all.bounds[chosen[a]].precision
            } else {
                0.0
            }
        });
        // never surer than independent samples of the remaining size would make it
        let freedom = self.all.products.rows.saturating_sub(count).max(1) as f64;
        let independent = (&information - &priors) * (fit.square / freedom);
        let between = &inverse * (scatter + &priors) * &inverse;
        let within = &inverse * (independent + &priors) * &inverse;
        DMatrix::from_fn(count, count, |a, b| {
            if a == b {
                between[(a, a)].max(within[(a, a)])
            } else {
                between[(a, b)]
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(count: usize) -> Vec<Row> {
        (0..count).map(|k| Row::at_rest(k as f64 * 0.1)).collect()
    }

    fn blocks(bounds: Vec<Bound>) -> Blocks {
        let a: Vec<f64> = (0..200).map(|k| (0.3 * f64::from(k)).sin()).collect();
        let b: Vec<f64> = (0..200).map(|k| (0.17 * f64::from(k)).cos()).collect();
        let y: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - 3.0 * b).collect();
        Blocks::new(&[a, b], &y, &bounds, &[], &rows(200))
    }

    #[test]
    fn the_coefficients_are_found_and_predict_held_out_blocks() {
        let blocks = blocks(vec![Bound::FREE; 2]);
        let fit = blocks.all.fit(&[1, 0]);
        assert!((fit.coefficients[0] + 3.0).abs() < 1e-6);
        assert!((fit.coefficients[1] - 2.0).abs() < 1e-6);
        assert!(blocks.held_out(&[0, 1]).total() < 1e-6);
        assert!(blocks.held_out(&[0]).total() > 100.0);
    }

    #[test]
    fn bounds_hold_and_the_rest_makes_the_best_of_it() {
        let blocks = blocks(vec![Bound::FREE, Bound::POSITIVE]);
        let fit = blocks.all.fit(&[0, 1]);
        assert_eq!(fit.coefficients[1], 0.0);
        let alone = blocks.all.fit(&[0]);
        assert!((fit.coefficients[0] - alone.coefficients[0]).abs() < 1e-6);
    }

    #[test]
    fn columns_that_depend_on_each_other_imitate_as_much_as_one() {
        let a: Vec<f64> = (0..200).map(|k| (0.3 * f64::from(k)).sin()).collect();
        let b: Vec<f64> = (0..200).map(|k| (0.17 * f64::from(k)).cos()).collect();
        let both: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let columns = [a.clone(), a, b, both, vec![0.0; 200]];
        let regression = Regression::new(&columns, &columns[0], &[Bound::FREE; 5], &[]);
        let distance = |of: usize, size: f64, others: &[usize]| {
            regression.distance(&[of], &[size], others, true)
        };
        assert!(distance(3, 2.0, &[0, 1, 2, 4]) < 1e-6);
        let whole = distance(2, 1.0, &[]);
        let left = distance(2, 1.0, &[0, 1, 4]);
        assert!(left > 0.9 * whole && left <= whole, "{left} of {whole}");
    }

    #[test]
    fn a_column_is_imitated_by_itself_and_not_by_another() {
        let regression = blocks(vec![Bound::FREE; 2]).all;
        assert!(regression.distance(&[0], &[2.0], &[0], false) < 1e-6);
        assert!(regression.distance(&[0], &[2.0], &[1], true) > 300.0);
    }
}
