//! Least squares with limits and priors on the coefficients.

use nalgebra::{DMatrix, DVector};

/// Sweeps of the descent by coordinates.
const SWEEPS: usize = 400;
/// A sweep that moves no coefficient further, in units of its own, is the last.
const STEP_MIN: f64 = 1e-9;

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
    /// At least zero.
    pub const POSITIVE: Self = Self {
        range: [0.0, f64::INFINITY],
        precision: 0.0,
    };
}

/// Coefficients within their bounds that leave least.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// In the order of the columns.
    pub coefficients: Vec<f64>,
    /// Sum of squares that remains.
    pub square: f64,
}

impl Fit {
    /// Of columns to a target, each with its bound.
    pub fn of(columns: &[Vec<f64>], target: &[f64], bounds: &[Bound]) -> Self {
        let x = matrix(columns, target.len());
        let y = DVector::from_column_slice(target);
        let (products, pulled) = (x.tr_mul(&x), x.tr_mul(&y));
        let value = solved(&products, &pulled, y.norm_squared(), bounds);
        let left = y.norm_squared() - 2.0 * value.dot(&pulled) + value.dot(&(&products * &value));
        Self {
            coefficients: value.iter().copied().collect(),
            square: left.max(0.0),
        }
    }
}

/// By descent along one coordinate after the other, from the best without limits.
fn solved(
    products: &DMatrix<f64>,
    pulled: &DVector<f64>,
    square: f64,
    bounds: &[Bound],
) -> DVector<f64> {
    let mut lifted = products.clone();
    for (k, bound) in bounds.iter().enumerate() {
        // a hair of its own size keeps two equal columns apart
        lifted[(k, k)] += bound.precision + 1e-9 * products[(k, k)] + 1e-12;
    }
    let mut value = match lifted.cholesky() {
        Some(lifted) => lifted.solve(pulled),
        None => DVector::zeros(bounds.len()),
    };
    let is_within = |(x, bound): (&f64, &Bound)| (bound.range[0]..=bound.range[1]).contains(x);
    if value.iter().zip(bounds).all(is_within) {
        return value;
    }
    for (x, bound) in value.iter_mut().zip(bounds) {
        *x = x.clamp(bound.range[0], bound.range[1]);
    }
    for _ in 0..SWEEPS {
        let mut moved = 0.0_f64;
        for (k, bound) in bounds.iter().enumerate() {
            let own = products[(k, k)];
            let diagonal = own + bound.precision;
            if diagonal <= 0.0 {
                continue;
            }
            let others = products.column(k).dot(&value) - own * value[k];
            let next = ((pulled[k] - others) / diagonal).clamp(bound.range[0], bound.range[1]);
            moved = moved.max((next - value[k]).abs() * diagonal.sqrt());
            value[k] = next;
        }
        if moved < STEP_MIN * square.sqrt().max(1.0) {
            break;
        }
    }
    value
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_hold_and_the_rest_makes_the_best_of_it() {
        let columns: [Vec<f64>; 2] = [
            (0..200).map(|k| (0.1 * f64::from(k)).sin()).collect(),
            (0..200).map(|k| (0.1 * f64::from(k) + 0.5).sin()).collect(),
        ];
        let both = columns[0].iter().zip(&columns[1]);
        let target: Vec<f64> = both.map(|(a, b)| 2.0 * a - b).collect();
        let free = Fit::of(&columns, &target, &[Bound::FREE; 2]);
        assert!((free.coefficients[0] - 2.0).abs() < 1e-6 && free.square < 1e-9);
        let fit = Fit::of(&columns, &target, &[Bound::FREE, Bound::POSITIVE]);
        assert_eq!(fit.coefficients[1], 0.0);
        let own: f64 = columns[0].iter().map(|x| x * x).sum();
        let dot: f64 = columns[0].iter().zip(&target).map(|(x, y)| x * y).sum();
        assert!((fit.coefficients[0] - dot / own).abs() < 1e-6);
    }
}
