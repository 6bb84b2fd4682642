//! The one score: how well a set of names predicts the tenths of a recording that it was not fitted to.
//!
//! `S = N/2 · ln(1 / mean square left out) - cost`, in nats. N is how many rows of what the best set leaves are independent: real
//! joints always leave something, and that, with its own correlation, is the yardstick; not the noise of a sensor.

use nalgebra::{DMatrix, DVector};

use super::laws::Law;

/// Parts of the recording that are left out in turn.
pub const PARTS: usize = 10;
/// Names of one joint at most.
const NAMES_MAX: usize = 4;
/// Cost of a name, in nats: odds of one to twenty against each of a dozen laws that is looked at.
const NAME_NATS: f64 = 3.0;
/// What Coulomb and viscous friction cost less where the file states no friction at all, in nats: every joint rubs, and it is the odds
/// of a cause nobody expects that a name costs.
const EXPECTED_NATS: f64 = 2.0;
/// Cost of a freedom, in nats.
const FREEDOM_NATS: f64 = 0.5;
/// Cost of each amplitude after the first, in nats.
const AMPLITUDE_NATS: f64 = 1.5;
/// Correlation below which rows count as independent.
const INDEPENDENT: f64 = 0.05;
/// Rows that are independent at least.
const ROWS_LEAST: f64 = 10.0;
/// Standard errors by which a value may pass a limit that no joint passes.
const ERRORS: f64 = 2.0;
/// Sets that fall behind the best by more nats than this have no weight: e⁻¹².
const BEHIND: f64 = 12.0;
/// Keeps a matrix from being singular where two columns are alike, relative to a column's square.
const ALIKE: f64 = 1e-9;

/// Columns of one set of names, as a bit each in the order of the laws.
pub type Names = u32;

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
    /// Laws with their columns.
    pub laws: &'a [(Law, Vec<Vec<f64>>)],
    /// Whether friction is missing in the file, and so expected.
    pub expects_friction: bool,
    /// Columns with a standard deviation of one.
    pub tolerated: &'a [Vec<f64>],
    /// Columns of a smooth law on no list, which may stand for names. They are one more place behind the laws.
    pub smooth: &'a [Vec<f64>],
    /// A shared cause's columns, with what the other joints say of them.
    pub shared: Option<(&'a [Vec<f64>], &'a Message)>,
}

/// The sums of squares of a problem, part by part.
pub struct Evidence {
    laws: Vec<Law>,
    /// Columns of each law.
    own: Vec<std::ops::Range<usize>>,
    /// Scale of each column; laws first, then those in every set.
    scale: Vec<f64>,
    law_columns: usize,
    expects_friction: bool,
    columns: Vec<Vec<f64>>,
    gap_nm: Vec<f64>,
    parts: Vec<Sums>,
    shared: Option<Message>,
    shared_columns: usize,
    /// Of the residual that decides.
    pub independent_rows: f64,
    variance: f64,
    reduced: Vec<Reduced>,
    whole: Reduced,
}

#[derive(Clone)]
struct Sums {
    gram: DMatrix<f64>,
    vector: DVector<f64>,
    square: f64,
    rows: f64,
}

/// A part left out, with the columns that are in every set eliminated.
struct Reduced {
    train: DMatrix<f64>,
    train_vector: DVector<f64>,
    test: DMatrix<f64>,
    test_vector: DVector<f64>,
    test_square: f64,
    /// Columns in every set: their values without laws, and per value of each law's column.
    rest: DVector<f64>,
    per_law: DMatrix<f64>,
}

/// A set of names with its score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scored {
    /// The set.
    pub names: Names,
    /// In nats.
    pub score: f64,
    /// Sum of squares left out, part by part, over all rows.
    pub left: [f64; PARTS],
}

/// Values of a set fitted to all rows.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Amplitudes of each law of the set, in the laws' order.
    pub amplitudes: Vec<(Law, Vec<f64>)>,
    /// Covariance of all amplitudes in that order.
    pub covariance: DMatrix<f64>,
    /// What the set predicts of the gap.
    pub predicted_nm: Vec<f64>,
}

impl Evidence {
    /// Of a problem; the rows' correlation is found with it.
    pub fn of(problem: &Problem<'_>) -> Self {
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut own = Vec::new();
        for (_, of_law) in problem.laws {
            own.push(columns.len()..columns.len() + of_law.len());
            columns.extend(of_law.iter().cloned());
        }
        if !problem.smooth.is_empty() {
            own.push(columns.len()..columns.len() + problem.smooth.len());
            columns.extend(problem.smooth.iter().cloned());
        }
        let law_columns = columns.len();
        let rms = |column: &Vec<f64>| {
            let square = column.iter().map(|x| x * x).sum::<f64>() / column.len().max(1) as f64;
            square.sqrt() + 1e-30
        };
        let mut scale: Vec<f64> = columns.iter().map(rms).collect();
        for (column, scale) in columns.iter_mut().zip(&scale) {
            column.iter_mut().for_each(|x| *x /= scale);
        }
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
        let parts = parts(&columns, problem.gap_nm);
        let variance =
            problem.gap_nm.iter().map(|x| x * x).sum::<f64>() / problem.gap_nm.len().max(1) as f64;
        let mut evidence = Self {
            laws: problem.laws.iter().map(|(law, _)| *law).collect(),
            own,
            scale,
            law_columns,
            expects_friction: problem.expects_friction,
            columns,
            gap_nm: problem.gap_nm.to_vec(),
            parts,
            shared,
            shared_columns,
            independent_rows: ROWS_LEAST,
            // a tenth is left: the order of what real joints leave, before it is known
            variance: 0.1 * variance,
            reduced: Vec::new(),
            whole: Reduced::empty(),
        };
        evidence.settle();
        evidence
    }

    fn rows(&self) -> f64 {
        self.gap_nm.len().max(1) as f64
    }

    /// The laws, in the order of a set's bits.
    pub fn laws(&self) -> &[Law] {
        &self.laws
    }

    /// Finds how many rows are independent: by what the best set leaves, which depends on how much the file's values may give, which
    /// depends on that.
    fn settle(&mut self) {
        /// Rounds until the number of independent rows stays, on all of the development robots.
        const ROUNDS: usize = 2;
        for _ in 0..ROUNDS {
            self.eliminate();
            let best = self
                .sets()
                .into_iter()
                .map(|names| (names, self.left(names).iter().sum::<f64>()))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((names, left)) = best else { return };
            let fit = self.fit(names);
            let rest: Vec<f64> = self
                .gap_nm
                .iter()
                .zip(&fit.predicted_nm)
                .map(|(gap, predicted)| gap - predicted)
                .collect();
            self.independent_rows = independent_rows(&rest);
            self.variance = (left / self.rows()).max(f64::MIN_POSITIVE);
        }
        self.eliminate();
    }

    /// Precision of one row: what a sum of squares is worth.
    fn row_precision(&self) -> f64 {
        self.independent_rows / self.rows() / self.variance
    }

    fn eliminate(&mut self) {
        let total = self.parts.iter().skip(1).fold(
            self.parts.first().cloned().unwrap_or_else(Sums::empty),
            |sum, part| sum.plus(part, 1.0),
        );
        let prior = self.prior();
        let lift = self.lift();
        self.whole = Reduced::of(&total, &total, &prior, &lift);
        self.reduced = self
            .parts
            .iter()
            .map(|part| Reduced::of(&total.plus(part, -1.0), part, &prior, &lift))
            .collect();
    }

    /// Prior of the laws' columns, in sums of squares: a law is as large as the gap, by one standard deviation, and no larger than is
    /// known of its kind. Two that are much larger and cancel each other are no cause of it.
    fn lift(&self) -> Vec<f64> {
        let square: f64 = self.parts.iter().map(|part| part.square).sum();
        let gap = (square / self.rows()).max(f64::MIN_POSITIVE);
        let worth = self.row_precision();
        let mut lift = vec![1.0 / (worth * gap) + ALIKE * self.rows(); self.law_columns];
        for (law, own) in self.laws.iter().zip(&self.own) {
            if let Some(deviation) = law.deviation() {
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

    /// Every set of at most so many names, no name twice.
    fn sets(&self) -> Vec<Names> {
        let mut all = vec![0];
        let mut of_size = vec![(0_u32, 0_u32, 0_usize)];
        for _ in 0..NAMES_MAX {
            let mut larger = Vec::new();
            for &(names, kinds, from) in &of_size {
                for (index, law) in self.laws.iter().enumerate().skip(from) {
                    let kind = 1 << law.kind();
                    if kinds & kind == 0 {
                        larger.push((names | 1 << index, kinds | kind, index + 1));
                    }
                }
            }
            all.extend(larger.iter().map(|set| set.0));
            of_size = larger;
        }
        all
    }

    fn places(&self, names: Names) -> Vec<usize> {
        let laws = self.own.iter().enumerate();
        laws.filter(|(index, _)| names & (1 << index) != 0)
            .flat_map(|(_, own)| own.clone())
            .collect()
    }

    fn left(&self, names: Names) -> [f64; PARTS] {
        let places = self.places(names);
        let mut left = [0.0; PARTS];
        for (left, reduced) in left.iter_mut().zip(&self.reduced) {
            *left = reduced.left(&places);
        }
        left
    }

    /// Coulomb and viscous friction and an offset: what a joint may have whatever the arm shares.
    pub fn usual(&self) -> Names {
        let laws = self.laws.iter().enumerate();
        laws.filter(|(_, law)| law.is_usual())
            .fold(0, |names, (index, _)| names | 1 << index)
    }

    /// The smooth law's bit.
    pub fn smooth(&self) -> Names {
        1 << self.laws.len()
    }

    /// What a set costs.
    pub fn cost(&self, names: Names) -> f64 {
        let smooth = self.own.get(self.laws.len());
        let smooth = smooth.filter(|_| names & self.smooth() != 0);
        let smooth = smooth.map_or(0.0, |own| {
            NAME_NATS + AMPLITUDE_NATS * (own.len() - 1) as f64
        });
        let laws = self.laws.iter().enumerate();
        smooth
            + laws
                .filter(|(index, _)| names & (1 << index) != 0)
                .map(|(_, law)| {
                    let is_expected =
                        self.expects_friction && matches!(law, Law::Coulomb | Law::Viscous);
                    NAME_NATS - if is_expected { EXPECTED_NATS } else { 0.0 }
                        + FREEDOM_NATS * law.freedom()
                        + AMPLITUDE_NATS * (law.amplitudes() - 1) as f64
                })
                .sum::<f64>()
    }

    /// One set's score.
    pub fn scored(&self, names: Names) -> Scored {
        let left = self.left(names);
        let mean_square = (left.iter().sum::<f64>() / self.rows()).max(f64::MIN_POSITIVE);
        Scored {
            names,
            score: -0.5 * self.independent_rows * mean_square.ln() - self.cost(names),
            left,
        }
    }

    /// All sets that `is_possible` that are not far behind the best, the best first. There is always one: no name.
    pub fn best(&self, is_possible: impl Fn(&Fit) -> bool) -> Vec<Scored> {
        let mut all: Vec<Scored> = self
            .sets()
            .into_iter()
            .map(|names| self.scored(names))
            .collect();
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
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
        for (index, law) in self.laws.iter().enumerate() {
            if names & (1 << index) != 0 {
                let own = self.own[index].clone();
                let of_law = own
                    .enumerate()
                    .map(|(k, place)| values[at + k] / self.scale[place]);
                amplitudes.push((*law, of_law.collect::<Vec<f64>>()));
                at += law.amplitudes();
            }
        }
        let scales: Vec<f64> = places.iter().map(|place| self.scale[*place]).collect();
        let covariance = DMatrix::from_fn(places.len(), places.len(), |i, j| {
            inverse[(i, j)] / (scales[i] * scales[j])
        });
        Fit {
            amplitudes,
            covariance,
            predicted_nm,
        }
    }

    /// What this joint alone says of the shared cause's amplitudes beside a set of names; none without one.
    pub fn message(&self, names: Names) -> Option<Message> {
        let shared = self.shared.as_ref()?;
        let places = self.places(names);
        let total = self.parts.iter().skip(1).fold(
            self.parts.first().cloned().unwrap_or_else(Sums::empty),
            |sum, part| sum.plus(part, 1.0),
        );
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
        let lift = self.lift();
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

    /// Whether a fit is one that a joint can have: every value within its limits, and friction that brakes at every speed; each by
    /// two standard errors.
    pub fn is_possible(
        fit: &Fit,
        limits: impl Fn(Law) -> [f64; 2],
        nominal_friction_nm: impl Fn(f64) -> f64,
        speed_rad_s: f64,
    ) -> bool {
        let mut place = 0;
        let mut braking = Vec::new();
        for (law, amplitudes) in &fit.amplitudes {
            let [least, most] = limits(*law);
            let error = ERRORS * fit.covariance[(place, place)].max(0.0).sqrt();
            let Some(value) = amplitudes.first() else {
                continue;
            };
            // a range is one of what can be meant, and a single limit is passed by noise
            let error = if least.is_finite() && most.is_finite() {
                0.0
            } else {
                error
            };
            if value + error < least || value - error > most {
                return false;
            }
            braking.push((place, *law, *value));
            place += amplitudes.len();
        }
        braking.retain(|(_, law, _)| law.friction_nm(1.0).is_some());
        if braking.is_empty() {
            return true;
        }
        /// Speeds at which friction is looked at.
        const SPEEDS: usize = 25;
        (1..=SPEEDS).all(|k| {
            let v = speed_rad_s * k as f64 / SPEEDS as f64;
            let at = |law: Law| law.friction_nm(v).unwrap_or(0.0);
            let added: f64 = braking.iter().map(|(_, law, value)| value * at(*law)).sum();
            let mut variance = 0.0;
            for (i, one, _) in &braking {
                for (j, other, _) in &braking {
                    variance += at(*one) * fit.covariance[(*i, *j)] * at(*other);
                }
            }
            nominal_friction_nm(v) + added + ERRORS * variance.max(0.0).sqrt() >= 0.0
        })
    }
}

impl Sums {
    fn empty() -> Self {
        Self {
            gram: DMatrix::zeros(0, 0),
            vector: DVector::zeros(0),
            square: 0.0,
            rows: 0.0,
        }
    }

    fn plus(&self, other: &Self, factor: f64) -> Self {
        Self {
            gram: &self.gram + &other.gram * factor,
            vector: &self.vector + &other.vector * factor,
            square: self.square + factor * other.square,
            rows: self.rows + factor * other.rows,
        }
    }
}

/// Sums over tenths of the rows, one after the other.
fn parts(columns: &[Vec<f64>], gap_nm: &[f64]) -> Vec<Sums> {
    let rows = gap_nm.len();
    (0..PARTS)
        .map(|part| {
            let within = part * rows / PARTS..(part + 1) * rows / PARTS;
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

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Reduced {
    fn empty() -> Self {
        Self {
            train: DMatrix::zeros(0, 0),
            train_vector: DVector::zeros(0),
            test: DMatrix::zeros(0, 0),
            test_vector: DVector::zeros(0),
            test_square: 0.0,
            rest: DVector::zeros(0),
            per_law: DMatrix::zeros(0, 0),
        }
    }

    fn of(
        train: &Sums,
        test: &Sums,
        (prior, pull): &(DMatrix<f64>, DVector<f64>),
        lift: &[f64],
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
        if beside > 0
            && let Some(solved) = (tt + prior).cholesky()
        {
            rest = solved.solve(&(&bt + pull));
            per_law = solved.solve(&tl);
        }
        let mut lifted = &ll - tl.transpose() * &per_law;
        for (k, lift) in lift.iter().enumerate() {
            lifted[(k, k)] += lift;
        }
        let train_vector = &bl - tl.transpose() * &rest;
        let (ll, tl, tt, bl, bt) = block(test);
        let cross = tl.transpose() * &per_law;
        let test_gram = &ll - &cross - cross.transpose() + per_law.transpose() * &tt * &per_law;
        let inner = &tl - &tt * &per_law;
        let test_vector = &bl - per_law.transpose() * &bt - inner.transpose() * &rest;
        Self {
            train: lifted,
            train_vector,
            test: test_gram,
            test_vector,
            test_square: test.square - 2.0 * rest.dot(&bt) + rest.dot(&(&tt * &rest)),
            rest,
            per_law,
        }
    }

    fn picked(&self, places: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        let count = places.len();
        (
            DMatrix::from_fn(count, count, |i, j| self.train[(places[i], places[j])]),
            DVector::from_iterator(count, places.iter().map(|k| self.train_vector[*k])),
        )
    }

    fn values(&self, places: &[usize]) -> DVector<f64> {
        let (matrix, vector) = self.picked(places);
        match matrix.cholesky() {
            Some(solved) => solved.solve(&vector),
            None => DVector::zeros(places.len()),
        }
    }

    fn inverse(&self, places: &[usize]) -> DMatrix<f64> {
        let count = places.len();
        let (matrix, _) = self.picked(places);
        matrix
            .cholesky()
            .map_or_else(|| DMatrix::zeros(count, count), |solved| solved.inverse())
    }

    fn rest_of(&self, places: &[usize], values: &DVector<f64>) -> DVector<f64> {
        let mut rest = self.rest.clone();
        for (place, value) in places.iter().zip(values.iter()) {
            rest.axpy(-*value, &self.per_law.column(*place), 1.0);
        }
        rest
    }

    fn left(&self, places: &[usize]) -> f64 {
        let values = self.values(places);
        let mut left = self.test_square;
        for (i, place) in places.iter().enumerate() {
            left -= 2.0 * values[i] * self.test_vector[*place];
            for (j, other) in places.iter().enumerate() {
                left += values[i] * self.test[(*place, *other)] * values[j];
            }
        }
        left.max(0.0)
    }
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
