//! Sums of squares and products part by part, and what columns that are in every set leave of them.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::PARTS;

#[derive(Clone)]
pub(super) struct Sums {
    pub gram: DMatrix<f64>,
    pub vector: DVector<f64>,
    pub square: f64,
    pub rows: f64,
}

/// A part left out, with the columns that are in every set eliminated.
#[derive(Clone)]
pub(super) struct Reduced {
    pub train: DMatrix<f64>,
    pub train_vector: DVector<f64>,
    /// Span by span.
    pub tests: Vec<Test>,
    /// Columns in every set: their values without laws, and per value of each law's column.
    pub rest: DVector<f64>,
    pub per_law: DMatrix<f64>,
}

/// What a part that is left out says of a fit: by how much it is off, beyond what the values in every set leave open. Those are known by
/// their priors and the other parts; what this part adds to that is no error of the laws'. (The logarithm of the determinant of what
/// they leave open is the same for all sets.)
#[derive(Clone)]
pub(super) struct Test {
    pub gram: DMatrix<f64>,
    pub vector: DVector<f64>,
    pub square: f64,
}

impl Sums {
    pub fn zero(count: usize) -> Self {
        Self {
            gram: DMatrix::zeros(count, count),
            vector: DVector::zeros(count),
            square: 0.0,
            rows: 0.0,
        }
    }

    /// Sum of squares that columns at these values leave.
    pub fn left_by(&self, values: &[(usize, f64)]) -> f64 {
        let mut left = self.square;
        for (place, value) in values {
            left -= 2.0 * value * self.vector[*place];
            for (other, beside) in values {
                left += value * self.gram[(*place, *other)] * beside;
            }
        }
        left.max(0.0)
    }

    pub fn add(&mut self, other: &Self, factor: f64) {
        self.gram
            .zip_apply(&other.gram, |sum, x| *sum += factor * x);
        self.vector.axpy(factor, &other.vector, 1.0);
        self.square += factor * other.square;
        self.rows += factor * other.rows;
    }
}

/// Sums over tenths of a span's rows, one after the other.
pub(super) fn parts(columns: &[Vec<f64>], gap_nm: &[f64], span: &Range<usize>) -> Vec<Sums> {
    let rows = span.len();
    (0..PARTS)
        .map(|part| {
            let within = span.start + part * rows / PARTS..span.start + (part + 1) * rows / PARTS;
            let count = columns.len();
            let mut gram = DMatrix::zeros(count, count);
            let mut vector = DVector::zeros(count);
            let gap = &gap_nm[within.clone()];
            for i in 0..count {
                let one = &columns[i][within.clone()];
                vector[i] = dot(one, gap);
                for j in 0..=i {
                    let product = dot(one, &columns[j][within.clone()]);
                    gram[(i, j)] = product;
                    gram[(j, i)] = product;
                }
            }
            Sums {
                gram,
                vector,
                square: dot(gap, gap),
                rows: gap.len() as f64,
            }
        })
        .collect()
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A part that is left out: what the other parts leave of it, and what that is along the columns in every set.
struct OfPart {
    test: Test,
    /// Squares of these columns.
    gram: DMatrix<f64>,
    /// Their products with the rest, without laws and less per value of each law's column.
    off: DVector<f64>,
    per_law: DMatrix<f64>,
}

/// What is left once the columns in every set have what the part itself tells of their values, at the price of what the other parts do:
/// with `u` the rest's products with them and `A` the precision they have with this part, `uᵀA⁻¹u` less.
fn beyond_what_is_open(
    of_parts: Vec<OfPart>,
    tests: &[(&Sums, f64)],
    mut precision: DMatrix<f64>,
) -> Vec<Test> {
    let Some(first) = of_parts.first() else {
        return Vec::new();
    };
    let mut off = DVector::zeros(first.off.len());
    let mut per_law = DMatrix::zeros(first.per_law.nrows(), first.per_law.ncols());
    for (of, (_, weight)) in of_parts.iter().zip(tests) {
        precision += &of.gram * *weight;
        off.axpy(*weight, &of.off, 1.0);
        per_law += &of.per_law * *weight;
    }
    let moved = (!off.is_empty()).then(|| precision.cholesky()).flatten();
    let moved = moved.map(|solved| (solved.solve(&off), solved.solve(&per_law)));
    of_parts
        .into_iter()
        .map(|of| {
            let mut test = of.test;
            if let Some((value, by_law)) = &moved {
                let cross = by_law.transpose() * &of.per_law;
                test.gram -= 0.5 * (&cross + cross.transpose());
                test.vector -=
                    0.5 * (by_law.transpose() * &of.off + of.per_law.transpose() * value);
                test.square -= value.dot(&of.off);
            }
            test
        })
        .collect()
}

impl Reduced {
    pub fn empty() -> Self {
        Self {
            train: DMatrix::zeros(0, 0),
            train_vector: DVector::zeros(0),
            tests: Vec::new(),
            rest: DVector::zeros(0),
            per_law: DMatrix::zeros(0, 0),
        }
    }

    pub fn of(
        train: &Sums,
        tests: &[(&Sums, f64)],
        (prior, pull): &(DMatrix<f64>, DVector<f64>),
        lift: &[f64],
        open: usize,
    ) -> Self {
        let laws = lift.len();
        let beside = prior.nrows();
        let block = |sums: &Sums| {
            let gram = &sums.gram;
            (
                gram.view((0, 0), (laws, laws)).into_owned(),
                gram.view((laws, 0), (beside, laws)).into_owned(),
                gram.view((laws, laws), (beside, beside)).into_owned(),
                sums.vector.rows(0, laws).into_owned(),
                sums.vector.rows(laws, beside).into_owned(),
            )
        };
        let (ll, tl, tt, bl, bt) = block(train);
        let (mut rest, mut per_law) = (DVector::zeros(beside), DMatrix::zeros(beside, laws));
        let precision = tt + prior;
        if beside > 0
            && let Some(solved) = precision.clone().cholesky()
        {
            rest = solved.solve(&(&bt + pull));
            per_law = solved.solve(&tl);
        }
        let mut lifted = &ll - tl.transpose() * &per_law;
        for (k, lift) in lift.iter().enumerate() {
            lifted[(k, k)] += lift;
        }
        let train_vector = &bl - tl.transpose() * &rest;
        let of_parts: Vec<OfPart> = tests
            .iter()
            .map(|(sums, _)| {
                let (ll, tl, tt, bl, bt) = block(sums);
                let cross = tl.transpose() * &per_law;
                let inner = &tl - &tt * &per_law;
                OfPart {
                    off: (&bt - &tt * &rest).rows(0, open).into_owned(),
                    test: Test {
                        gram: &ll - &cross - cross.transpose()
                            + per_law.transpose() * &tt * &per_law,
                        vector: &bl - per_law.transpose() * &bt - inner.transpose() * &rest,
                        square: sums.square - 2.0 * rest.dot(&bt) + rest.dot(&(&tt * &rest)),
                    },
                    gram: tt.view((0, 0), (open, open)).into_owned(),
                    per_law: inner.rows(0, open).into_owned(),
                }
            })
            .collect();
        let precision = precision.view((0, 0), (open, open)).into_owned();
        let tests = beyond_what_is_open(of_parts, tests, precision);
        Self {
            train: lifted,
            train_vector,
            tests,
            rest,
            per_law,
        }
    }

    pub fn picked(&self, places: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        let count = places.len();
        (
            DMatrix::from_fn(count, count, |i, j| self.train[(places[i], places[j])]),
            DVector::from_iterator(count, places.iter().map(|k| self.train_vector[*k])),
        )
    }

    pub fn values(&self, places: &[usize]) -> DVector<f64> {
        self.values_with(places, &[])
    }

    /// Values of columns beside others that are held.
    pub fn values_with(&self, places: &[usize], held: &[(usize, f64)]) -> DVector<f64> {
        let (matrix, mut vector) = self.picked(places);
        for (of, value) in held {
            for (sum, place) in vector.iter_mut().zip(places) {
                *sum -= value * self.train[(*place, *of)];
            }
        }
        match matrix.cholesky() {
            Some(solved) => solved.solve(&vector),
            None => DVector::zeros(places.len()),
        }
    }

    pub fn inverse(&self, places: &[usize]) -> DMatrix<f64> {
        let count = places.len();
        let (matrix, _) = self.picked(places);
        matrix
            .cholesky()
            .map_or_else(|| DMatrix::zeros(count, count), |solved| solved.inverse())
    }

    pub fn rest_of(&self, places: &[usize], values: &DVector<f64>) -> DVector<f64> {
        let mut rest = self.rest.clone();
        for (place, value) in places.iter().zip(values.iter()) {
            rest.axpy(-*value, &self.per_law.column(*place), 1.0);
        }
        rest
    }

    /// What columns that are fitted, and others that are held, leave of each test.
    pub fn left(&self, places: &[usize], held: &[(usize, f64)]) -> Vec<f64> {
        let values = self.values_with(places, held);
        let own = places.iter().copied().zip(values.iter().copied());
        let all: Vec<(usize, f64)> = own.chain(held.iter().copied()).collect();
        let of_test = |test: &Test| {
            let mut left = test.square;
            for (place, value) in &all {
                left -= 2.0 * value * test.vector[*place];
                for (other, beside) in &all {
                    left += value * test.gram[(*place, *other)] * beside;
                }
            }
            left.max(0.0)
        };
        self.tests.iter().map(of_test).collect()
    }
}
