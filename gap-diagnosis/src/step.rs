//! One step of an explanation: every effect beside a model, the leading ones fitted by simulation.

use joint_model::filter::FilterError;

use crate::evidence::{
    Left, Probability, SAME_TORQUE, Simulated, Standings, standings, together, variance_of,
};
use crate::judge::Squares;
use crate::observe::Channel;
use crate::on_all_cores::OnAllCores;
use crate::rank::{ALIKE, Round};
use crate::refine::Refined;
use crate::search::{Model, Search, Term};

/// Effects that are fitted by simulation, not only by their linear response, before one is chosen; and how many where they are worth
/// being named.
const REFITTED: usize = 4;
const REFITTED_NAMED: usize = 7;
/// Nats within which another effect is refitted too, and the part of the best one's if that is more: strong effects do
/// not respond in proportion.
const NEAR_NATS: f64 = 30.0;
const NEAR_PART: f64 = 0.5;
/// Above this probability of `none` nothing is named.
const NONE_MOST: f64 = 0.3;

/// One step of the search.
#[derive(Clone, Debug)]
pub struct Step {
    /// Everything that was tried.
    pub round: Round,
    /// What it was worth.
    pub standings: Standings,
    /// As probabilities, most probable first.
    pub probabilities: Vec<Probability>,
    /// Effect that was added.
    pub added: Option<&'static str>,
    /// The model that effects were tried beside, known values fitted.
    pub base: Refined,
    /// What torques of no named law would be worth: over what, and nats beyond those of a good twin.
    pub structure: Vec<(&'static str, f64)>,
    /// The leading effects, fitted by simulation, best first.
    pub(crate) refitted: Vec<Refitted>,
    /// What the best of them is worth.
    pub best_nats: f64,
}

/// An effect fitted by simulation.
#[derive(Clone, Debug)]
pub(crate) struct Refitted {
    pub effect: &'static str,
    pub nats: f64,
    pub refined: Refined,
}

impl Refitted {
    /// Whether the effect that this adds to a model is in it already, or one that adds the same torque. What repeats with an angle
    /// may do so at several cycles.
    pub fn is_named_before(&self) -> bool {
        let model = &self.refined.model;
        let Some((added, before)) = model.terms.split_last() else {
            return false;
        };
        let added = &added.hypothesis;
        let mut names = before
            .iter()
            .chain(&model.settled)
            .map(|term| term.hypothesis.effect);
        !added.is_periodic()
            && names.any(|name| {
                let is_same_torque = |name: &str| SAME_TORQUE.contains(&name);
                name == added.effect || is_same_torque(name) && is_same_torque(added.effect)
            })
    }

    /// Whether the effect that this adds to a model repeats as often as another one that is in it already.
    pub fn is_companion(&self, before: &Model) -> bool {
        let Some(added) = self.refined.model.terms.last() else {
            return false;
        };
        before.terms.iter().any(|term| {
            let cycles = [term, added].map(|term| term.hypothesis.shape.first().copied());
            let alike = match cycles {
                [Some(a), Some(b)] => (a / b - 1.0).abs() < ALIKE,
                _ => false,
            };
            alike && term.hypothesis.is_periodic() && added.hypothesis.is_periodic()
        })
    }
}

impl Step {
    /// Refits the leading effects by simulation, and lets that decide among them.
    pub(crate) fn new(
        search: &Search<'_>,
        round: Round,
        base: &Refined,
    ) -> Result<Self, FilterError> {
        Self::beside(search, round, base, None)
    }

    /// The same, with an effect among them that was there before, the last one of a model.
    pub(crate) fn beside(
        search: &Search<'_>,
        round: Round,
        base: &Refined,
        before: Option<&Model>,
    ) -> Result<Self, FilterError> {
        let mut standings = standings(&round.ranking);
        let best_nats = standings.effects.first().map_or(0.0, |(_, nats)| *nats);
        let mut refitted = Vec::new();
        let of = |index: usize| &round.ranking.scored[index];
        let mut leading: Vec<usize> = standings
            .effects
            .iter()
            .take(REFITTED_NAMED)
            .enumerate()
            .filter(|(place, (_, nats))| {
                let near = NEAR_NATS.max(NEAR_PART * best_nats);
                let is_near = *nats > (best_nats - near).max(-NEAR_NATS / 3.0);
                is_near && (*place < REFITTED || *nats > 0.0)
            })
            .map(|(_, (index, _))| *index)
            .filter(|index| of(*index).size_nm > 0.0)
            .collect();
        // what a gear gives at large torques says little of small ones, so that linear responses do not tell in which way it gives
        let is_twist = |index: usize| of(index).hypothesis.gives();
        if leading.iter().any(|index| is_twist(*index)) {
            let all = standings.effects.iter().map(|(index, _)| *index);
            let others: Vec<usize> = all
                .filter(|index| is_twist(*index) && !leading.contains(index))
                .collect();
            leading.extend(others);
        }
        let was = before.and_then(|model| model.terms.last());
        let was_twist = was.is_some_and(|term| term.hypothesis.gives());
        let starts = leading
            .into_iter()
            .on_all_cores(|index| {
                let scored = of(index);
                let mut terms = vec![Term {
                    hypothesis: scored.hypothesis.clone(),
                    amplitudes: scored.amplitudes.clone(),
                }];
                if was_twist && is_twist(index) {
                    // what stands in its place is sought as widely as it was
                    terms.push(terms[0].without_size());
                }
                let start = search.starts(base, &terms)?.into_iter().next();
                Ok(start.map(|start| (index, start)))
            })
            .collect::<Result<Vec<_>, FilterError>>()?;
        let mut starts: Vec<(usize, Model)> = starts.into_iter().flatten().collect();
        if let Some((index, model)) = before.and_then(|model| {
            let effect = model.terms.last()?.hypothesis.effect;
            let mut effects = standings.effects.iter();
            let own = effects.find(|(i, _)| round.ranking.scored[*i].hypothesis.effect == effect);
            Some((own?.0, model))
        }) {
            // where it ended is a better start than its response
            starts.retain(|(other, _)| *other != index);
            starts.push((index, model.clone()));
        }
        let ends = starts
            .iter()
            .on_all_cores(|(_, model)| search.refine(&round, model))
            .collect::<Result<Vec<_>, FilterError>>()?;
        for ((index, _), refined) in starts.into_iter().zip(ends) {
            let left = search.left(&refined.model, &refined.residual_nm);
            let effect = round.ranking.scored[index].hypothesis.effect;
            // a joint that runs away in simulation explains nothing, nor does a lag that the drive's own torque speaks against
            let is_told =
                effect != "current_loop_lag" || !contradicts_drive(search, base, &refined);
            if is_told && left.total().is_finite() {
                refitted.push((index, left, refined));
            }
        }
        let base = best_base(search, &round, base, &refitted)?;
        let is_at_its_end = |term: &Term| term.hypothesis.is_at_its_end(&search.scale);
        let simulated: Vec<Simulated> = refitted
            .iter()
            .map(|(index, left, refined)| {
                let hypothesis = &of(*index).hypothesis;
                let is_twist = hypothesis.is_hidden_twist(round.ranking.sees_torsion);
                Simulated {
                    index: *index,
                    left: *left,
                    most_in_a_second: search
                        .most_in_a_second(&base.residual_nm, &refined.residual_nm),
                    // what shows at reversals, where no twin is to be trusted, is doubted in full
                    certainty: search.certainty((!is_twist).then_some(&base), refined),
                    is_law: !refined.model.terms.last().is_some_and(is_at_its_end),
                }
            })
            .collect();
        // where an effect is put back nobody asks what is left without it
        let structure = match before {
            None => search.structure(&round, &base),
            Some(_) => Vec::new(),
        };
        let without = search.left(&base.model, &base.residual_nm);
        standings.refit(&round.ranking, without, &simulated);
        let mut refitted: Vec<Refitted> = refitted
            .into_iter()
            .map(|(index, _, refined)| Refitted {
                effect: round.ranking.scored[index].hypothesis.effect,
                nats: standings.nats_of(index),
                refined,
            })
            .collect();
        refitted.sort_by(|a, b| b.nats.total_cmp(&a.nats).then(a.effect.cmp(b.effect)));
        Ok(Self {
            best_nats: refitted.first().map_or(0.0, |best| best.nats),
            base,
            structure,
            probabilities: standings.probabilities(&round.ranking),
            standings,
            round,
            refitted,
            added: None,
        })
    }

    /// What another model is worth, in nats, before the cost of its names.
    pub(crate) fn worth(&self, search: &Search<'_>, refined: &Refined) -> f64 {
        let [without, left] =
            [&self.base, refined].map(|of| search.left(&of.model, &of.residual_nm));
        let ranking = &self.round.ranking;
        let variance = variance_of(ranking, left.square.min(without.square));
        together(ranking, [without, left], variance, [])
    }

    /// Of an effect or of none, among those beside this model.
    pub fn probability_of(&self, effect: &str) -> f64 {
        let mut probabilities = self.probabilities.iter();
        probabilities
            .find(|p| p.effect == effect)
            .map_or(0.0, |p| p.probability)
    }

    /// What each effect is worth, in nats.
    pub(crate) fn nats_by_name(&self) -> Vec<(&'static str, f64)> {
        let effects = self.standings.effects.iter();
        let scored = &self.round.ranking.scored;
        effects
            .map(|(index, nats)| (scored[*index].hypothesis.effect, *nats))
            .collect()
    }

    /// Whether something outweighs `none`: several effects that are alike may only do so together.
    pub fn outweighs_none(&self) -> bool {
        self.probability_of("none") < NONE_MOST
    }

    /// The step, with what was added.
    pub(crate) fn with(mut self, best: &Refitted) -> Self {
        self.standings.choose(&self.round.ranking, best.effect);
        self.probabilities = self.standings.probabilities(&self.round.ranking);
        self.added = Some(best.effect);
        self.best_nats = best.nats;
        self
    }

    /// The step, with no effect worth naming.
    pub(crate) fn unnamed(mut self) -> Self {
        // what comes nearest still says where to look
        let mut standings = self.standings.clone();
        standings.quiet();
        self.probabilities = standings.probabilities(&self.round.ranking);
        self
    }

    /// Nothing beyond noise: no explanation is worth naming.
    pub(crate) fn quiet(round: Round, base: &Refined) -> Self {
        let mut standings = standings(&round.ranking);
        standings.quiet();
        Self {
            best_nats: 0.0,
            base: base.clone(),
            structure: Vec::new(),
            probabilities: standings.probabilities(&round.ranking),
            standings,
            round,
            refitted: Vec::new(),
            added: None,
        }
    }
}

/// Whether a model leaves more between command and reported torque than another.
fn contradicts_drive(search: &Search<'_>, before: &Refined, after: &Refined) -> bool {
    let [before, after] =
        [before, after].map(|of| Squares::of(search, &of.residual_nm, Channel::Drive).mean());
    after > before
}

/// The base, or a better fit of it: an effect that is not there may still have led its fit to better known values.
fn best_base(
    search: &Search<'_>,
    round: &Round,
    base: &Refined,
    refitted: &[(usize, Left, Refined)],
) -> Result<Refined, FilterError> {
    let mut best = base.clone();
    let mut least = search.objective(&best.model, &best.residual_nm);
    for (_, left, refined) in refitted {
        let mut stripped = refined.model.clone();
        stripped.terms.pop();
        if left.total() >= least {
            continue;
        }
        let residual_nm = search.residual_nm(&stripped)?;
        if search.objective(&stripped, &residual_nm) < least {
            best = search.refine(round, &stripped)?;
            least = search.objective(&best.model, &best.residual_nm);
        }
    }
    Ok(best)
}

/// Whether any channel shows more than so many times noise and the twin's own errors, as squares.
pub(crate) fn is_beyond(search: &Search<'_>, residual_nm: &[f64], times: f64) -> bool {
    search.twin.channels.iter().any(|&channel| {
        let square = Squares::of(search, residual_nm, channel).mean();
        square > times * search.twin_floor_nm(channel).powi(2)
    })
}
