//! The one score: how well a set of names predicts the tenths of a recording that it was not fitted to.
//!
//! `S = Σ N/2 · ln(1 / (mean square left out + floor²)) - cost`, in nats, summed over the channels that are compared. N is how many
//! rows of what the best set leaves are independent: real joints always leave something, and that, with its own correlation, is the
//! yardstick; not the noise of a sensor. What lies below a channel's floor is nobody's. What the file's values are strained is half
//! the square of its standard deviations, in nats, by the prior that their tolerance is.

mod alike;
mod apart;
pub mod arm;
mod fit;
pub mod imitation;
pub mod place;
mod problem;
pub mod remaining;
pub mod rows;
mod search;
mod settled;
pub mod shares;
mod sums;
pub mod told;

use std::ops::Range;

pub use fit::Fit;
pub use joint_twin::known::LAW as INEXACT;
use nalgebra::{DMatrix, DVector};
pub use problem::{Item, Message, Presupposed, Problem, Smooth, Span};
use settled::ROWS_LEAST;
pub use settled::{Settled, independent_rows};
use sums::{Reduced, Sums, parts};

/// Parts of the recording that are left out in turn.
pub const PARTS: usize = 10;
/// Cost of a name, in nats: odds of one to twenty against each of a dozen laws that is looked at.
pub const NAME_NATS: f64 = 3.0;
/// Cost of each amplitude after the first, in nats.
pub const AMPLITUDE_NATS: f64 = 1.5;
/// Standard errors within which two values are one, and by which a value may pass a limit that no joint passes.
pub const ERRORS: f64 = 2.0;
/// Standard deviations beyond which a value is a finding.
pub const DEVIATIONS: f64 = 3.0;
/// Keeps a matrix from being singular where two columns are alike, relative to a column's square.
pub const ALIKE: f64 = 1e-9;

/// One set of names, as a bit each in the order of the items.
pub type Names = u128;
/// Items at most.
pub const ITEMS_MAX: usize = 128;

/// The sums of squares of a problem, part by part.
#[derive(Clone)]
pub struct Evidence {
    /// Of each item.
    kinds: Vec<usize>,
    /// Of each item and each smooth law.
    costs: Vec<f64>,
    presupposed: Vec<Presupposed>,
    deviations: Vec<Option<f64>>,
    usual: Names,
    /// Columns of each item.
    own: Vec<Range<usize>>,
    /// Scale of each column; laws first, then those in every set.
    scale: Vec<f64>,
    law_columns: usize,
    columns: Vec<Vec<f64>>,
    gap_nm: Vec<f64>,
    spans: Vec<Span>,
    /// Of each span, part by part.
    parts: Vec<Vec<Sums>>,
    inexact: f64,
    shared: Option<Message>,
    shared_columns: usize,
    is_open: bool,
    /// Of the residual that decides, span by span.
    settled: Vec<Settled>,
    /// Prior of the items' columns.
    lift: Vec<f64>,
    /// All parts but one.
    trains: Vec<Sums>,
    reduced: Vec<Reduced>,
    whole: Reduced,
}

/// A set of names with its score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scored {
    /// The set.
    pub names: Names,
    /// In nats.
    pub score: f64,
    /// Sum of squares left out, part by part, over all rows; of further signals in units of their floors, as large as the first's.
    pub left: [f64; PARTS],
}

impl Evidence {
    /// Of a problem; the rows' correlation is found with it.
    pub fn of(problem: &Problem<'_>) -> Self {
        let mut evidence = Self::begun(problem);
        evidence.settle();
        evidence
    }

    /// The same of some names alone, with smooth laws beside them, each one more place behind the items.
    pub fn with_smooth(&self, names: Names, smooth: &[Smooth]) -> Self {
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut scale = Vec::new();
        let mut own = Vec::new();
        for (item, places) in self.own.iter().enumerate() {
            let begin = columns.len();
            if names & (1 << item) != 0 {
                columns.extend(self.columns[places.clone()].iter().cloned());
                scale.extend_from_slice(&self.scale[places.clone()]);
            }
            own.push(begin..columns.len());
        }
        let mut costs = self.costs.clone();
        for law in smooth {
            let begin = columns.len();
            for column in &law.columns {
                let mut column = column.clone();
                scale.push(scaled(&mut column));
                columns.push(column);
            }
            own.push(begin..columns.len());
            costs.push(law.cost);
        }
        let law_columns = columns.len();
        columns.extend(self.columns[self.law_columns..].iter().cloned());
        scale.extend_from_slice(&self.scale[self.law_columns..]);
        let spans = self.spans.iter();
        let mut evidence = Self {
            kinds: self.kinds.clone(),
            costs,
            presupposed: self.presupposed.clone(),
            deviations: self.deviations.clone(),
            usual: self.usual,
            own,
            scale,
            law_columns,
            parts: spans
                .map(|span| parts(&columns, &self.gap_nm, &span.rows))
                .collect(),
            columns,
            gap_nm: self.gap_nm.clone(),
            spans: self.spans.clone(),
            inexact: self.inexact,
            shared: self.shared.clone(),
            shared_columns: self.shared_columns,
            is_open: self.is_open,
            settled: self.settled.clone(),
            lift: Vec::new(),
            trains: Vec::new(),
            reduced: Vec::new(),
            whole: Reduced::empty(),
        };
        evidence.eliminate();
        evidence
    }

    fn begun(problem: &Problem<'_>) -> Self {
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut own = Vec::new();
        for item in problem.items {
            own.push(columns.len()..columns.len() + item.columns.len());
            columns.extend(item.columns.iter().cloned());
        }
        let law_columns = columns.len();
        let mut scale: Vec<f64> = columns.iter_mut().map(|column| scaled(column)).collect();
        columns.extend(problem.tolerated.iter().cloned());
        scale.extend(problem.tolerated.iter().map(|_| 1.0));
        let mut shared = None;
        let mut shared_columns = 0;
        if let Some((of_shared, message)) = problem.shared {
            columns.extend(of_shared.iter().cloned());
            scale.extend(of_shared.iter().map(|_| 1.0));
            shared = Some(message.clone());
            shared_columns = of_shared.len();
        }
        let spans = problem.spans.iter();
        let begun = spans.clone().map(|span| {
            let gap_nm = &problem.gap_nm[span.rows.clone()];
            let square = gap_nm.iter().map(|x| x * x).sum::<f64>() / gap_nm.len().max(1) as f64;
            Settled {
                independent_rows: ROWS_LEAST,
                // a tenth is left: the order of what real joints leave, before it is known
                variance: (0.1 * square)
                    .max(span.floor_nm.powi(2))
                    .max(f64::MIN_POSITIVE),
                floor: span.floor_nm.powi(2),
            }
        });
        Self {
            kinds: problem.items.iter().map(|item| item.kind).collect(),
            costs: problem.items.iter().map(|item| item.cost).collect(),
            presupposed: problem.items.iter().map(|item| item.presupposed).collect(),
            deviations: problem.items.iter().map(|item| item.deviation).collect(),
            usual: (0..problem.items.len())
                .filter(|index| problem.items[*index].is_usual)
                .fold(0, |names, index| names | 1 << index),
            own,
            scale,
            law_columns,
            parts: spans
                .map(|span| parts(&columns, problem.gap_nm, &span.rows))
                .collect(),
            columns,
            gap_nm: problem.gap_nm.to_vec(),
            settled: begun.collect(),
            spans: problem.spans.to_vec(),
            inexact: problem.inexact,
            shared,
            shared_columns,
            is_open: problem.is_open,
            lift: Vec::new(),
            trains: Vec::new(),
            reduced: Vec::new(),
            whole: Reduced::empty(),
        }
    }

    /// What is explained, as it counts.
    pub fn gap_nm(&self) -> &[f64] {
        &self.gap_nm
    }

    /// What the best set leaves, signal by signal.
    pub fn settled(&self) -> &[Settled] {
        &self.settled
    }

    /// Rows that are as good as independent, of all signals.
    pub fn independent_rows(&self) -> f64 {
        self.settled.iter().map(|of| of.independent_rows).sum()
    }

    /// How many rows one row of a span counts for, beside a row of the first.
    fn relative(&self) -> Vec<f64> {
        let worth = |span: usize| {
            let of = self.settled[span];
            of.independent_rows / self.spans[span].rows.len().max(1) as f64 / of.variance
        };
        (0..self.spans.len())
            .map(|span| worth(span) / worth(0).max(f64::MIN_POSITIVE))
            .collect()
    }

    /// How many rows' squares one row of a span has, beside a row of the first, for shares of the gap's energy: each signal in units of
    /// its floor, as many rows of each.
    fn energies(&self) -> Vec<f64> {
        let first = &self.spans[0];
        let of_floor = |span: &Span| {
            let part = first.rows.len() as f64 / span.rows.len().max(1) as f64;
            part * (first.floor_nm / span.floor_nm).powi(2)
        };
        let spans = self.spans.iter().enumerate();
        spans
            .map(|(index, span)| if index == 0 { 1.0 } else { of_floor(span) })
            .collect()
    }

    /// Precision of one row of the first signal: what a sum of squares is worth.
    fn row_precision(&self) -> f64 {
        let of = self.settled[0];
        of.independent_rows / self.spans[0].rows.len().max(1) as f64 / of.variance
    }

    fn total(&self) -> Sums {
        let mut total = Sums::zero(self.columns.len());
        for (of_span, factor) in self.parts.iter().zip(self.relative()) {
            for part in of_span {
                total.add(part, factor);
            }
        }
        total
    }

    fn eliminate(&mut self) {
        let total = self.total();
        let relative = self.relative();
        let prior = self.prior();
        let open = if self.is_open {
            prior.1.len() - self.shared_columns
        } else {
            0
        };
        self.lift = self.lift();
        let lift = &self.lift;
        self.whole = Reduced::of(&total, &[], &prior, lift, open);
        self.trains = (0..PARTS)
            .map(|part| {
                let mut train = total.clone();
                for (of_span, factor) in self.parts.iter().zip(&relative) {
                    train.add(&of_span[part], -factor);
                }
                train
            })
            .collect();
        self.reduced = (0..PARTS)
            .map(|part| {
                let of_part = self.parts.iter().map(|of_span| &of_span[part]);
                let tests: Vec<(&Sums, f64)> = of_part.zip(relative.iter().copied()).collect();
                Reduced::of(&self.trains[part], &tests, &prior, lift, open)
            })
            .collect();
    }

    /// Prior of the items' columns, in sums of squares: each is as large as the gap, by one standard deviation, and no larger than is
    /// known of its kind. Two that are much larger and cancel each other are no cause of it.
    fn lift(&self) -> Vec<f64> {
        let total = self.total();
        let gap = total.square.max(f64::MIN_POSITIVE);
        let worth = self.row_precision();
        let of_column = |place: usize| total.gram[(place, place)] * (1.0 / (worth * gap) + ALIKE);
        let mut lift: Vec<f64> = (0..self.law_columns).map(of_column).collect();
        for (deviation, own) in self.deviations.iter().zip(&self.own) {
            if let Some(deviation) = deviation {
                for place in own.clone() {
                    lift[place] += (worth * (deviation * self.scale[place]).powi(2)).recip();
                }
            }
        }
        lift
    }

    /// Prior of the columns that are in every set, in sums of squares.
    fn prior(&self) -> (DMatrix<f64>, DVector<f64>) {
        let count = self.columns.len() - self.law_columns;
        let worth = self.row_precision();
        let mut matrix = DMatrix::identity(count, count) / worth;
        let mut vector = DVector::zeros(count);
        if let Some(message) = &self.shared {
            let from = count - self.shared_columns;
            for i in 0..self.shared_columns {
                vector[from + i] = message.pull[i] / worth;
                for j in 0..self.shared_columns {
                    matrix[(from + i, from + j)] = message.precision[(i, j)] / worth;
                }
            }
        }
        (matrix, vector)
    }

    fn places(&self, names: Names) -> Vec<usize> {
        let laws = self.own.iter().enumerate();
        laws.filter(|(index, _)| names & (1 << index) != 0)
            .flat_map(|(_, own)| own.clone())
            .collect()
    }

    /// Sums of squares left out, part by part and span by span.
    fn left(&self, names: Names) -> [Vec<f64>; PARTS] {
        self.left_with(&self.places(names), &[])
    }

    /// The same of columns beside others that are held.
    fn left_with(&self, places: &[usize], held: &[(usize, f64)]) -> [Vec<f64>; PARTS] {
        std::array::from_fn(|part| self.reduced[part].left(places, held))
    }

    /// What every joint may have, whatever the arm shares.
    pub fn usual(&self) -> Names {
        self.usual
    }

    /// Each smooth law's bit.
    pub fn smooth(&self) -> impl Iterator<Item = Names> {
        (self.kinds.len()..self.own.len()).map(|place| 1 << place)
    }

    /// What a set costs.
    pub fn cost(&self, names: Names) -> f64 {
        let is_named = |place: usize| names & (1 << place) != 0;
        let costs = self.costs.iter().enumerate();
        let own = costs.filter(|(place, _)| is_named(*place));
        let presupposed = self.presupposed.iter().enumerate();
        let missing = presupposed.filter(|(place, _)| is_named(*place));
        let missing = missing.map(|(_, of)| f64::from((of.names & !names).count_ones()) * of.nats);
        own.map(|(_, cost)| cost).sum::<f64>() + missing.sum::<f64>()
    }

    /// One set's score.
    pub fn scored(&self, names: Names) -> Scored {
        joint_twin::stop::look();
        let by_part = self.left(names);
        let mut score = -self.cost(names) - 0.5 * self.strain(names);
        let mut left = [0.0; PARTS];
        let spans = self.spans.iter().zip(&self.settled).zip(self.energies());
        for (index, ((span, settled), factor)) in spans.enumerate() {
            let mut square = 0.0;
            for (left, part) in left.iter_mut().zip(&by_part) {
                *left += factor * part[index];
                square += part[index];
            }
            let mean = square / span.rows.len().max(1) as f64 + settled.floor;
            score -= 0.5 * settled.independent_rows * mean.max(f64::MIN_POSITIVE).ln();
        }
        Scored { names, score, left }
    }

    /// Squares of the standard deviations by which the file's values are off beside a set, and of those that its amplitudes are: two that
    /// cancel each other are large.
    fn strain(&self, names: Names) -> f64 {
        let places = self.places(names);
        let values = self.whole.values(&places);
        let own = places.iter().zip(values.iter());
        let of_laws = own.map(|(place, value)| self.lift[*place] * value.powi(2));
        let of_laws = self.row_precision() * of_laws.sum::<f64>();
        self.strains(names).iter().sum::<f64>() + of_laws
    }

    /// What a set costs with its strain, but for that of links, and that of links. `is_of_links`: of the file's values, by their places.
    pub fn cost_and_strain(&self, names: Names, is_of_links: impl Fn(usize) -> bool) -> [f64; 2] {
        let strains = self.strains(names).into_iter().enumerate();
        let of_links = strains.filter(|(place, _)| is_of_links(*place));
        let of_links = 0.5 * of_links.map(|(_, strain)| strain).sum::<f64>();
        let own = self.cost(names) + 0.5 * self.strain(names) - of_links;
        [own, of_links]
    }

    /// Square of the standard deviations by which each of the file's values is off beside a set.
    fn strains(&self, names: Names) -> Vec<f64> {
        let tolerated = self.columns.len() - self.law_columns - self.shared_columns;
        let mut values = self.values_beside(names);
        values.truncate(tolerated);
        values.into_iter().map(|value| value * value).collect()
    }

    /// Sum of a column's squares, in the units of [`Scored::left`].
    pub fn square(&self, column: &[f64]) -> f64 {
        let spans = self.spans.iter().zip(self.energies());
        spans
            .map(|(span, factor)| {
                let own = column[span.rows.clone()].iter();
                factor * own.map(|x| x * x).sum::<f64>()
            })
            .sum()
    }

    /// Mean square that a set leaves out of each signal.
    pub fn mean_squares(&self, names: Names) -> Vec<f64> {
        let by_part = self.left(names);
        let spans = self.spans.iter().enumerate();
        spans
            .map(|(index, span)| {
                let square: f64 = by_part.iter().map(|part| part[index]).sum();
                square / span.rows.len().max(1) as f64
            })
            .collect()
    }

    /// Sum of squares that the floors make up of what a set leaves, in the units of [`Scored::left`].
    pub fn floor_square(&self, names: Names) -> f64 {
        let left = self.mean_squares(names);
        let spans = self.spans.iter().zip(&self.settled).zip(self.energies());
        spans
            .zip(left)
            .map(|(((span, settled), factor), left)| {
                factor * span.rows.len() as f64 * settled.floor.min(left)
            })
            .sum()
    }
}

/// Lets a column's mean square be one, and tells what its root was.
fn scaled(column: &mut [f64]) -> f64 {
    let square = column.iter().map(|x| x * x).sum::<f64>() / column.len().max(1) as f64;
    let scale = square.sqrt() + 1e-30;
    column.iter_mut().for_each(|x| *x /= scale);
    scale
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 600;

    fn noise(seed: u64) -> Vec<f64> {
        let mut random = joint_twin::signal::random::uniform(seed);
        (0..ROWS).map(|_| random() - 0.5).collect()
    }

    fn item(kind: usize, columns: &[Vec<f64>]) -> Item<'_> {
        Item {
            kind,
            cost: NAME_NATS,
            presupposed: Presupposed::NOTHING,
            deviation: None,
            is_usual: false,
            columns,
        }
    }

    fn span(rows: Range<usize>, floor_nm: f64) -> Span {
        Span { rows, floor_nm }
    }

    fn evidence(
        gap_nm: &[f64],
        spans: &[Span],
        items: &[Item<'_>],
        known: &[Vec<f64>],
    ) -> Evidence {
        Evidence::of(&Problem {
            gap_nm,
            spans,
            items,
            tolerated: known,
            is_open: true,
            inexact: 0.0,
            shared: None,
        })
    }

    fn sum(a: &[f64], b: &[f64], factor: f64) -> Vec<f64> {
        a.iter().zip(b).map(|(a, b)| a + factor * b).collect()
    }

    #[test]
    fn what_a_floor_covers_is_not_worth_a_name() {
        let [column, rest] = [noise(1), noise(2)];
        let gap_nm = sum(&rest, &column, 1.0);
        let columns = [column];
        let best = |floor_nm: f64| {
            let of = evidence(
                &gap_nm,
                &[span(0..ROWS, floor_nm)],
                &[item(0, &columns)],
                &[],
            );
            of.best(|_| true)[0].names
        };
        assert_eq!(best(0.0), 1);
        assert_eq!(best(10.0), 0);
    }

    #[test]
    fn a_second_signal_tells_what_the_first_cannot() {
        // alike in the first half of the rows, which is one signal, and not in the second
        let one = noise(1);
        let other = [&one[..ROWS / 2], &noise(3)[ROWS / 2..]].concat();
        let gap_nm = sum(&noise(2), &one, 3.0);
        let columns = [[one], [other]];
        let items = [item(0, &columns[0]), item(1, &columns[1])];
        let spans = [span(0..ROWS / 2, 0.01), span(ROWS / 2..ROWS, 0.01)];
        let of = evidence(&gap_nm, &spans, &items, &[]);
        assert_eq!(of.best(|_| true)[0].names, 1);
        assert!(
            of.apart(1, 0, Some(1)) > 100.0,
            "{}",
            of.apart(1, 0, Some(1))
        );
        let blind = [span(0..ROWS / 2, 0.01)];
        let half = |column: &[Vec<f64>; 1]| [column[0][..ROWS / 2].to_vec()];
        let columns = columns.each_ref().map(half);
        let items = [item(0, &columns[0]), item(1, &columns[1])];
        let of = evidence(&gap_nm[..ROWS / 2], &blind, &items, &[]);
        assert!(of.apart(1, 0, Some(1)) < 1.0, "{}", of.apart(1, 0, Some(1)));
    }

    #[test]
    fn a_known_value_takes_what_its_tolerance_lets_it_and_a_name_the_rest() {
        let column = noise(1);
        let rest: Vec<f64> = noise(2).iter().map(|x| 0.01 * x).collect();
        let columns = [column.clone()];
        let best = |deviations: f64| {
            let gap_nm = sum(&rest, &column, deviations);
            let spans = [span(0..ROWS, 0.0)];
            let of = evidence(&gap_nm, &spans, &[item(0, &columns)], &columns);
            of.best(|_| true)[0].names
        };
        // half of two deviations' square is less than a name costs, of four it is more
        assert_eq!(best(2.0), 0);
        assert_eq!(best(4.0), 1);
    }

    #[test]
    fn what_one_tenth_alone_tells_of_a_known_value_is_no_error_of_a_law() {
        let law = noise(1);
        let only_once: Vec<f64> = (0..ROWS)
            .zip(noise(3))
            .map(|(k, x)| {
                if k / (ROWS / PARTS) == 4 {
                    40.0 * x
                } else {
                    0.0
                }
            })
            .collect();
        let gap_nm = sum(&sum(&noise(2), &law, 2.0), &only_once, 1.0);
        let columns = [law];
        let items = [item(0, &columns)];
        let of = evidence(&gap_nm, &[span(0..ROWS, 0.0)], &items, &[only_once]);
        let left = of.mean_squares(1)[0];
        assert!((left * 12.0 - 1.0).abs() < 0.2, "{left}");
    }

    #[test]
    fn what_would_pass_its_limit_is_held_there_and_the_others_are_fitted_beside_it() {
        let [one, noise] = [noise(1), noise(2)];
        // alike in part, so that holding one changes the other
        let other = sum(&noise, &one, 1.0);
        let gap_nm = sum(&one, &other, -0.4);
        let columns = [[one], [other]];
        let items = [item(0, &columns[0]), item(1, &columns[1])];
        let spans = [span(0..ROWS, 0.0)];
        let of = evidence(&gap_nm, &spans, &items, &[]);
        let (free, _) = of.fit_above(3, &[(0, -1.0), (1, -1.0)]).unwrap();
        assert!((free[0] - 1.0).abs() < 0.01 && (free[1] + 0.4).abs() < 0.01);
        let (held, left) = of.fit_above(3, &[(0, 0.0), (1, 0.0)]).unwrap();
        let alone = of.fit(1).amplitudes[0].1[0];
        assert_eq!(held, [alone, 0.0]);
        assert!((left - of.mean_squares(1)[0]).abs() < 1e-9 * left);
    }
}
