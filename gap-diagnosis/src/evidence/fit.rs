//! A set of names fitted to all rows: its amplitudes, and what the file's values and the arm's shared cause come to beside them.

use nalgebra::{DMatrix, DVector};

use super::{Evidence, Message, Names, PARTS};

/// Values of a set fitted to all rows.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Amplitudes of each item of the set, by its place.
    pub amplitudes: Vec<(usize, Vec<f64>)>,
    /// Covariance of all amplitudes in that order.
    pub covariance: DMatrix<f64>,
    /// Values of the columns in every set.
    pub beside: Vec<f64>,
    /// What the set predicts of the gap.
    pub predicted_nm: Vec<f64>,
}

impl Evidence {
    /// A set fitted to all rows.
    pub fn fit(&self, names: Names) -> Fit {
        let places = self.places(names);
        let whole = &self.whole;
        let values = whole.values(&places);
        let rest = whole.rest_of(&places, &values);
        let inverse = whole.inverse(&places) / self.row_precision();
        let mut predicted_nm = vec![0.0; self.gap_nm.len()];
        let laws = places.iter().zip(values.iter());
        let beside = (self.law_columns..).zip(rest.iter());
        for (place, value) in laws.map(|(place, value)| (*place, value)).chain(beside) {
            for (sum, x) in predicted_nm.iter_mut().zip(&self.columns[place]) {
                *sum += value * x;
            }
        }
        let mut amplitudes = Vec::new();
        let mut at = 0;
        for index in 0..self.kinds.len() {
            if names & (1 << index) != 0 {
                let own = self.own[index].clone();
                let count = own.len();
                let of_item = own
                    .enumerate()
                    .map(|(k, place)| values[at + k] / self.scale[place]);
                amplitudes.push((index, of_item.collect::<Vec<f64>>()));
                at += count;
            }
        }
        let scales: Vec<f64> = places.iter().map(|place| self.scale[*place]).collect();
        let covariance = DMatrix::from_fn(places.len(), places.len(), |i, j| {
            inverse[(i, j)] / (scales[i] * scales[j])
        });
        Fit {
            amplitudes,
            covariance,
            beside: rest.iter().copied().collect(),
            predicted_nm,
        }
    }

    /// Amplitudes of some of a set's items, of one column each and none below its least, that leave least beside the rest of the set: where one
    /// is at its least, the others are fitted with that one held. And the mean square that they leave out of the first signal.
    pub fn fit_above(&self, names: Names, least: &[(usize, f64)]) -> Option<(Vec<f64>, f64)> {
        let rows = self.spans[0].rows.len().max(1) as f64;
        let place = |item: usize| self.own[item].start;
        let fits = (0..1_usize << least.len()).map(|set| {
            let is_held = |k: usize| set & (1 << k) != 0;
            let held = least.iter().enumerate().filter(|(k, _)| is_held(*k));
            let held =
                held.map(|(_, (item, value))| (place(*item), value * self.scale[place(*item)]));
            let held: Vec<(usize, f64)> = held.collect();
            let mut free = self.places(names);
            free.retain(|own| held.iter().all(|(other, _)| other != own));
            let fitted = self.whole.values_with(&free, &held);
            let fitted = |item: usize| {
                let at = free.iter().position(|own| *own == place(item));
                at.map_or(0.0, |at| fitted[at] / self.scale[free[at]])
            };
            let own = least.iter().enumerate();
            let own = own.map(|(k, (item, value))| if is_held(k) { *value } else { fitted(*item) });
            let left: f64 = self
                .left_with(&free, &held)
                .iter()
                .map(|part| part[0])
                .sum();
            (own.collect::<Vec<f64>>(), left / rows)
        });
        let can_be = fits.filter(|(values, _)| {
            values
                .iter()
                .zip(least)
                .all(|(value, (_, least))| value >= least)
        });
        can_be.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// What the file's values, and the arm's shared cause, come to beside a set.
    pub fn values_beside(&self, names: Names) -> Vec<f64> {
        let places = self.places(names);
        let rest = self.whole.rest_of(&places, &self.whole.values(&places));
        rest.iter().copied().collect()
    }

    /// Values and errors of the file's beside a set, in standard deviations of what is known of them.
    pub fn known_beside(&self, names: Names) -> Vec<[f64; 2]> {
        let total = self.total();
        let (prior, _) = self.prior();
        let laws = self.places(names);
        let known = self.law_columns..self.columns.len() - self.shared_columns;
        let all: Vec<usize> = laws.iter().copied().chain(known.clone()).collect();
        let mut matrix =
            DMatrix::from_fn(all.len(), all.len(), |i, j| total.gram[(all[i], all[j])]);
        for (i, place) in all.iter().enumerate() {
            matrix[(i, i)] += match place.checked_sub(self.law_columns) {
                None => self.lift[*place],
                Some(at) => prior[(at, at)],
            };
        }
        let variance = match matrix.cholesky() {
            Some(solved) => solved.inverse().diagonal() / self.row_precision(),
            None => DVector::from_element(all.len(), 1.0),
        };
        let values = self.values_beside(names);
        let errors = variance.iter().skip(laws.len()).map(|v| v.max(0.0).sqrt());
        values
            .into_iter()
            .zip(errors)
            .map(|(value, error)| [value, error])
            .collect()
    }

    /// Sums of squares that a set leaves out, part by part, with the columns in every set held at these values; those that are not told are
    /// none.
    pub fn left_at(&self, names: Names, beside: &[f64]) -> [f64; PARTS] {
        self.left_of_signals_at(names, beside).map(|by_signal| {
            let both = by_signal.iter().zip(self.energies());
            both.map(|(left, factor)| factor * left).sum()
        })
    }

    /// The same signal by signal, each in its own rows' squares.
    pub(super) fn left_of_signals_at(&self, names: Names, beside: &[f64]) -> [Vec<f64>; PARTS] {
        let places = self.places(names);
        let held: Vec<(usize, f64)> = (self.law_columns..self.columns.len())
            .zip(beside.iter().copied())
            .collect();
        std::array::from_fn(|part| {
            let train = &self.trains[part];
            let count = places.len();
            let matrix = DMatrix::from_fn(count, count, |i, j| {
                let lift = if i == j { self.lift[places[i]] } else { 0.0 };
                train.gram[(places[i], places[j])] + lift
            });
            let vector = DVector::from_fn(count, |i, _| {
                let taken = held.iter();
                let taken = taken.map(|(at, value)| value * train.gram[(places[i], *at)]);
                train.vector[places[i]] - taken.sum::<f64>()
            });
            let values = match matrix.cholesky() {
                Some(solved) => solved.solve(&vector),
                None => DVector::zeros(count),
            };
            let own = places.iter().copied().zip(values.iter().copied());
            let all: Vec<(usize, f64)> = own.chain(held.iter().copied()).collect();
            let spans = self.parts.iter();
            spans.map(|of_span| of_span[part].left_by(&all)).collect()
        })
    }

    /// What this joint alone says of the shared cause's amplitudes beside a set of names, which counts by what that set leaves; none without
    /// one.
    pub fn message(&self, names: Names) -> Option<Message> {
        let shared = self.shared.as_ref()?;
        let places = self.places(names);
        let total = self.total();
        let count = self.columns.len();
        let from = count - self.shared_columns;
        let others: Vec<usize> = places
            .iter()
            .copied()
            .chain(self.law_columns..from)
            .collect();
        let left = self.mean_squares(names)[0] + self.settled[0].floor;
        let of_best = self.row_precision();
        let worth = of_best * self.settled[0].variance / left.max(f64::MIN_POSITIVE);
        let (prior, _) = self.prior();
        let pick = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
                worth * total.gram[(rows[i], columns[j])]
            })
        };
        let of_shared: Vec<usize> = (from..count).collect();
        let mut beside = pick(&others, &others);
        let lift = &self.lift;
        for i in 0..others.len() {
            let place = others[i];
            beside[(i, i)] += if place < self.law_columns {
                of_best * lift[place]
            } else {
                let at = place - self.law_columns;
                of_best * prior[(at, at)]
            };
        }
        let cross = pick(&others, &of_shared);
        let vector = |at: &[usize]| {
            DVector::from_iterator(at.len(), at.iter().map(|k| worth * total.vector[*k]))
        };
        let mut precision = pick(&of_shared, &of_shared);
        let mut pull = vector(&of_shared);
        if let Some(solved) = beside.cholesky() {
            precision -= cross.transpose() * solved.solve(&cross);
            pull -= cross.transpose() * solved.solve(&vector(&others));
        }
        debug_assert_eq!(shared.pull.len(), pull.len());
        Some(Message { precision, pull })
    }
}
