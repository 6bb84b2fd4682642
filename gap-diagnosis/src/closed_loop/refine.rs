//! Models fitted by simulation: Gauss and Newton's steps over known values, amplitudes and shapes at once, judged by what the
//! simulation leaves.

use joint_twin::TwinError;
use joint_twin::signal::difference;
use nalgebra::{DMatrix, DVector};

use super::rows::{Compared, Step, own_columns};
use crate::closed_loop::search::{Model, Search, Term};
use crate::evidence::{DEVIATIONS, Settled};

/// Steps at most.
const STEPS: usize = 12;
/// Parts of a step that are tried, the first that takes something off is taken.
const PARTS: [f64; 4] = [1.0, 0.5, 0.2, 0.05];
/// Nats that a step must take off or promise, or it is the last: a tenth of what tells one set from another.
const STILL_NATS: f64 = 0.3;

/// A model with what it leaves.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The model.
    pub model: Model,
    /// Half of its squares and strain in units of what the best set left, in nats.
    pub nats: f64,
}

/// What a row of each signal is worth.
pub struct Worth {
    rows: Vec<f64>,
}

impl Worth {
    /// By what was left of each signal.
    pub fn of(compared: &Compared, settled: &[Settled]) -> Self {
        let mut rows = Vec::new();
        for (span, settled) in compared.spans.iter().zip(settled) {
            let count = span.rows.len();
            let worth = settled.independent_rows / count.max(1) as f64 / settled.variance;
            rows.extend(std::iter::repeat_n(worth, count));
        }
        Self { rows }
    }

    fn product(&self, one: &[f64], other: &[f64]) -> f64 {
        let all = self.rows.iter().zip(one).zip(other);
        all.map(|((worth, a), b)| worth * a * b).sum()
    }

    fn nats(&self, model: &Model, left_nm: &[f64]) -> f64 {
        let known: f64 = model.known.iter().map(|k| k * k).sum();
        let terms = model.terms.iter().map(|term| {
            let plausible = term.hypothesis.plausible_steps();
            let amplitudes = term.amplitudes.iter();
            amplitudes.map(|a| (a / plausible).powi(2)).sum::<f64>()
        });
        0.5 * (self.product(left_nm, left_nm) + known + terms.sum::<f64>())
    }
}

/// The model that leaves least from a start on. `known`: responses to the known values, about a model that is not far; found anew where
/// no step keeps what it promises.
///
/// # Errors
/// [`TwinError`].
pub fn refined(
    search: &Search<'_>,
    compared: &Compared,
    worth: &Worth,
    known: &[Vec<f64>],
    start: &Model,
) -> Result<Refined, TwinError> {
    // what coarse substeps do is the same to all that are compared
    let to_reach_nm = {
        let fine = search.residual_nm(start)?;
        search.to_reach_nm(start, &fine)?
    };
    let coarse = |model: &Model| -> Result<(Vec<f64>, Vec<f64>), TwinError> {
        let base_nm = search.coarsely_nm(model)?;
        let left_nm = compared.pick(&difference(&to_reach_nm, &base_nm));
        Ok((base_nm, left_nm))
    };
    let mut model = start.clone();
    let (mut base_nm, mut left_nm) = coarse(&model)?;
    let mut nats = worth.nats(&model, &left_nm);
    let mut known = known.to_vec();
    let mut is_far = false;
    for _ in 0..STEPS {
        let mut columns = known.clone();
        for place in 0..model.terms.len() {
            columns.extend(own_columns(
                search,
                compared,
                &model,
                place,
                Step::Ahead(&base_nm),
            )?);
        }
        let Some((step, promised)) = step(worth, &columns, known.len(), &model, &left_nm) else {
            break;
        };
        let mut found = None;
        for part in PARTS {
            let tried = moved(search, &model, known.len(), &step, part);
            let (base, left) = coarse(&tried)?;
            let after = worth.nats(&tried, &left);
            if after < nats {
                found = Some((tried, base, left, after));
                break;
            }
        }
        let Some((tried, base, left, after)) = found else {
            if !is_far || promised < STILL_NATS {
                break;
            }
            // the known values respond otherwise by now
            let columns = search.known_columns(&base_nm, &model)?;
            known = columns.iter().map(|raw| compared.pick(raw)).collect();
            is_far = false;
            continue;
        };
        is_far = true;
        let gained = nats - after;
        (model, base_nm, left_nm, nats) = (tried, base, left, after);
        if gained < STILL_NATS {
            break;
        }
    }
    Ok(Refined { model, nats })
}

/// Gauss and Newton's step, and what it takes off, in nats, where responses are straight.
fn step(
    worth: &Worth,
    columns: &[Vec<f64>],
    known: usize,
    model: &Model,
    left_nm: &[f64],
) -> Option<(DVector<f64>, f64)> {
    let count = columns.len();
    let mut matrix = DMatrix::zeros(count, count);
    let mut vector = DVector::zeros(count);
    for i in 0..count {
        for j in 0..=i {
            let product = worth.product(&columns[i], &columns[j]);
            matrix[(i, j)] = product;
            matrix[(j, i)] = product;
        }
        vector[i] = worth.product(&columns[i], left_nm);
    }
    let priors = model.known.iter().take(known).map(|k| (1.0, *k));
    let priors = priors.chain(model.terms.iter().flat_map(of_values));
    for (i, (precision, value)) in priors.enumerate() {
        // keeps what does not show where it is
        matrix[(i, i)] += 1e-9 * matrix[(i, i)] + 1e-12 + precision;
        vector[i] -= precision * value;
    }
    let step = matrix.cholesky()?.solve(&vector);
    let promised = 0.5 * step.dot(&vector);
    Some((step, promised))
}

/// Prior precision and value of all that is fitted of a term: nothing is known of its shape.
fn of_values(term: &Term) -> Vec<(f64, f64)> {
    let precision = term.hypothesis.plausible_steps().powi(-2);
    let amplitudes = term.amplitudes.iter().map(|value| (precision, *value));
    let mut all: Vec<(f64, f64)> = if term.hypothesis.is_switch() {
        Vec::new()
    } else {
        amplitudes.collect()
    };
    all.resize(Search::values(&term.hypothesis), (0.0, 0.0));
    all
}

/// A model with part of a step, within what its values can be.
fn moved(
    search: &Search<'_>,
    model: &Model,
    known: usize,
    step: &DVector<f64>,
    part: f64,
) -> Model {
    let mut moved = model.clone();
    for (value, step) in moved.known.iter_mut().zip(step.iter()) {
        *value = (*value + part * step).clamp(-DEVIATIONS, DEVIATIONS);
    }
    for (value, of) in moved.known.iter_mut().zip(&search.twin.known) {
        if of.is_positive() {
            *value = value.max(0.0);
        }
    }
    let mut place = known;
    for term in &mut moved.terms {
        let values = Search::values(&term.hypothesis);
        let own: Vec<f64> = (place..place + values).map(|k| part * step[k]).collect();
        place += values;
        let mut stepped = search.stepped(term, &own);
        let lowest = stepped.hypothesis.lowest(&search.scale);
        for amplitude in &mut stepped.amplitudes {
            *amplitude = amplitude.max(lowest);
        }
        *term = stepped;
    }
    moved
}
