//! How far two names are apart: by how many nats one would be behind if the other were the truth.

use nalgebra::{DMatrix, DVector};

use super::sums::dot;
use super::{ALIKE, DEVIATIONS, Evidence, Names};

impl Evidence {
    /// Nats by which a set with another item, or with none, would stay behind if `names` were the truth: what `gone`'s part leaves where
    /// `come` takes its place and everything else gives way. Laws that differ by less than they are inexact are not apart.
    pub fn apart(&self, names: Names, gone: usize, come: Option<usize>) -> f64 {
        let whole = &self.whole;
        let all = self.places(names);
        let values = whole.values(&all);
        let own = self.places(1 << gone);
        let part: Vec<f64> = own
            .iter()
            .filter_map(|place| Some(values[all.iter().position(|other| other == place)?]))
            .collect();
        let come = come.map_or(0, |come| 1 << come);
        let others = self.places(names & !(1 << gone) | come);
        // how the part pulls on each column
        let pulled = |place: &usize| {
            let both = own.iter().zip(&part);
            both.map(|(own, value)| value * whole.train[(*place, *own)])
                .sum::<f64>()
        };
        let square: f64 = own
            .iter()
            .zip(&part)
            .map(|(own, value)| value * pulled(own))
            .sum();
        let pull = DVector::from_iterator(others.len(), others.iter().map(pulled));
        let taken = match whole.picked(&others).0.cholesky() {
            Some(solved) => pull.dot(&solved.solve(&pull)),
            None => 0.0,
        };
        let left = (square - taken).max(0.0);
        if left < self.inexact_part() * square {
            return 0.0;
        }
        0.5 * self.row_precision() * left
    }

    /// Part of what one item explains of a few waves that another would leave of it there; none if that one shows mostly elsewhere. Waves are
    /// over the rows of the first signal.
    pub fn apart_in(
        &self,
        waves: &[Vec<f64>],
        names: Names,
        gone: usize,
        come: usize,
    ) -> Option<f64> {
        let values = self.whole.values(&self.places(names));
        let all = self.places(names);
        let own = self.own[gone].clone();
        let mut part = vec![0.0; self.spans[0].rows.len()];
        for (place, value) in all.iter().zip(values.iter()) {
            if own.contains(place) {
                let column = &self.columns[*place];
                part.iter_mut()
                    .zip(column)
                    .for_each(|(sum, x)| *sum += value * x);
            }
        }
        let shown = |column: &[f64]| {
            let of_wave = waves.iter();
            let of_wave = of_wave.map(|wave| dot(column, wave) / dot(wave, wave).sqrt());
            DVector::from_iterator(waves.len(), of_wave)
        };
        let target = shown(&part);
        let columns = self.own[come].clone().map(|place| {
            let column = &self.columns[place][..part.len()];
            shown(column)
        });
        let columns: Vec<DVector<f64>> = columns.collect();
        let matrix = DMatrix::from_columns(&columns);
        let solved = matrix.clone().svd(true, true).solve(&target, ALIKE).ok()?;
        Some((&target - matrix * solved).norm_squared() / target.norm_squared())
    }

    /// Part of its square by which a law is not true, at most.
    pub fn inexact_part(&self) -> f64 {
        (DEVIATIONS * self.inexact).powi(2)
    }
}
