//! Models fitted by simulation: Gauss-Newton steps over known values, amplitudes and shapes at once.

use std::ops::Range;
use std::sync::Arc;

use joint_model::filter::FilterError;
use nalgebra::{DMatrix, DVector};

use crate::fit::{Blocks, Bound, Regression, block_of};
use crate::on_all_cores::OnAllCores;
use crate::rank::Round;
use crate::respond::Whitened;
use crate::search::{Model, Search, Term, difference, strain};

/// The smallest part of a step that is tried.
const SHARE_MIN: f64 = 0.02;
/// Sizes that are tried before the first step, as parts of the linear response's.
const START_FACTORS: [f64; 5] = [0.3, 0.6, 1.0, 1.7, 3.0];
/// Sizes, in steps, that are tried where the linear response says that there is nothing: known values that stand in for an effect
/// leave none of it.
const START_SIZES: [f64; 6] = [3.0, 10.0, 30.0, 100.0, 300.0, 1000.0];
/// Gauss-Newton steps, and more as long as each takes so large a part off.
const STEPS: usize = 8;
const STEPS_MOST: usize = 24;
const STILL_GAINS: f64 = 0.01;
/// Part that a step takes off below which it is the last.
const GAIN_MIN: f64 = 1e-4;
/// Part by which squares may differ from what coarse substeps made of them, or steps go on from there.
const AS_EXPECTED: f64 = 1e-3;
/// Of several starts, the steps that each takes, and how many go on.
const STEPS_TRIED: usize = 3;
const STARTS_KEPT: usize = 4;

/// What a fit of values is made to: all in their steps, known values first, then every term's amplitudes and shape.
#[derive(Clone, Debug, Default)]
struct Fitted {
    /// Responses to known values.
    known: Arc<Whitened>,
    /// Responses to the terms' values.
    own: Whitened,
    /// How far each may still move.
    bounds: Vec<Bound>,
    prior_means: Vec<f64>,
}

impl Fitted {
    fn raw_nm(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.known.raw_nm.iter().chain(&self.own.raw_nm)
    }

    fn white(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.known.white.iter().chain(&self.own.white)
    }

    /// How many values.
    fn values(&self) -> usize {
        self.bounds.len()
    }

    fn all(&self) -> Vec<usize> {
        (0..self.values()).collect()
    }

    /// To what is left of all rows.
    fn regression(&self, search: &Search<'_>, residual_nm: &[f64]) -> Regression {
        let target = search.whitener.apply(residual_nm);
        Regression::new(self.white(), &target, &self.bounds, &self.prior_means)
    }
}

/// Where steps led.
struct Way {
    end: Model,
    /// What the last of them was found by.
    fitted: Fitted,
    /// Squares and strain at the end, in coarse substeps.
    expected: f64,
    /// Steps of the fit up to there.
    count: usize,
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
    /// What its last step was found by.
    fitted: Fitted,
}

/// Sizes of an effect from which it is fitted, rising.
fn sizes(fitted: &[f64]) -> Vec<Vec<f64>> {
    if fitted.iter().all(|a| *a == 0.0) {
        START_SIZES.map(|size| vec![size; fitted.len()]).into()
    } else {
        let sizes = START_FACTORS.map(|factor| fitted.iter().map(|a| factor * a).collect());
        sizes.into()
    }
}

impl Search<'_> {
    /// Fits known values, amplitudes and shapes of a model to all rows by Gauss-Newton steps: in coarse substeps, until finer ones leave
    /// what these let expect.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn refine(&self, round: &Round, start: &Model) -> Result<Refined, FilterError> {
        self.stepped_on(round, start, STEPS_MOST)
    }

    /// The best of several starts, fitted: each takes a few steps, and those that then leave least go on.
    ///
    /// # Errors
    /// [`FilterError`].
    pub(crate) fn refine_best(
        &self,
        round: &Round,
        starts: &[Model],
    ) -> Result<Vec<Refined>, FilterError> {
        let begun = starts
            .iter()
            .on_all_cores(|start| self.stepped_on(round, start, STEPS_TRIED))
            .collect::<Result<Vec<_>, FilterError>>()?;
        let left = |refined: &Refined| self.left(&refined.model, &refined.residual_nm).total();
        let mut begun: Vec<(f64, Refined)> = begun
            .into_iter()
            .map(|refined| (left(&refined), refined))
            .filter(|(left, _)| left.is_finite())
            .collect();
        begun.sort_by(|a, b| a.0.total_cmp(&b.0));
        begun.truncate(STARTS_KEPT);
        let best = begun.iter();
        best.on_all_cores(|(_, refined)| self.refine(round, &refined.model))
            .collect()
    }

    fn stepped_on(
        &self,
        round: &Round,
        start: &Model,
        steps_most: usize,
    ) -> Result<Refined, FilterError> {
        let mut model = start.clone();
        model.known.resize(self.twin.known.len(), 0.0);
        let mut residual_nm = self.residual_nm(&model)?;
        let mut fitted = Fitted::default();
        let mut count = 0;
        while count < steps_most {
            let way = self.way(round, &model, &residual_nm, count..steps_most)?;
            let left_nm = self.residual_nm(&way.end)?;
            let [before, after] = [(&model, &residual_nm), (&way.end, &left_nm)]
                .map(|(model, residual_nm)| self.objective(model, residual_nm));
            count = way.count;
            // a joint may run away in simulation
            if after >= before || after.is_nan() {
                fitted = self.fitted(round, &model)?;
                break;
            }
            fitted = way.fitted;
            model = way.end;
            residual_nm = left_nm;
            if (after - way.expected).abs() < AS_EXPECTED * after {
                break;
            }
        }
        Ok(Refined {
            model,
            residual_nm,
            fitted,
        })
    }

    /// Steps in coarse substeps. What finer ones change is known where they begin, and changes little along them.
    fn way(
        &self,
        round: &Round,
        start: &Model,
        residual_nm: &[f64],
        counts: Range<usize>,
    ) -> Result<Way, FilterError> {
        let to_reach_nm = self.to_reach_nm(start, residual_nm)?;
        let mut way = Way {
            end: start.clone(),
            fitted: Fitted::default(),
            expected: self.objective(start, residual_nm),
            count: counts.start,
        };
        let mut left_nm = residual_nm.to_vec();
        while way.count < counts.end {
            way.count += 1;
            way.fitted = self.fitted(round, &way.end)?;
            let regression = way.fitted.regression(self, &left_nm);
            let steps = regression.fit(&way.fitted.all()).coefficients;
            let mut share = 1.0;
            let better = loop {
                let next = self.moved(&way.end, &steps, share);
                let left_nm = difference(&to_reach_nm, &self.coarsely_nm(&next)?);
                let after = self.objective(&next, &left_nm);
                if after < way.expected {
                    break Some((next, left_nm, after));
                }
                share *= 0.4;
                if share < SHARE_MIN {
                    break None;
                }
            };
            let Some((next, next_nm, after)) = better else {
                break;
            };
            let gain = 1.0 - after / way.expected;
            way.end = next;
            way.expected = after;
            left_nm = next_nm;
            if gain < GAIN_MIN || way.count >= STEPS && gain < STILL_GAINS {
                break;
            }
        }
        Ok(way)
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
        let base = self.coarsely_nm(&refined.model)?;
        let mut responses = Vec::new();
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
            let response = self.coarsely_nm(&probe)?;
            responses.push(difference(&response, &base));
        }
        let mut bounds = self.bounds();
        let (known, chosen): (Vec<usize>, Vec<usize>) =
            (0..bounds.len() + amplitudes).partition(|value| *value < bounds.len());
        bounds.resize(bounds.len() + amplitudes, Bound::FREE);
        let fitted = Fitted {
            known: Arc::clone(&round.linear.known),
            own: self.whitened(responses),
            bounds,
            prior_means: refined.model.known.iter().map(|z| -z).collect(),
        };
        let (matrix, vector) = fitted
            .regression(self, &refined.residual_nm)
            .information(&known, &chosen);
        Ok(OfSettled {
            refined,
            matrix,
            vector,
        })
    }

    /// Refined models with an effect more, the most promising first: those of these effects and of some sizes beside which
    /// everything else, moved in proportion, leaves less than beside the next smaller and the next larger size. A strong effect
    /// does not respond in proportion, and what was fitted without it stands in for it.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn starts(&self, base: &Refined, terms: &[Term]) -> Result<Vec<Model>, FilterError> {
        let (bounds, prior_means) = self.room(&base.model.known, &base.model.terms);
        let fitted = Fitted {
            bounds,
            prior_means,
            ..base.fitted.clone()
        };
        let all = fitted.all();
        let to_reach_nm = self.to_reach_nm(&base.model, &base.residual_nm)?;
        let left = |start: &Model| -> Result<f64, FilterError> {
            let left_nm = difference(&to_reach_nm, &self.coarsely_nm(start)?);
            let regression = fitted.regression(self, &left_nm);
            let fit = regression.fit(&all);
            let left = fit.square + strain(start, &fit.coefficients[..start.known.len()]);
            // a joint may run away in simulation
            Ok(if left.is_nan() { f64::INFINITY } else { left })
        };
        let mut found: Vec<(f64, Model)> = Vec::new();
        for term in terms {
            let models: Vec<Model> = sizes(&term.amplitudes)
                .into_iter()
                .map(|amplitudes| {
                    let mut model = base.model.clone();
                    model.terms.push(Term {
                        hypothesis: term.hypothesis.clone(),
                        amplitudes,
                    });
                    model
                })
                .collect();
            let lefts = models
                .iter()
                .on_all_cores(left)
                .collect::<Result<Vec<f64>, FilterError>>()?;
            for (k, model) in models.into_iter().enumerate() {
                let before = k.checked_sub(1).map(|before| lefts[before]);
                let is_less = before.is_none_or(|before| lefts[k] < before);
                if is_less && lefts.get(k + 1).is_none_or(|after| lefts[k] <= *after) {
                    found.push((lefts[k], model));
                }
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(found.into_iter().map(|(_, model)| model).collect())
    }

    /// How far known values, and every term's amplitudes and shape, may still move, and where their priors lie.
    fn room(&self, known: &[f64], terms: &[Term]) -> (Vec<Bound>, Vec<f64>) {
        let mut bounds = self.bounds();
        for (bound, known) in bounds.iter_mut().zip(known) {
            bound.range = bound.range.map(|limit| limit - known);
        }
        // the prior is about the file's values, not about the model's
        let mut prior_means: Vec<f64> = known.iter().map(|z| -z).collect();
        for term in terms {
            let hypothesis = &term.hypothesis;
            if !hypothesis.is_switch() {
                for amplitude in &term.amplitudes {
                    bounds.push(Bound {
                        range: [hypothesis.lowest(&self.scale) - amplitude, f64::INFINITY],
                        precision: hypothesis.plausible_steps().powi(-2),
                    });
                    prior_means.push(-amplitude);
                }
            }
            if hypothesis.shape_is_free() {
                let shape = hypothesis.shape[0];
                let range = hypothesis.shape_range(&self.scale);
                let unit = (1.0 + hypothesis.shape_step(&self.scale)).ln();
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
        (bounds, prior_means)
    }

    /// Responses of a model's values.
    fn fitted(&self, round: &Round, model: &Model) -> Result<Fitted, FilterError> {
        let base = self.coarsely_nm(model)?;
        let mut probes: Vec<Model> = Vec::new();
        for (t, term) in model.terms.iter().enumerate() {
            if !term.hypothesis.is_switch() {
                for a in 0..term.amplitudes.len() {
                    let mut probe = model.clone();
                    probe.terms[t].amplitudes[a] += 1.0;
                    probes.push(probe);
                }
            }
            if term.hypothesis.shape_is_free() {
                let shape = term.hypothesis.shape[0];
                let mut probe = model.clone();
                let factor = 1.0 + term.hypothesis.shape_step(&self.scale);
                probe.terms[t].hypothesis = term.hypothesis.shaped(&[shape * factor]);
                probes.push(probe);
            }
        }
        let responses = probes
            .iter()
            .on_all_cores(|probe| {
                let response = self.coarsely_nm(probe)?;
                Ok(difference(&response, &base))
            })
            .collect::<Result<Vec<_>, FilterError>>()?;
        let (bounds, prior_means) = self.room(&model.known, &model.terms);
        Ok(Fitted {
            known: Arc::clone(&round.linear.known),
            own: self.whitened(responses),
            bounds,
            prior_means,
        })
    }

    /// What a refined model leaves of every block when it is fitted to the other blocks only, raw; and the covariance of
    /// its values, in steps.
    pub fn held_out(&self, refined: &Refined) -> (Vec<f64>, DMatrix<f64>) {
        let mut left = refined.residual_nm.clone();
        let all = refined.fitted.all();
        if all.is_empty() {
            return (left, DMatrix::zeros(0, 0));
        }
        let (blocks, covariance) = self.covariance(refined, &all);
        let block_of = block_of(&self.twin.rows);
        let folds = blocks.folds(&all);
        for (k, value) in left.iter_mut().enumerate() {
            let steps = &folds[block_of[k]];
            let column = refined.fitted.raw_nm().zip(steps);
            *value -= column.map(|(column, step)| step * column[k]).sum::<f64>();
        }
        (left, covariance)
    }

    /// Squared size of the last effect of a refined model in units of its covariance, which comes from the scatter between
    /// blocks of time. A shape that does not choose where the effect shows is held: without the effect there is none to be unsure of.
    /// So are known values at the same end of their tolerance as without the effect, where that is given: they have no room to stand
    /// in for it. None for an effect without a size.
    pub fn certainty(&self, without: Option<&Refined>, refined: &Refined) -> Option<f64> {
        let last = refined.model.terms.last()?;
        let values = Self::values(&last.hypothesis);
        let sizes = values - usize::from(last.hypothesis.shape_is_free());
        if sizes == 0 || refined.fitted.values() < values {
            return None;
        }
        let first = refined.fitted.values() - values;
        let bounds = self.bounds();
        let is_held = |k: usize| {
            let known = [without.map(|of| &of.model), Some(&refined.model)]
                .map(|model| model.and_then(|model| model.known.get(k)));
            match (known, bounds.get(k)) {
                ([Some(before), Some(after)], Some(bound)) => {
                    let end = bound.end(*before);
                    end.is_some() && end == bound.end(*after)
                }
                _ => false,
            }
        };
        let shown = if last.hypothesis.shows_at_any_shape() {
            sizes
        } else {
            values
        };
        let chosen: Vec<usize> = (0..first + shown).filter(|k| !is_held(*k)).collect();
        let (_, covariance) = self.covariance(refined, &chosen);
        let first = chosen.len() - shown;
        let own = covariance.view((first, first), (sizes, sizes)).into_owned();
        let size = DVector::from_column_slice(&last.amplitudes);
        // what cannot be told apart may be as large as one likes
        let solved = own.cholesky()?.solve(&size);
        Some(size.dot(&solved))
    }

    /// A regression on a refined model's responses, and the covariance of chosen values, in steps.
    fn covariance(&self, refined: &Refined, chosen: &[usize]) -> (Blocks, DMatrix<f64>) {
        let Fitted {
            bounds,
            prior_means,
            ..
        } = &refined.fitted;
        let white = refined.fitted.white();
        let target = self.whitener.apply(&refined.residual_nm);
        let blocks = Blocks::new(white, &target, bounds, prior_means, &self.twin.rows);
        let covariance = blocks.covariance(chosen, &blocks.all.fit(chosen));
        (blocks, covariance)
    }

    fn moved(&self, model: &Model, steps: &[f64], share: f64) -> Model {
        let mut next = model.clone();
        let mut steps = steps.iter().map(|x| share * x);
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use crate::diagnose::diagnose;
    use crate::made_up::{CENTRE_M, MadeUp, robot};
    use crate::report::Verdict;

    #[test]
    fn a_wide_gap_is_found_though_known_values_stand_in_for_it_and_a_small_one_explains_less() {
        for gap_rad in [0.0, 0.003, 0.009] {
            let made_up = MadeUp {
                gap_rad,
                ..MadeUp::KNOWN
            };
            let recordings = [("made up".to_owned(), made_up.recorded())];
            let report = diagnose(&robot(), &recordings, &|_| ()).unwrap().report;
            let joint = &report.joints[0];
            let effects = joint.effects.iter();
            let names: Vec<&str> = effects.map(|found| found.effect.as_str()).collect();
            if gap_rad == 0.0 {
                assert_eq!(joint.verdict, Verdict::NoGap, "{names:?}");
                continue;
            }
            assert_eq!(names, ["backlash"], "{gap_rad}");
            let found_rad = joint.effects[0].parameters["gap_rad"].value;
            assert!((found_rad / gap_rad - 1.0).abs() < 0.1, "{found_rad}");
        }
    }

    #[test]
    fn a_payload_is_told_though_a_link_off_by_its_tolerance_may_bear_a_part_of_it() {
        let payload_kg = 0.6;
        let made_up = MadeUp {
            payload_kg,
            ..MadeUp::KNOWN
        };
        let recordings = [("made up".to_owned(), made_up.recorded())];
        let report = diagnose(&robot(), &recordings, &|_| ()).unwrap().report;
        let effects = &report.joints[0].effects;
        let names: Vec<&str> = effects.iter().map(|found| found.effect.as_str()).collect();
        assert_eq!(names, ["payload"]);
        let value = |name: &str| effects[0].parameters[name].value;
        let moment = value("mass_kg") * value("centre_m_z");
        assert!(
            (moment / (payload_kg * CENTRE_M) - 1.0).abs() < 0.2,
            "{moment}"
        );
    }
}
