//! Models fitted by simulation: Gauss-Newton steps over known values, amplitudes and shapes at once.

use joint_model::filter::FilterError;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::fit::{Blocks, Bound, block_of};
use crate::rank::Round;
use crate::search::{Model, PLAUSIBLE_STEPS, Search, difference};

/// The smallest part of a step that is tried.
const SHARE_MIN: f64 = 0.02;
/// Sizes that are tried before the first step, as parts of the linear response's.
const START_FACTORS: [f64; 5] = [0.3, 0.6, 1.0, 1.7, 3.0];
/// Sizes, in steps, that are tried where the linear response says that there is nothing: known values that stand in for an effect
/// leave none of it.
const START_SIZES: [f64; 4] = [3.0, 30.0, 100.0, 300.0];
/// Gauss-Newton steps.
const STEPS: usize = 8;

struct Step {
    coefficients: Vec<f64>,
    columns: Vec<Vec<f64>>,
    bounds: Vec<Bound>,
    prior_means: Vec<f64>,
}

/// What a joint tells of an effect that it shares with others.
pub(crate) struct OfSettled {
    /// Everything else refitted beside the effect as it is.
    pub refined: Refined,
    /// Information of the amplitudes.
    pub matrix: DMatrix<f64>,
    /// In steps of the amplitudes from where they are.
    pub vector: DVector<f64>,
}

/// A model fitted to all rows.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The model.
    pub model: Model,
    /// What it leaves.
    pub residual_nm: Vec<f64>,
    /// Responses to known values, then to every term's amplitudes and shape, in their steps.
    columns: Vec<Vec<f64>>,
    bounds: Vec<Bound>,
    prior_means: Vec<f64>,
}

impl Search<'_> {
    /// Fits known values, amplitudes and shapes of a model to all rows by Gauss-Newton steps.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn refine(&self, round: &Round, start: &Model) -> Result<Refined, FilterError> {
        let mut model = start.clone();
        model.known.resize(self.twin.known.len(), 0.0);
        let mut residual_nm = self.residual_nm(&model)?;
        let mut last = None;
        for _ in 0..STEPS {
            let step = self.step(round, &model, &residual_nm)?;
            let before = self.objective(&model, &residual_nm);
            let mut share = 1.0;
            let better = loop {
                let next = self.moved(&model, &step, share);
                let left = self.residual_nm(&next)?;
                let after = self.objective(&next, &left);
                if after < before {
                    break Some((next, left, 1.0 - after / before));
                }
                share *= 0.4;
                if share < SHARE_MIN {
                    break None;
                }
            };
            last = Some(step);
            let Some((next, left, gain)) = better else {
                break;
            };
            model = next;
            residual_nm = left;
            if gain < 1e-4 {
                break;
            }
        }
        let (columns, bounds, prior_means) = last.map_or_else(Default::default, |step: Step| {
            (step.columns, step.bounds, step.prior_means)
        });
        Ok(Refined {
            model,
            residual_nm,
            columns,
            bounds,
            prior_means,
        })
    }

    /// Refits a model but for what is settled, and finds what the joint then tells of the amplitudes of the effect that was settled last.
    ///
    /// # Errors
    /// [`FilterError`].
    pub(crate) fn told_of_settled(
        &self,
        round: &Round,
        model: &Model,
    ) -> Result<OfSettled, FilterError> {
        let refined = self.refine(round, model)?;
        let base = self.twin.coarsely(&refined.model.changes(&self.scale))?;
        let mut columns = round.linear.known.clone();
        let mut bounds = self.bounds();
        let mut prior_means: Vec<f64> = refined.model.known.iter().map(|z| -z).collect();
        let known: Vec<usize> = (0..columns.len()).collect();
        let amplitudes = refined
            .model
            .settled
            .last()
            .map_or(0, |t| t.amplitudes.len());
        for index in 0..amplitudes {
            let mut probe = refined.model.clone();
            if let Some(last) = probe.settled.last_mut() {
                last.amplitudes[index] += 1.0;
            }
            let response = self.twin.coarsely(&probe.changes(&self.scale))?;
            columns.push(difference(&response, &base));
            bounds.push(Bound::FREE);
            prior_means.push(0.0);
        }
        let chosen: Vec<usize> = (known.len()..columns.len()).collect();
        let blocks = self.blocks(&columns, &refined.residual_nm, &bounds, &prior_means);
        let (matrix, vector) = blocks.information(&known, &chosen);
        Ok(OfSettled {
            refined,
            matrix,
            vector,
        })
    }

    /// A model whose last effect has the size, of some, that leaves least, with its known values or with the file's: a
    /// strong effect does not respond in proportion, and known values that were fitted without it stand in for it.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn nearer(&self, model: Model) -> Result<Model, FilterError> {
        let mut starts = Vec::new();
        for known in [model.known.clone(), vec![0.0; self.twin.known.len()]] {
            let last = model.terms.last();
            let fitted = last.map_or(&[][..], |last| &last.amplitudes[..]);
            let sizes: Vec<Vec<f64>> = if fitted.iter().all(|a| *a == 0.0) {
                START_SIZES.map(|size| vec![size; fitted.len()]).into()
            } else {
                START_FACTORS
                    .map(|factor| fitted.iter().map(|a| factor * a).collect())
                    .into()
            };
            for amplitudes in sizes {
                let mut start = model.clone();
                start.known.clone_from(&known);
                if let Some(last) = start.terms.last_mut() {
                    last.amplitudes = amplitudes;
                }
                starts.push(start);
            }
        }
        let left = starts
            .par_iter()
            .map(|start| {
                let left = self.objective(start, &self.coarse_residual_nm(start)?);
                // a joint may run away in simulation
                Ok(if left.is_nan() { f64::INFINITY } else { left })
            })
            .collect::<Result<Vec<f64>, FilterError>>()?;
        let best = (0..starts.len()).min_by(|a, b| left[*a].total_cmp(&left[*b]));
        Ok(best.map_or(model, |best| starts.swap_remove(best)))
    }

    fn step(&self, round: &Round, model: &Model, residual_nm: &[f64]) -> Result<Step, FilterError> {
        let base = self.twin.coarsely(&model.changes(&self.scale))?;
        let mut probes: Vec<Model> = Vec::new();
        let mut bounds = self.bounds();
        for (k, bound) in bounds.iter_mut().enumerate() {
            bound.range = bound.range.map(|limit| limit - model.known[k]);
        }
        // the prior is about the file's values, not about the model's
        let mut prior_means: Vec<f64> = model.known.iter().map(|z| -z).collect();
        for (t, term) in model.terms.iter().enumerate() {
            for a in 0..term.amplitudes.len() {
                if term.hypothesis.is_switch() {
                    continue;
                }
                let mut probe = model.clone();
                probe.terms[t].amplitudes[a] += 1.0;
                probes.push(probe);
                let low = term.hypothesis.lowest(&self.scale);
                bounds.push(Bound {
                    range: [low - term.amplitudes[a], f64::INFINITY],
                    precision: PLAUSIBLE_STEPS.powi(-2),
                });
                prior_means.push(-term.amplitudes[a]);
            }
            if term.hypothesis.shape_is_free() {
                let shape = term.hypothesis.shape[0];
                let range = term.hypothesis.shape_range(&self.scale);
                let mut probe = model.clone();
                let factor = 1.0 + term.hypothesis.shape_step(&self.scale);
                probe.terms[t].hypothesis = term.hypothesis.shaped(&[shape * factor]);
                probes.push(probe);
                let unit = factor.ln();
                bounds.push(Bound {
                    range: [
                        ((range[0] / shape).ln() / unit).max(-6.0),
                        ((range[1] / shape).ln() / unit).min(6.0),
                    ],
                    precision: 0.02,
                });
                prior_means.push(0.0);
            }
        }
        let mut columns = round.linear.known.clone();
        columns.extend(
            probes
                .par_iter()
                .map(|probe| {
                    let response = self.twin.coarsely(&probe.changes(&self.scale))?;
                    Ok(difference(&response, &base))
                })
                .collect::<Result<Vec<_>, FilterError>>()?,
        );
        let blocks = self.blocks(&columns, residual_nm, &bounds, &prior_means);
        let all: Vec<usize> = (0..columns.len()).collect();
        Ok(Step {
            coefficients: blocks.fit(&all).coefficients,
            columns,
            bounds,
            prior_means,
        })
    }

    /// A regression of raw columns.
    pub(crate) fn blocks(
        &self,
        columns: &[Vec<f64>],
        residual_nm: &[f64],
        bounds: &[Bound],
        prior_means: &[f64],
    ) -> Blocks {
        let white: Vec<Vec<f64>> = columns
            .par_iter()
            .map(|column| self.whitener.apply(column))
            .collect();
        let target = self.whitener.apply(residual_nm);
        Blocks::new(&white, &target, bounds.to_vec(), &self.twin.rows).with_prior_means(prior_means)
    }

    /// What a refined model leaves of every block when it is fitted to the other blocks only, raw; and the covariance of
    /// its values, in steps.
    pub fn held_out(&self, refined: &Refined) -> (Vec<f64>, DMatrix<f64>) {
        let mut left = refined.residual_nm.clone();
        if refined.columns.is_empty() {
            return (left, DMatrix::zeros(0, 0));
        }
        let (blocks, covariance) = self.covariance(refined);
        let all: Vec<usize> = (0..refined.columns.len()).collect();
        let block_of = block_of(&self.twin.rows);
        let folds = blocks.folds(&all);
        for (k, value) in left.iter_mut().enumerate() {
            let steps = &folds[block_of[k]];
            let column = refined.columns.iter().zip(steps);
            *value -= column.map(|(column, step)| step * column[k]).sum::<f64>();
        }
        (left, covariance)
    }

    /// Squared size of the last effect of a refined model in units of its covariance, which comes from the scatter between
    /// blocks of time. None for an effect without a size.
    pub fn certainty(&self, refined: &Refined) -> Option<f64> {
        let last = refined.model.terms.last()?;
        let values = Self::values(&last.hypothesis);
        let sizes = values - usize::from(last.hypothesis.shape_is_free());
        if sizes == 0 || refined.columns.len() < values {
            return None;
        }
        let (_, covariance) = self.covariance(refined);
        let first = covariance.nrows() - values;
        let own = covariance.view((first, first), (sizes, sizes)).into_owned();
        let size = DVector::from_column_slice(&last.amplitudes);
        // what cannot be told apart may be as large as one likes
        let solved = own.cholesky()?.solve(&size);
        Some(size.dot(&solved))
    }

    /// A regression on a refined model's responses, and the covariance of its values, in steps.
    fn covariance(&self, refined: &Refined) -> (Blocks, DMatrix<f64>) {
        let blocks = self.blocks(
            &refined.columns,
            &refined.residual_nm,
            &refined.bounds,
            &refined.prior_means,
        );
        let all: Vec<usize> = (0..refined.columns.len()).collect();
        let covariance = blocks.covariance(&all, &blocks.fit(&all));
        (blocks, covariance)
    }

    fn moved(&self, model: &Model, step: &Step, share: f64) -> Model {
        let mut next = model.clone();
        let mut steps = step.coefficients.iter().map(|x| share * x);
        for known in &mut next.known {
            *known += steps.next().unwrap_or(0.0);
        }
        for term in &mut next.terms {
            let own: Vec<f64> = steps
                .by_ref()
                .take(Self::values(&term.hypothesis))
                .collect();
            *term = self.stepped(term, &own);
        }
        next
    }
}
