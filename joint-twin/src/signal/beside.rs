//! What pairs of columns explain beside others.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix2};

/// What columns take off a target's squares beside others that are fitted with them, each of these held by a normal prior of
/// variance 1.
pub struct Beside {
    known: DMatrix<f64>,
    information: Option<Cholesky<f64, Dyn>>,
    left: DVector<f64>,
}

impl Beside {
    /// From whitened columns and target.
    pub fn new(known: &[Vec<f64>], target: &[f64]) -> Self {
        let known = DMatrix::from_vec(target.len(), known.len(), known.concat());
        let target = DVector::from_column_slice(target);
        let own = known.tr_mul(&known) + DMatrix::identity(known.ncols(), known.ncols());
        let information = own.cholesky();
        let left = match &information {
            Some(own) => &target - &known * own.solve(&known.tr_mul(&target)),
            None => target,
        };
        Self {
            known,
            information,
            left,
        }
    }

    /// What they leave of the target.
    pub fn left(&self) -> &[f64] {
        self.left.as_slice()
    }

    /// The same for columns that are zero but at these rows.
    #[must_use]
    pub fn only(&self, places: &[usize]) -> Self {
        Self {
            known: self.known.select_rows(places),
            information: self.information.clone(),
            left: self.left.select_rows(places),
        }
    }

    /// By how much each pair of columns lessens the squares.
    pub fn gains(&self, pairs: &DMatrix<f64>) -> Vec<f64> {
        let between = self.known.transpose() * pairs;
        let along = pairs.tr_mul(&self.left);
        let eliminated = self.information.as_ref().map(|own| own.solve(&between));
        let gain = |first: usize| {
            let mut matrix = Matrix2::zeros();
            for (i, j) in [(0, 0), (1, 0), (1, 1)] {
                let [one, other] = [first + i, first + j];
                let mut own = pairs.column(one).dot(&pairs.column(other));
                if let Some(eliminated) = &eliminated {
                    own -= between.column(one).dot(&eliminated.column(other));
                }
                matrix[(i, j)] = own;
                matrix[(j, i)] = own;
            }
            matrix += Matrix2::identity() * (1e-9 * matrix.trace() + 1e-12);
            let vector = along.fixed_rows::<2>(first);
            let fitted = matrix.cholesky().map(|matrix| matrix.solve(&vector));
            fitted.map_or(0.0, |fitted| vector.dot(&fitted))
        };
        (0..pairs.ncols()).step_by(2).map(gain).collect()
    }
}
