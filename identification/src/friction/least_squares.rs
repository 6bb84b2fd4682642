//! Weighted linear least squares over a few columns, by QR decomposition.

use nalgebra::{DMatrix, DVector, Dyn, QR};

use super::speeds::Point;

/// Columns closer to dependent than this, each of unit length, cannot be told apart.
const SINGULAR: f64 = 1e-10;

struct Weighted {
    qr: QR<f64, Dyn, Dyn>,
    column_norms: Vec<f64>,
}

/// Decomposes the weighted design matrix; none where its columns are dependent or not finite.
fn decompose<const N: usize>(
    points: &[Point],
    columns: &impl Fn(f64) -> [f64; N],
) -> Option<Weighted> {
    if points.len() < N {
        return None;
    }
    let mut design = DMatrix::zeros(points.len(), N);
    for (row, point) in points.iter().enumerate() {
        for (column, value) in columns(point.speed_rad_s).into_iter().enumerate() {
            design[(row, column)] = value / point.scatter_nm;
        }
    }
    let column_norms: Vec<f64> = design.column_iter().map(|column| column.norm()).collect();
    for (mut column, norm) in design.column_iter_mut().zip(&column_norms) {
        column /= *norm;
    }
    let usable = |norm: &f64| norm.is_normal();
    if !column_norms.iter().all(usable) || !design.iter().all(|value| value.is_finite()) {
        return None;
    }
    let qr = design.qr();
    let regular = qr.r().diagonal().iter().all(|pivot| pivot.abs() > SINGULAR);
    regular.then_some(Weighted { qr, column_norms })
}

/// Coefficients of the columns that miss the levels least.
pub(super) fn solve<const N: usize>(
    points: &[Point],
    columns: &impl Fn(f64) -> [f64; N],
) -> Option<[f64; N]> {
    let weighted = decompose(points, columns)?;
    let levels = points.iter().map(|point| point.level_nm / point.scatter_nm);
    let mut rotated = DVector::from_iterator(points.len(), levels);
    weighted.qr.q_tr_mul(&mut rotated);
    let solution = weighted
        .qr
        .r()
        .solve_upper_triangular(&rotated.rows(0, N).into_owned())?;
    let coefficients: [f64; N] =
        std::array::from_fn(|column| solution[column] / weighted.column_norms[column]);
    coefficients
        .iter()
        .all(|c| c.is_finite())
        .then_some(coefficients)
}

/// Square roots of the diagonal of `(XᵀWX)⁻¹`: standard errors for misses of one scatter.
pub(super) fn unit_errors<const N: usize>(
    points: &[Point],
    columns: &impl Fn(f64) -> [f64; N],
) -> Option<[f64; N]> {
    let weighted = decompose(points, columns)?;
    let inverse = weighted
        .qr
        .r()
        .solve_upper_triangular(&DMatrix::identity(N, N))?;
    Some(std::array::from_fn(|column| {
        inverse.row(column).norm() / weighted.column_norms[column]
    }))
}
