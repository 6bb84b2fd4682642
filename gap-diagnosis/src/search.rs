//! Which effects explain a joint's residual: one after the other, each fitted with what is known refitted beside it,
//! and judged by how it predicts blocks of time that it was not fitted to.

use std::ops::Range;

use joint_model::filter::FilterError;
use nalgebra::{DMatrix, DVector};
use rand_core::{RngCore, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use robot::Effect;

use crate::fit::{Blocks, Bound, HeldOut, block_of};
use crate::hypothesis::{Hypothesis, Scale, periodic, plain};
use crate::observe::Channel;
use crate::spectrum::peaks;
use crate::twin::{Changes, JointTwin, Row};
use crate::whiten::{Floor, Whitener};

/// Runs of the twin with noise, of which the mean is taken.
const NOISY_RUNS: u64 = 6;
/// What the twin itself is off, as parts of the friction: from sample to sample, and slowly.
const TWIN_QUICK: f64 = 0.002;
const TWIN_SLOW: f64 = 0.006;
/// Over which the slow part changes.
const TWIN_SLOW_S: f64 = 0.15;
/// Standard deviations that a known value may move: beyond that it is a finding.
const TOLERANCE: f64 = 3.0;
/// Gauss-Newton steps.
const STEPS: usize = 4;
/// Peaks over the motor angle that are tried.
const PEAKS: usize = 2;
/// Hypotheses whose responses are found anew beside a model with effects.
const ANEW: usize = 14;

/// An effect with its fitted amplitudes.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// What.
    pub hypothesis: Hypothesis,
    /// How much.
    pub amplitudes: Vec<f64>,
}

impl Term {
    /// As a robot file writes it.
    pub fn effect(&self, scale: &Scale) -> Effect {
        self.hypothesis.effect(&self.amplitudes, scale)
    }
}

/// A joint's model: what is known, refitted, and the effects added to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// In standard deviations.
    pub known: Vec<f64>,
    /// Added effects.
    pub terms: Vec<Term>,
}

impl Model {
    /// For the twin.
    pub fn changes(&self, scale: &Scale) -> Changes {
        Changes {
            known: self.known.clone(),
            effects: self.terms.iter().map(|term| term.effect(scale)).collect(),
        }
    }
}

/// A joint's recordings beside its twin, ready to be searched.
pub struct Search<'a> {
    /// The twin.
    pub twin: &'a JointTwin<'a>,
    /// Sizes of the joint.
    pub scale: Scale,
    /// Measured channels less what noise does to them.
    pub measured_nm: Vec<f64>,
    /// Standard deviation of what noise does, row by row of each channel.
    pub noise_nm: Vec<(Channel, f64)>,
    /// Makes residuals independent.
    pub whitener: Whitener,
    /// What may be added, periodic effects aside.
    hypotheses: Vec<Hypothesis>,
}

/// A hypothesis with the channels' response to each of its amplitudes.
type Columns = (Hypothesis, Vec<Vec<f64>>);

/// Responses of the channels about a model.
#[derive(Clone, Debug)]
struct Linear {
    residual_nm: Vec<f64>,
    known: Vec<Vec<f64>>,
    hypotheses: Vec<Columns>,
}

/// A hypothesis' standing.
#[derive(Clone, Debug)]
pub struct Scored {
    /// What.
    pub hypothesis: Hypothesis,
    /// Its columns in the round.
    columns: Range<usize>,
    /// Fitted to all rows.
    pub amplitudes: Vec<f64>,
    /// Errors in blocks it was not fitted to.
    pub held_out: HeldOut,
    /// Sum of squares that its fit to all rows leaves.
    pub square: f64,
    /// Sum of squared deviations of what is known.
    pub strain: f64,
    /// Root mean square of what it adds to the motor's channel.
    pub size_nm: f64,
}

/// All hypotheses beside a model.
#[derive(Clone, Debug)]
pub struct Round {
    /// The model.
    pub model: Model,
    /// Their standing.
    pub ranking: Ranking,
    linear: Linear,
    blocks: Blocks,
}

/// The standing of all hypotheses beside a model.
#[derive(Clone, Debug)]
pub struct Ranking {
    /// Without any of them.
    pub none: HeldOut,
    /// Sum of squares that the fit to all rows leaves without any of them.
    pub none_square: f64,
    /// Sum of squared deviations of what is known, without any of them.
    pub none_strain: f64,
    /// Best first.
    pub scored: Vec<Scored>,
    /// Compared numbers.
    pub rows: usize,
}

impl Round {
    /// `d²`: how far one hypothesis, as fitted, is from being imitated by another with known values refitted.
    pub fn distance(&self, one: &Scored, other: &Scored) -> f64 {
        let others: Vec<usize> = (0..self.linear.known.len())
            .chain(other.columns.clone())
            .collect();
        let chosen: Vec<usize> = one.columns.clone().collect();
        self.blocks.distance(&chosen, &one.amplitudes, &others)
    }

    /// What this joint says about a hypothesis whose amplitudes several joints share: information matrix and vector,
    /// known values refitted.
    pub fn information(&self, of: &Scored) -> (DMatrix<f64>, DVector<f64>) {
        let known: Vec<usize> = (0..self.linear.known.len()).collect();
        let chosen: Vec<usize> = of.columns.clone().collect();
        self.blocks.information(&known, &chosen)
    }
}

impl<'a> Search<'a> {
    /// Runs the twin without changes, with and without noise.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn new(twin: &'a JointTwin<'a>) -> Result<Self, FilterError> {
        let stretches = twin.stretches();
        let scale = Scale::of(&twin.nominal, &stretches);
        let nominal = Changes::default();
        let clean = twin.simulated(&nominal, None)?;
        let noisy = (1..=NOISY_RUNS)
            .into_par_iter()
            .map(|seed| twin.simulated(&nominal, Some(seed)))
            .collect::<Result<Vec<_>, _>>()?;
        let runs = NOISY_RUNS as f64;
        let mean: Vec<f64> = (0..clean.len())
            .map(|k| noisy.iter().map(|run| run[k]).sum::<f64>() / runs)
            .collect();
        let mut measured_nm = twin.measured()?;
        for ((value, mean), clean) in measured_nm.iter_mut().zip(&mean).zip(&clean) {
            *value -= mean - clean;
        }
        let noise_nm: Vec<(Channel, f64)> = twin
            .channels
            .iter()
            .map(|&channel| {
                let of_channel = (0..twin.rows.len()).filter(|k| twin.rows[*k].channel == channel);
                let (mut sum, mut count) = (0.0, 0.0);
                for k in of_channel {
                    sum += noisy
                        .iter()
                        .map(|run| (run[k] - mean[k]).powi(2))
                        .sum::<f64>();
                    count += runs - 1.0;
                }
                (channel, (sum / f64::max(count, 1.0)).sqrt())
            })
            .collect();
        let whitener = Whitener::new(&twin.rows, |row| {
            floor(row.channel, &noise_nm, &scale, twin)
        });
        let has_link_encoder = stretches.iter().any(|stretch| stretch.link_rad.is_some());
        let has_command = stretches.iter().all(|stretch| stretch.has_command);
        // where the drive reports its torque beside the command, its delay and lag are read off the samples
        let timing_is_open = !twin.channels.contains(&Channel::Drive);
        Ok(Self {
            twin,
            scale,
            measured_nm,
            noise_nm,
            whitener,
            hypotheses: plain(&scale, has_link_encoder, has_command, timing_is_open),
        })
    }

    /// What a channel holds whatever the model: noise and what the twin itself is off.
    pub fn floor(&self, channel: Channel) -> Floor {
        floor(channel, &self.noise_nm, &self.scale, self.twin)
    }

    /// Its standard deviation.
    pub fn twin_floor_nm(&self, channel: Channel) -> f64 {
        let floor = self.floor(channel);
        floor.quick_nm.hypot(floor.slow_nm)
    }

    /// Fitted values of a hypothesis: amplitudes, and the shape where it is free.
    pub fn values(hypothesis: &Hypothesis) -> usize {
        let amplitudes = if hypothesis.is_switch() {
            0
        } else {
            hypothesis.amplitudes()
        };
        amplitudes + usize::from(hypothesis.shape_is_free())
    }

    /// A term with its values moved by so many steps.
    pub fn stepped(&self, term: &Term, steps: &[f64]) -> Term {
        let mut term = term.clone();
        let mut steps = steps.iter().copied();
        if !term.hypothesis.is_switch() {
            for amplitude in &mut term.amplitudes {
                *amplitude += steps.next().unwrap_or(0.0);
            }
        }
        if term.hypothesis.shape_is_free() {
            let factor = 1.0 + term.hypothesis.shape_step(&self.scale);
            let shape = term.hypothesis.shape[0] * factor.powf(steps.next().unwrap_or(0.0));
            term.hypothesis = term.hypothesis.shaped(&[shape]);
        }
        term
    }

    /// What the model leaves of the measurement.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn residual_nm(&self, model: &Model) -> Result<Vec<f64>, FilterError> {
        let simulated = self.twin.simulated(&model.changes(&self.scale), None)?;
        Ok(difference(&self.measured_nm, &simulated))
    }

    fn bounds(&self) -> Vec<Bound> {
        let known = self.twin.known.iter().map(|known| Bound {
            range: if known.is_positive() {
                [0.0, TOLERANCE]
            } else {
                [-TOLERANCE, TOLERANCE]
            },
            precision: 1.0,
        });
        known.collect()
    }

    fn hypothesis_bound(hypothesis: &Hypothesis) -> Bound {
        if hypothesis.is_positive() {
            Bound::POSITIVE
        } else {
            Bound::FREE
        }
    }

    /// Response to a change, beside a model.
    fn response(
        &self,
        base: &[f64],
        model: &Model,
        change: impl FnOnce(&mut Changes),
    ) -> Result<Vec<f64>, FilterError> {
        let mut changes = model.changes(&self.scale);
        changes.known.resize(self.twin.known.len(), 0.0);
        change(&mut changes);
        Ok(difference(&self.twin.simulated(&changes, None)?, base))
    }

    fn hypothesis_columns(
        &self,
        base: &[f64],
        model: &Model,
        hypothesis: &Hypothesis,
    ) -> Result<Vec<Vec<f64>>, FilterError> {
        let at = |amplitudes: &[f64]| {
            self.response(base, model, |changes| {
                changes
                    .effects
                    .push(hypothesis.effect(amplitudes, &self.scale));
            })
        };
        (0..hypothesis.amplitudes())
            .map(|index| {
                let (probe, beside) = hypothesis.probes(index);
                let mut column = at(&probe)?;
                if let Some(beside) = beside {
                    for (value, beside) in column.iter_mut().zip(at(&beside)?) {
                        *value -= beside;
                    }
                }
                Ok(column)
            })
            .collect()
    }

    /// Responses to everything that is known, about a model.
    fn known_columns(&self, base: &[f64], model: &Model) -> Result<Vec<Vec<f64>>, FilterError> {
        (0..self.twin.known.len())
            .into_par_iter()
            .map(|index| self.response(base, model, |changes| changes.known[index] += 1.0))
            .collect()
    }

    fn columns(
        &self,
        base: &[f64],
        model: &Model,
        hypotheses: Vec<Hypothesis>,
    ) -> Result<Vec<Columns>, FilterError> {
        hypotheses
            .into_par_iter()
            .map(|hypothesis| {
                let columns = self.hypothesis_columns(base, model, &hypothesis)?;
                Ok((hypothesis, columns))
            })
            .collect()
    }

    /// Periodic effects at the cycles at which a residual repeats.
    fn periodic_hypotheses(&self, residual_nm: &[f64], linear: &Linear) -> Vec<Hypothesis> {
        let mut cycles: Vec<f64> = linear
            .hypotheses
            .iter()
            .filter(|(hypothesis, _)| hypothesis.effect == "torque_ripple")
            .map(|(hypothesis, _)| hypothesis.shape[0])
            .collect();
        let there = cycles.len();
        for channel in [Channel::Motor, Channel::Torsion] {
            let of_channel: Vec<usize> = (0..self.twin.rows.len())
                .filter(|k| self.twin.rows[*k].channel == channel)
                .collect();
            let rows: Vec<&Row> = of_channel.iter().map(|k| &self.twin.rows[*k]).collect();
            let values: Vec<f64> = of_channel.iter().map(|k| residual_nm[*k]).collect();
            for with_direction in [false, true] {
                for peak in peaks(&rows, &values, with_direction, PEAKS) {
                    let found = peak.cycles_per_motor_rev;
                    if !cycles
                        .iter()
                        .any(|known| (known / found - 1.0).abs() < 0.01)
                    {
                        cycles.push(found);
                    }
                }
            }
        }
        cycles.drain(there..).flat_map(periodic).collect()
    }

    /// All hypotheses, beside a model.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn first(&self, model: &Model) -> Result<Round, FilterError> {
        let model = model.clone();
        let base = self.twin.simulated(&model.changes(&self.scale), None)?;
        let residual_nm: Vec<f64> = difference(&self.measured_nm, &base);
        let known = self.known_columns(&base, &model)?;
        let mut linear = Linear {
            residual_nm,
            known,
            hypotheses: self.columns(&base, &model, self.hypotheses.clone())?,
        };
        let left = self.left(&linear);
        let periodic = self.periodic_hypotheses(&left, &linear);
        linear
            .hypotheses
            .extend(self.columns(&base, &model, periodic)?);
        Ok(self.round(model, linear))
    }

    /// All hypotheses, beside a model with effects: responses about the model before are good enough to choose those
    /// whose responses are found anew.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn next(&self, before: &Round, model: &Model) -> Result<Round, FilterError> {
        let mut model = model.clone();
        model.known.resize(self.twin.known.len(), 0.0);
        let base = self.twin.simulated(&model.changes(&self.scale), None)?;
        let mut linear = before.linear.clone();
        linear.residual_nm = difference(&self.measured_nm, &base);
        let periodic = self.periodic_hypotheses(&linear.residual_nm, &linear);
        linear
            .hypotheses
            .extend(self.columns(&base, &model, periodic)?);
        let (rough, _) = self.scored(&model, &linear);
        let anew = rough
            .scored
            .iter()
            .take(ANEW)
            .map(|scored| scored.hypothesis.clone())
            .collect();
        linear.hypotheses = self.columns(&base, &model, anew)?;
        Ok(self.round(model, linear))
    }

    fn round(&self, model: Model, linear: Linear) -> Round {
        let (ranking, blocks) = self.scored(&model, &linear);
        Round {
            model,
            ranking,
            linear,
            blocks,
        }
    }

    /// What known values leave of the residual.
    fn left(&self, linear: &Linear) -> Vec<f64> {
        let white: Vec<Vec<f64>> = linear
            .known
            .par_iter()
            .map(|column| self.whitener.apply(column))
            .collect();
        let target = self.whitener.apply(&linear.residual_nm);
        let blocks = Blocks::new(&white, &target, self.bounds(), &self.twin.rows);
        let all: Vec<usize> = (0..white.len()).collect();
        let fit = blocks.fit(&all);
        let mut left = linear.residual_nm.clone();
        for (column, coefficient) in linear.known.iter().zip(&fit.coefficients) {
            for (value, x) in left.iter_mut().zip(column.iter()) {
                *value -= coefficient * x;
            }
        }
        left
    }

    fn scored(&self, model: &Model, linear: &Linear) -> (Ranking, Blocks) {
        let rows = &self.twin.rows;
        let whitener = &self.whitener;
        let columns: Vec<&Vec<f64>> = linear
            .known
            .iter()
            .chain(linear.hypotheses.iter().flat_map(|(_, columns)| columns))
            .collect();
        let white: Vec<Vec<f64>> = columns.par_iter().map(|c| whitener.apply(c)).collect();
        let target = whitener.apply(&linear.residual_nm);
        let mut bounds = self.bounds();
        for (k, bound) in bounds.iter_mut().enumerate() {
            // a model that moved a known value already has less room left
            let moved = model.known.get(k).copied().unwrap_or(0.0);
            bound.range = bound.range.map(|limit| limit - moved);
        }
        for (hypothesis, columns) in &linear.hypotheses {
            bounds.extend(columns.iter().map(|_| Self::hypothesis_bound(hypothesis)));
        }
        let blocks = Blocks::new(&white, &target, bounds, rows);
        let known: Vec<usize> = (0..linear.known.len()).collect();
        let none = blocks.held_out(&known);
        let without = blocks.fit(&known);
        let none_strain = strain(model, &without.coefficients);
        let mut first = known.len();
        let places: Vec<(usize, usize)> = linear
            .hypotheses
            .iter()
            .map(|(_, columns)| {
                let place = (first, columns.len());
                first += columns.len();
                place
            })
            .collect();
        let mut scored: Vec<Scored> = linear
            .hypotheses
            .par_iter()
            .zip(&places)
            .map(|((hypothesis, own), &(place, count))| {
                let chosen: Vec<usize> =
                    known.iter().copied().chain(place..place + count).collect();
                let fit = blocks.fit(&chosen);
                let amplitudes = fit.coefficients[known.len()..].to_vec();
                Scored {
                    hypothesis: hypothesis.clone(),
                    columns: place..place + count,
                    held_out: blocks.held_out(&chosen),
                    square: fit.square,
                    strain: strain(model, &fit.coefficients[..known.len()]),
                    size_nm: self.size_nm(own, &amplitudes),
                    amplitudes,
                }
            })
            .collect();
        scored.sort_by(|a, b| a.held_out.total().total_cmp(&b.held_out.total()));
        let ranking = Ranking {
            none,
            none_square: without.square,
            none_strain,
            scored,
            rows: blocks.rows(),
        };
        (ranking, blocks)
    }

    /// Root mean square over the motor's channel.
    fn size_nm(&self, columns: &[Vec<f64>], amplitudes: &[f64]) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (k, row) in self.twin.rows.iter().enumerate() {
            if row.channel == Channel::Motor {
                let value: f64 = columns.iter().zip(amplitudes).map(|(c, a)| a * c[k]).sum();
                sum += value * value;
                count += 1.0;
            }
        }
        (sum / f64::max(count, 1.0)).sqrt()
    }

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
                if share < 0.1 {
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

    /// Whitened squares of a residual and strain of the known values.
    pub fn objective(&self, model: &Model, residual_nm: &[f64]) -> f64 {
        self.square(residual_nm) + strain(model, &[0.0; 0])
    }

    /// Whitened squares of a residual.
    pub fn square(&self, residual_nm: &[f64]) -> f64 {
        self.whitener.apply(residual_nm).iter().map(|x| x * x).sum()
    }

    fn step(&self, round: &Round, model: &Model, residual_nm: &[f64]) -> Result<Step, FilterError> {
        let base = self.twin.simulated(&model.changes(&self.scale), None)?;
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
                let low = if term.hypothesis.is_positive() {
                    -term.amplitudes[a]
                } else {
                    f64::NEG_INFINITY
                };
                bounds.push(Bound {
                    range: [low, f64::INFINITY],
                    precision: 0.0,
                });
                prior_means.push(0.0);
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
                    let response = self.twin.simulated(&probe.changes(&self.scale), None)?;
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
    fn blocks(
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
        let blocks = self.blocks(
            &refined.columns,
            &refined.residual_nm,
            &refined.bounds,
            &refined.prior_means,
        );
        let all: Vec<usize> = (0..refined.columns.len()).collect();
        let block_of = block_of(&self.twin.rows);
        let folds = blocks.folds(&all);
        for (k, value) in left.iter_mut().enumerate() {
            let steps = &folds[block_of[k]];
            let column = refined.columns.iter().zip(steps);
            *value -= column.map(|(column, step)| step * column[k]).sum::<f64>();
        }
        (left, blocks.covariance(&all, &blocks.fit(&all)))
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

/// Seeded random numbers between 0 and 1.
pub(crate) fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    move || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

fn strain(model: &Model, steps: &[f64]) -> f64 {
    (0..model.known.len().max(steps.len()))
        .map(|k| {
            let at = |values: &[f64]| values.get(k).copied().unwrap_or(0.0);
            (at(&model.known) + at(steps)).powi(2)
        })
        .sum()
}

/// What a channel holds whatever the model.
fn floor(
    channel: Channel,
    noise_nm: &[(Channel, f64)],
    scale: &Scale,
    twin: &JointTwin<'_>,
) -> Floor {
    let noise_nm = noise_nm
        .iter()
        .find(|(of, _)| *of == channel)
        .map_or(0.0, |(_, noise_nm)| *noise_nm);
    Floor {
        quick_nm: noise_nm.hypot(TWIN_QUICK * scale.friction_nm),
        slow_nm: match channel {
            Channel::Drive => 0.0,
            Channel::Motor => TWIN_SLOW * scale.friction_nm,
            // the twist of the gear swings, and nobody knows its damping
            Channel::Torsion | Channel::Link => 2.0 * TWIN_SLOW * scale.friction_nm,
        },
        slow_samples: TWIN_SLOW_S * twin.rows_hz(),
    }
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

struct Step {
    coefficients: Vec<f64>,
    columns: Vec<Vec<f64>>,
    bounds: Vec<Bound>,
    prior_means: Vec<f64>,
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

impl Refined {
    /// Sum of squared deviations of what is known.
    pub fn strain(&self) -> f64 {
        self.model.known.iter().map(|z| z * z).sum()
    }
}
