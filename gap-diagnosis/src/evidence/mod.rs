//! The one score: how well a set of names predicts the tenths of a recording that it was not fitted to.
//!
//! `S = Σ N/2 · ln(1 / (mean square left out + floor²)) - cost`, in nats, summed over the channels that are compared. N is how many
//! rows of what the best set leaves are independent: real joints always leave something, and that, with its own correlation, is the
//! yardstick; not the noise of a sensor. What lies below a channel's floor is nobody's. What the file's values are strained is half
//! the square of its standard deviations, in nats, by the prior that their tolerance is.

pub mod arm;
pub mod imitation;
pub mod remaining;
pub mod rows;
pub mod shares;
mod sums;
pub mod told;

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use sums::{Reduced, Sums, dot, parts};

/// Parts of the recording that are left out in turn.
pub const PARTS: usize = 10;
/// Names of one joint at most.
const NAMES_MAX: usize = 4;
/// Cost of a name, in nats: odds of one to twenty against each of a dozen laws that is looked at.
pub const NAME_NATS: f64 = 3.0;
/// Cost of each amplitude after the first, in nats.
pub const AMPLITUDE_NATS: f64 = 1.5;
/// Sets of one size that are made larger, the best first: all pairs of a dozen laws.
const GROWN: usize = 80;
/// Correlation below which rows count as independent.
const INDEPENDENT: f64 = 0.05;
/// Rows that are independent at least.
const ROWS_LEAST: f64 = 10.0;
/// Sets that fall behind the best by more nats than this have no weight: e⁻¹².
const BEHIND: f64 = 12.0;
/// Standard deviations of what a law is inexact by.
const TRUER: f64 = 3.0;
/// Part of its square that shows in a few waves for it to be one of them: more than half.
const MOSTLY: f64 = 0.5;
/// Keeps a matrix from being singular where two columns are alike, relative to a column's square.
const ALIKE: f64 = 1e-9;

/// One set of names, as a bit each in the order of the items.
pub type Names = u128;
/// Items at most.
pub const ITEMS_MAX: usize = 128;

/// Names without which another is less to be expected.
#[derive(Clone, Copy, Debug)]
pub struct Presupposed {
    /// Their items.
    pub names: Names,
    /// What each costs where it is missing, in nats.
    pub nats: f64,
}

impl Presupposed {
    /// No name.
    pub const NOTHING: Self = Self {
        names: 0,
        nats: 0.0,
    };
}

/// Something that may be named.
#[derive(Clone, Copy, Debug)]
pub struct Item<'a> {
    /// Items of one kind are one name with other shapes: a set holds one of them at most.
    pub kind: usize,
    /// What naming it costs, in nats.
    pub cost: f64,
    /// Without which it costs more.
    pub presupposed: Presupposed,
    /// Standard deviation of its amplitudes, where something is known of them before anything is seen.
    pub deviation: Option<f64>,
    /// Whether every joint may have it.
    pub is_usual: bool,
    /// A column for each amplitude.
    pub columns: &'a [Vec<f64>],
}

/// A smooth law on no list.
#[derive(Clone, Debug)]
pub struct Smooth {
    /// Whether it tells that something is left where no name is taken back for it.
    pub tells_rest: bool,
    /// What saying that there is one costs, in nats.
    pub cost: f64,
    /// It is a sum of these.
    pub columns: Vec<Vec<f64>>,
}

/// Rows of one compared signal, and what they hold whatever the model.
#[derive(Clone, Debug)]
pub struct Span {
    /// Where they are.
    pub rows: Range<usize>,
    /// Root mean square of what nobody can tell of them.
    pub floor_nm: f64,
}

/// What a shared cause's other joints say of its amplitudes: precision, and precision times mean, in the columns' own units.
#[derive(Clone, Debug)]
pub struct Message {
    /// Of all amplitudes.
    pub precision: DMatrix<f64>,
    /// Times their mean.
    pub pull: DVector<f64>,
}

/// Everything that is regressed: laws, and beside them columns that are in every set.
pub struct Problem<'a> {
    /// What is to be explained.
    pub gap_nm: &'a [f64],
    /// Signals, one after the other, together all rows.
    pub spans: &'a [Span],
    /// What may be named.
    pub items: &'a [Item<'a>],
    /// Columns with a standard deviation of one.
    pub tolerated: &'a [Vec<f64>],
    /// Part of what the names explain by which no law is exact.
    pub inexact: f64,
    /// A shared cause's columns, with what the other joints say of them.
    pub shared: Option<(&'a [Vec<f64>], &'a Message)>,
}

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
    /// Of the residual that decides, span by span.
    settled: Vec<Settled>,
    /// Prior of the items' columns.
    lift: Vec<f64>,
    /// All parts but one.
    trains: Vec<Sums>,
    reduced: Vec<Reduced>,
    whole: Reduced,
}

/// What the best set leaves of a signal.
#[derive(Clone, Copy, Debug)]
pub struct Settled {
    /// Rows that are as good as independent.
    pub independent_rows: f64,
    /// Mean square, the floor included.
    pub variance: f64,
    /// Mean square that is nobody's: the floor's, and what no law is exact by.
    pub floor: f64,
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
    /// Of a problem; the rows' correlation is found with it.
    pub fn of(problem: &Problem<'_>) -> Self {
        let mut evidence = Self::begun(problem);
        evidence.settle();
        evidence
    }

    /// Of a problem that is told beside another, by what that one's best set leaves.
    pub fn beside(problem: &Problem<'_>, other: &Self) -> Self {
        let mut evidence = Self::begun(problem);
        evidence.settled.clone_from(&other.settled);
        evidence.eliminate();
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

    /// Finds how many rows are independent: by what the best set leaves, which depends on how much the file's values may give, which
    /// depends on that.
    fn settle(&mut self) {
        /// Rounds until the number of independent rows stays, on all of the development robots.
        const ROUNDS: usize = 2;
        for _ in 0..ROUNDS {
            self.eliminate();
            let best = self.sets().into_iter().max_by(|a, b| {
                let fitted = |set: &Scored| set.score + self.cost(set.names);
                fitted(a).total_cmp(&fitted(b))
            });
            let Some(best) = best else { return };
            self.settle_by(best.names);
        }
        self.eliminate();
    }

    fn settle_by(&mut self, names: Names) {
        let fit = self.fit(names);
        let rest: Vec<f64> = self
            .gap_nm
            .iter()
            .zip(&fit.predicted_nm)
            .map(|(gap, predicted)| gap - predicted)
            .collect();
        let left = self.left(names);
        let without = self.left(0);
        self.settled = self
            .spans
            .iter()
            .enumerate()
            .map(|(index, span)| {
                let [mean, before] = [&left, &without].map(|of| {
                    let square: f64 = of.iter().map(|part| part[index]).sum();
                    square / span.rows.len().max(1) as f64
                });
                let inexact = self.inexact.powi(2) * (before - mean).max(0.0);
                let floor = span.floor_nm.powi(2) + inexact;
                Settled {
                    independent_rows: independent_rows(&rest[span.rows.clone()]),
                    variance: (mean + floor).max(f64::MIN_POSITIVE),
                    floor,
                }
            })
            .collect();
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
        self.lift = self.lift();
        let lift = &self.lift;
        self.whole = Reduced::of(&total, &[], &prior, lift);
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
                let tests: Vec<&Sums> = self.parts.iter().map(|of_span| &of_span[part]).collect();
                Reduced::of(&self.trains[part], &tests, &prior, lift)
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

    /// Sets of at most so many names, no name twice: none, singles and pairs, and what the best of each size make with one more.
    fn sets(&self) -> Vec<Scored> {
        let mut all = vec![self.scored(0)];
        let mut of_size: Vec<Names> = vec![0];
        for size in 1..=NAMES_MAX {
            let mut larger: Vec<Names> = Vec::new();
            for &names in &of_size {
                let held = |kind: usize| {
                    (0..self.kinds.len()).any(|k| names & 1 << k != 0 && self.kinds[k] == kind)
                };
                let more = (0..self.kinds.len()).filter(|index| !held(self.kinds[*index]));
                larger.extend(more.map(|index| names | 1 << index));
            }
            larger.sort_unstable();
            larger.dedup();
            let mut scored: Vec<Scored> =
                larger.into_iter().map(|names| self.scored(names)).collect();
            scored.sort_by(|a, b| b.score.total_cmp(&a.score));
            let kept = if size == 1 { scored.len() } else { GROWN };
            of_size = scored.iter().take(kept).map(|set| set.names).collect();
            all.extend(scored);
        }
        all
    }

    fn places(&self, names: Names) -> Vec<usize> {
        let laws = self.own.iter().enumerate();
        laws.filter(|(index, _)| names & (1 << index) != 0)
            .flat_map(|(_, own)| own.clone())
            .collect()
    }

    /// Sums of squares left out, part by part and span by span.
    fn left(&self, names: Names) -> [Vec<f64>; PARTS] {
        let places = self.places(names);
        std::array::from_fn(|part| self.reduced[part].left(&places))
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
        crate::stop::look();
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
            let shown = shown(column);
            (shown.norm_squared() > MOSTLY * dot(column, column)).then_some(shown)
        });
        let columns = columns.collect::<Option<Vec<_>>>()?;
        let matrix = DMatrix::from_columns(&columns);
        let solved = matrix.clone().svd(true, true).solve(&target, ALIKE).ok()?;
        Some((&target - matrix * solved).norm_squared() / target.norm_squared())
    }

    /// Part of its square by which a law is not true, at most.
    pub fn inexact_part(&self) -> f64 {
        (TRUER * self.inexact).powi(2)
    }

    /// Squares of the standard deviations by which the file's values are off beside a set, and of those that its amplitudes are: two that
    /// cancel each other are large.
    fn strain(&self, names: Names) -> f64 {
        let places = self.places(names);
        let values = self.whole.values(&places);
        let rest = self.whole.rest_of(&places, &values);
        let tolerated = self.columns.len() - self.law_columns - self.shared_columns;
        let own = places.iter().zip(values.iter());
        let of_laws = own.map(|(place, value)| self.lift[*place] * value.powi(2));
        let of_laws = self.row_precision() * of_laws.sum::<f64>();
        rest.rows(0, tolerated).norm_squared() + of_laws
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
            let spans = self.parts.iter().zip(self.energies());
            spans
                .map(|(of_span, factor)| factor * of_span[part].left_by(&all))
                .sum()
        })
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

    /// All sets that `is_possible` that are not far behind the best: first what is told, then the best first. There is always one: no name.
    /// It is what is told unless the odds against it are those that a name costs.
    pub fn best(&self, is_possible: impl Fn(&Fit) -> bool) -> Vec<Scored> {
        self.possible(self.ranked(), is_possible)
    }

    /// All sets, the best first, whether possible or not.
    pub fn ranked(&self) -> Vec<Scored> {
        let mut all = self.sets();
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        all
    }

    /// [`best`](Self::best) of all that are [`ranked`](Self::ranked).
    pub fn possible(&self, all: Vec<Scored>, is_possible: impl Fn(&Fit) -> bool) -> Vec<Scored> {
        let mut kept: Vec<Scored> = Vec::new();
        for scored in all {
            if let Some(best) = kept.first()
                && scored.score < best.score - BEHIND
            {
                break;
            }
            if scored.names == 0 || is_possible(&self.fit(scored.names)) {
                kept.push(scored);
            }
        }
        let best = kept[0].score;
        let weight = |set: &Scored| (set.score - best).exp();
        let all: f64 = kept.iter().map(weight).sum();
        let is_probable = |set: &Scored| weight(set) / all > (-NAME_NATS).exp();
        let none = kept.iter().position(|set| set.names == 0);
        if let Some(place) = none.filter(|place| is_probable(&kept[*place])) {
            let none = kept.remove(place);
            kept.insert(0, none);
        }
        kept
    }

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

    /// What this joint alone says of the shared cause's amplitudes beside a set of names; none without one.
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
        let worth = self.row_precision();
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
                worth * lift[place]
            } else {
                let at = place - self.law_columns;
                worth * prior[(at, at)]
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

/// Lets a column's mean square be one, and tells what its root was.
fn scaled(column: &mut [f64]) -> f64 {
    let square = column.iter().map(|x| x * x).sum::<f64>() / column.len().max(1) as f64;
    let scale = square.sqrt() + 1e-30;
    column.iter_mut().for_each(|x| *x /= scale);
    scale
}

/// Rows that are as good as independent, from the correlation of a signal with itself: `n / (1 + 2 Σ ρ)` up to where it dies away.
pub fn independent_rows(signal: &[f64]) -> f64 {
    let rows = signal.len();
    if rows < 2 {
        return ROWS_LEAST;
    }
    let mean = signal.iter().sum::<f64>() / rows as f64;
    let centred: Vec<f64> = signal.iter().map(|x| x - mean).collect();
    let square = dot(&centred, &centred).max(f64::MIN_POSITIVE);
    let mut sum = 1.0;
    for lag in 1..rows / 3 {
        let correlation = dot(&centred[..rows - lag], &centred[lag..]) / square;
        if correlation < INDEPENDENT {
            break;
        }
        sum += 2.0 * correlation;
    }
    (rows as f64 / sum).max(ROWS_LEAST)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 600;

    fn noise(seed: u64) -> Vec<f64> {
        let mut random = crate::signal::random::uniform(seed);
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
}
