//! The standing of all effects beside a model: each fitted with what is known refitted beside it, and judged by how it
//! predicts blocks of time that it was not fitted to.

use std::ops::Range;

use joint_model::filter::FilterError;
use nalgebra::{DMatrix, DVector};

use crate::evidence::{Left, most_by_rest, together, variance_of};
use crate::fit::{Blocks, HeldOut, matrix};
use crate::hypothesis::Hypothesis;
use crate::known::{Known, KnownValue};
use crate::observe::Channel;
use crate::on_all_cores::OnAllCores;
use crate::refine::Refined;
use crate::respond::Linear;
use crate::search::{Model, SLOWEST_LOOP_HZ, Search, Term, strain};
use crate::shapes::{Family, PUSHES_OVER, evidence_nats, families, foreign_vibration, on_sides};
use crate::spectrum::Beside;

/// Hypotheses whose responses are found anew beside a model with effects.
const ANEW: usize = 14;
/// Cycles a turn that differ by less are the same.
pub(crate) const ALIKE: f64 = 0.02;

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
    pub(crate) linear: Linear,
    blocks: Blocks,
}

/// The standing of all hypotheses beside a model.
#[derive(Clone, Debug)]
pub struct Ranking {
    /// Without any of them.
    pub none: HeldOut,
    /// Sum of squared deviations of what is known, without any of them.
    pub none_strain: f64,
    /// Best first.
    pub scored: Vec<Scored>,
    /// Compared numbers.
    pub rows: usize,
    /// By how much squares change with nothing: a joint that sticks and slips is never simulated twice alike.
    pub roughness: f64,
    /// Friction as the robot file has it falls at low speed.
    pub file_falls: bool,
    /// Cycles per motor turn at which the robot file has friction repeat.
    pub file_cycles: Vec<f64>,
    /// Joints of the robot: among more of them something looks like an effect by chance.
    pub joints: usize,
    /// Whether a second encoder or a torque sensor shows how the gear twists.
    pub sees_torsion: bool,
    /// Whether rows come more slowly than any loop.
    pub is_aliased: bool,
}

impl Ranking {
    /// Whether the robot file has a law like this already, which is refitted beside it.
    pub fn is_in_file(&self, hypothesis: &Hypothesis) -> bool {
        let cycles = hypothesis.shape.first().copied().unwrap_or(0.0);
        let repeats = self
            .file_cycles
            .iter()
            .any(|own| (cycles / own - 1.0).abs() < ALIKE);
        hypothesis.is_periodic() && repeats
            || hypothesis.effect == "stribeck_friction" && self.file_falls
    }
}

impl Round {
    fn known_values(&self) -> usize {
        self.linear.known.white.len()
    }

    /// `d²`: how far one hypothesis, as fitted, is from being imitated by another with known values refitted.
    pub fn distance(&self, one: &Scored, other: &Scored) -> f64 {
        let others: Vec<usize> = (0..self.known_values())
            .chain(other.columns.clone())
            .collect();
        let chosen: Vec<usize> = one.columns.clone().collect();
        self.blocks
            .all
            .distance(&chosen, &one.amplitudes, &others, false)
    }

    /// `d²` of a hypothesis, as fitted, from another alone.
    pub fn distance_alone(&self, one: &Scored, other: &Scored) -> f64 {
        let chosen: Vec<usize> = one.columns.clone().collect();
        let others: Vec<usize> = other.columns.clone().collect();
        self.blocks
            .all
            .distance(&chosen, &one.amplitudes, &others, true)
    }

    /// Squared response of a hypothesis, as fitted.
    pub fn square(&self, one: &Scored) -> f64 {
        let chosen: Vec<usize> = one.columns.clone().collect();
        self.blocks
            .all
            .distance(&chosen, &one.amplitudes, &[], true)
    }

    /// `d²` of a hypothesis, as fitted, from known values that are off by any amount, but for those it is itself a change
    /// of; and the one of them that it cannot do without.
    pub fn distance_from_known(&self, one: &Scored, known: &[KnownValue]) -> (f64, Option<Known>) {
        let chosen: Vec<usize> = one.columns.clone().collect();
        let others: Vec<usize> = (0..known.len())
            .filter(|k| known[*k].known.effect() != Some(one.hypothesis.effect))
            .collect();
        let regression = &self.blocks.all;
        let away = |others: &[usize]| regression.distance(&chosen, &one.amplitudes, others, true);
        let all = away(&others);
        let needed = others
            .iter()
            .map(|without| {
                let rest: Vec<usize> = others.iter().copied().filter(|k| k != without).collect();
                (away(&rest), known[*without].known)
            })
            .filter(|(_, known)| known.effect().is_some())
            .max_by(|a, b| a.0.total_cmp(&b.0));
        (all, needed.map(|(_, known)| known))
    }

    /// What this joint says about a hypothesis whose amplitudes several joints share: information matrix and vector,
    /// known values refitted.
    pub fn information(&self, of: &Scored) -> (DMatrix<f64>, DVector<f64>) {
        let known: Vec<usize> = (0..self.known_values()).collect();
        let chosen: Vec<usize> = of.columns.clone().collect();
        self.blocks.all.information(&known, &chosen)
    }

    /// The two effects that explain most together, of `leading` and all others, by what fits of their responses leave: the
    /// best `count` pairs, best first, that are worth `more` nats than any effect alone.
    pub fn pairs(&self, leading: &[usize], count: usize, more: f64) -> Vec<[Term; 2]> {
        let scored = &self.ranking.scored;
        let pairs = leading.iter().enumerate().flat_map(|(before, &one)| {
            let others = (0..scored.len()).filter(move |other| {
                let name = scored[*other].hypothesis.effect;
                name != scored[one].hypothesis.effect && !leading[..before].contains(other)
            });
            others.map(move |other| [one, other])
        });
        let pairs: Vec<[usize; 2]> = pairs.collect();
        let fits: Vec<(Left, [Term; 2])> = pairs
            .iter()
            .on_all_cores(|pair| self.fitted(*pair))
            .collect();
        let alone: Vec<(Left, [Term; 1])> = leading
            .iter()
            .on_all_cores(|one| self.fitted([*one]))
            .collect();
        let without = self.fitted([]).0;
        let squares = fits.iter().map(|(left, _)| left.square);
        let variance = variance_of(&self.ranking, squares.fold(f64::INFINITY, f64::min));
        let worth =
            |left: Left, terms: &[Term]| together(&self.ranking, [without, left], variance, terms);
        let of_one = alone.iter().map(|(left, term)| worth(*left, term));
        let least = of_one.fold(0.0, f64::max) + more;
        let mut fits: Vec<(f64, [Term; 2])> = fits
            .into_iter()
            .map(|(left, pair)| (worth(left, &pair), pair))
            .filter(|(nats, _)| nats.is_finite() && *nats > least)
            .collect();
        fits.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best: Vec<[Term; 2]> = Vec::new();
        for (_, pair) in fits {
            let names = |pair: &[Term; 2]| {
                let mut names = pair.each_ref().map(|term| term.hypothesis.effect);
                names.sort_unstable();
                names
            };
            if best.len() < count && !best.iter().any(|other| names(other) == names(&pair)) {
                best.push(pair);
            }
        }
        best
    }

    /// What fits of these effects' responses leave, by their places in the ranking, and the effects as fitted.
    fn fitted<const COUNT: usize>(&self, effects: [usize; COUNT]) -> (Left, [Term; COUNT]) {
        let known = self.known_values();
        let of = effects.map(|index| &self.ranking.scored[index]);
        let columns = of.iter().flat_map(|scored| scored.columns.clone());
        let fit = self
            .blocks
            .all
            .fit(&(0..known).chain(columns).collect::<Vec<_>>());
        let (of_known, mut rest) = fit.coefficients.split_at(known);
        let left = Left {
            square: fit.square,
            strain: strain(&self.model, of_known),
        };
        let terms = of.map(|scored| {
            let (own, further) = rest.split_at(scored.amplitudes.len());
            rest = further;
            Term {
                hypothesis: scored.hypothesis.clone(),
                amplitudes: own.to_vec(),
            }
        });
        (left, terms)
    }
}

impl Search<'_> {
    /// Known values alone, beside a model.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn known_alone(&self, model: &Model) -> Result<Round, FilterError> {
        let base = self.coarsely_nm(model)?;
        let linear = Linear {
            residual_nm: self.residual_nm(model)?,
            known: self.known_columns(&base, model)?,
            hypotheses: Vec::new(),
        };
        Ok(self.round(model.clone(), linear, 0.0))
    }

    /// A round with the responses of known values found anew about a model: beside a strong effect they are others.
    ///
    /// # Errors
    /// [`FilterError`].
    pub(crate) fn about(&self, round: &Round, model: &Model) -> Result<Round, FilterError> {
        let base = self.coarsely_nm(model)?;
        let mut round = round.clone();
        round.linear.known = self.known_columns(&base, model)?;
        Ok(round)
    }

    /// All hypotheses, beside a model.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn first(&self, model: &Model) -> Result<Round, FilterError> {
        let model = model.clone();
        let base = self.coarsely_nm(&model)?;
        let residual_nm = self.residual_nm(&model)?;
        let known = self.known_columns(&base, &model)?;
        let mut linear = Linear {
            residual_nm,
            known,
            hypotheses: self.columns(&base, &model, self.hypotheses.clone())?,
        };
        let periodic = self.periodic_hypotheses(&model, &linear);
        linear
            .hypotheses
            .extend(self.columns(&base, &model, periodic)?);
        let roughness = self.roughness(&model, &linear.residual_nm)?;
        Ok(self.round(model, linear, roughness))
    }

    /// All hypotheses, beside a model with effects: responses about the model before are good enough to choose those
    /// whose responses are found anew.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn next(&self, before: &Round, model: &Model) -> Result<Round, FilterError> {
        self.next_with(before, model, None)
    }

    /// The same, with a term's hypothesis among those chosen, its response found at the size that it has: about nothing it may
    /// show none.
    ///
    /// # Errors
    /// [`FilterError`].
    pub(crate) fn next_with(
        &self,
        before: &Round,
        model: &Model,
        also: Option<&Term>,
    ) -> Result<Round, FilterError> {
        let mut model = model.clone();
        model.known.resize(self.twin.known.len(), 0.0);
        let base = self.coarsely_nm(&model)?;
        let mut linear = before.linear.clone();
        linear.residual_nm = self.residual_nm(&model)?;
        let periodic = self.periodic_hypotheses(&model, &linear);
        linear
            .hypotheses
            .extend(self.columns(&base, &model, periodic)?);
        let (rough, _) = self.scored(&model, &linear);
        let chosen = rough.scored.iter().take(ANEW);
        let mut anew: Vec<Hypothesis> = chosen.map(|scored| scored.hypothesis.clone()).collect();
        anew.extend(also.map(Term::at_its_size));
        linear.hypotheses = self.columns(&base, &model, anew)?;
        let roughness = self.roughness(&model, &linear.residual_nm)?;
        Ok(self.round(model, linear, roughness))
    }

    fn round(&self, model: Model, linear: Linear, roughness: f64) -> Round {
        let (mut ranking, blocks) = self.scored(&model, &linear);
        ranking.roughness = roughness;
        Round {
            model,
            ranking,
            linear,
            blocks,
        }
    }

    fn scored(&self, model: &Model, linear: &Linear) -> (Ranking, Blocks) {
        let rows = &self.twin.rows;
        let whitener = &self.whitener;
        let columns = linear.hypotheses.iter().flat_map(|(_, columns)| columns);
        let columns: Vec<&Vec<f64>> = columns.collect();
        let white: Vec<Vec<f64>> = columns.iter().on_all_cores(|c| whitener.apply(c)).collect();
        let white = linear.known.white.iter().chain(&white);
        let target = whitener.apply(&linear.residual_nm);
        let mut bounds = self.bounds();
        for (k, bound) in bounds.iter_mut().enumerate() {
            // a model that moved a known value already has less room left
            let moved = model.known.get(k).copied().unwrap_or(0.0);
            bound.range = bound.range.map(|limit| limit - moved);
        }
        for (hypothesis, columns) in &linear.hypotheses {
            bounds.extend(columns.iter().map(|_| self.hypothesis_bound(hypothesis)));
        }
        // the prior is about the file's values, not about the model's
        let prior_means: Vec<f64> = model.known.iter().map(|moved| -moved).collect();
        let blocks = Blocks::new(white, &target, &bounds, &prior_means, rows);
        let known: Vec<usize> = (0..linear.known.white.len()).collect();
        let none = blocks.held_out(&known);
        let without = blocks.all.fit(&known);
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
            .iter()
            .zip(&places)
            .on_all_cores(|((hypothesis, own), &(place, count))| {
                let chosen: Vec<usize> =
                    known.iter().copied().chain(place..place + count).collect();
                let fit = blocks.all.fit(&chosen);
                let amplitudes = fit.coefficients[known.len()..].to_vec();
                Scored {
                    hypothesis: hypothesis.clone(),
                    columns: place..place + count,
                    held_out: blocks.held_out(&chosen),
                    strain: strain(model, &fit.coefficients[..known.len()]),
                    size_nm: self.size_nm(own, &amplitudes),
                    amplitudes,
                }
            })
            .collect();
        scored.sort_by(|a, b| a.held_out.total().total_cmp(&b.held_out.total()));
        let friction = &self.twin.nominal.friction;
        let ranking = Ranking {
            none,
            none_strain,
            scored,
            rows: blocks.all.rows(),
            roughness: 0.0,
            joints: self.twin.joints(),
            file_falls: friction.curve.is_some() || !friction.stribeck.is_empty(),
            file_cycles: friction
                .periodic
                .iter()
                .map(|law| law.cycles_per_motor_rev)
                .collect(),
            is_aliased: self.twin.recorded_hz() < SLOWEST_LOOP_HZ,
            sees_torsion: [Channel::Torsion, Channel::Link]
                .iter()
                .any(|channel| self.twin.channels.contains(channel)),
        };
        (ranking, blocks)
    }

    /// What a torque of no named law would be worth beside a model, of each family: over what, and nats beyond those of a
    /// good twin. Known values are refitted with it, as they respond in a round. Beside effects what is
    /// worth it in one second only is an event that does not speak against them, but for pushes.
    pub fn structure(&self, round: &Round, refined: &Refined) -> Vec<(&'static str, f64)> {
        let shape_nats = self.shape_nats();
        let rows = &self.twin.rows;
        let white = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let columns = columns.iter();
            columns.map(|one| self.whitener.apply(one)).collect()
        };
        let known = &round.linear.known.white;
        let target = self.whitener.apply(&refined.residual_nm);
        let mut prior_means: Vec<f64> = refined.model.known.iter().map(|z| -z).collect();
        prior_means.resize(known.len(), 0.0);
        let beside = Beside::about(known, &target, &prior_means);
        let worth = |family: &Family| -> f64 {
            let nats = on_sides(family, rows).into_iter().map(|side| {
                let (information, vector) = beside.information(&matrix(&side.columns, rows.len()));
                evidence_nats(information, &vector, side.tried)
            });
            nats.fold(0.0, f64::max) - shape_nats
        };
        let model = &refined.model;
        let is_named = !(model.terms.is_empty() && model.settled.is_empty());
        let is_in_worst = self.in_worst_second(&target);
        families(self.twin, &refined.residual_nm)
            .into_iter()
            .on_all_cores(|mut family| {
                // each channel is whitened alone, so that it may be left out afterwards
                family.columns = white(&family.columns);
                let nats = worth(&family);
                if !is_named || family.over == PUSHES_OVER || nats <= 0.0 {
                    return (family.over, nats);
                }
                for column in &mut family.columns {
                    let rows = column.iter_mut().zip(&is_in_worst);
                    rows.filter(|(_, is_in)| **is_in)
                        .for_each(|(value, _)| *value = 0.0);
                }
                (family.over, nats.min(most_by_rest(worth(&family))))
            })
            .collect()
    }

    /// Half the squares that a steady vibration alone takes off a residual, at a frequency that is none of the motion's.
    pub(crate) fn vibration_gain(&self, residual_nm: &[f64]) -> f64 {
        let rows = &self.twin.rows;
        let others = self.twin.others_velocity_rad_s();
        let Some(vibration) = foreign_vibration(rows, residual_nm, &others) else {
            return 0.0;
        };
        let target = Beside::new(&[], &self.whitener.apply(residual_nm));
        let gain = |of: Family| {
            let pair = [0, 1].map(|k| self.whitener.apply(&of.columns[k]));
            0.5 * target.gains(&matrix(&pair, rows.len()))[0]
        };
        let sides = on_sides(&vibration, rows).into_iter();
        sides.map(gain).fold(0.0, f64::max)
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
}
