//! A joint's explanation: effects are added one at a time while they are worth it, and taken back if they no longer are.

use joint_model::filter::FilterError;

use crate::evidence::{
    Left, Probability, Remains, Simulated, Standings, remains, standings, together,
    unknown_probability, variance_of,
};
use crate::hypothesis::Hypothesis;
use crate::judge::Squares;
use crate::rank::{ALIKE, Round};
use crate::refine::Refined;
use crate::search::{Model, Search, Term, strain};
use crate::trust::Trust;

/// The most effects of one joint.
pub const EFFECTS_MAX: usize = 3;
/// How often the effects that were added are looked at again.
const SWEEPS: usize = 2;
/// Effects that are fitted by simulation, not only by their linear response, before one is chosen.
const REFITTED: usize = 4;
/// Nats within which another effect is refitted too, and the part of the best one's if that is more: strong effects do
/// not respond in proportion.
const NEAR_NATS: f64 = 30.0;
const NEAR_PART: f64 = 0.5;
/// Effects of the gear's twist: what it does at large torques says little of small ones, so that linear responses do not tell
/// which of them it is.
const TWIST: [&str; 3] = ["torsional_compliance", "soft_windup", "backlash"];
/// Effects of which one is in a pair that is tried, and pairs that are fitted by simulation.
const PAIRS_OF: usize = 8;
const PAIRS: usize = 3;
/// Nats that a second or third effect must be worth, and part of the first one's up to some nats: no law is exact.
const FURTHER_NATS: f64 = 6.0;
const FURTHER_PART: f64 = 0.01;
const FURTHER_MOST_NATS: f64 = 40.0;
/// The same for one that repeats over the angle as an effect before does.
const COMPANION_PART: f64 = 0.05;
/// Standard deviations of a sum of squares above its mean at which known values are strained.
const STRAINED: f64 = 3.0;

/// What explains a joint's residual.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// The final model.
    pub refined: Refined,
    /// The robot file's model with known values refitted, without effects.
    pub without: Refined,
    /// Each step's candidates: those of the first, then those beside the effects before.
    pub rounds: Vec<Step>,
    named_gain: f64,
}

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
    refitted: Vec<Refitted>,
    /// What the best of them is worth.
    pub best_nats: f64,
}

/// An effect fitted by simulation.
#[derive(Clone, Debug)]
struct Refitted {
    effect: &'static str,
    nats: f64,
    refined: Refined,
}

impl Refitted {
    /// Whether the effect that this adds to a model repeats as often as another one that is in it already.
    fn is_companion(&self, before: &Model) -> bool {
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

impl Explanation {
    /// The step that added nothing more.
    pub fn last(&self) -> &Step {
        // an explanation has at least one step
        &self.rounds[self.rounds.len() - 1]
    }

    /// Half the squares and strain that the effects that were added take off, in units of noise and twin error.
    pub fn named_gain(&self) -> f64 {
        self.named_gain
    }

    /// Whether a torque of no named law is left.
    pub fn remains(&self) -> Remains {
        remains(&self.last().structure, self.named_gain())
    }

    /// Probability that the cause is on no list.
    pub fn unknown_probability(&self) -> f64 {
        unknown_probability(&self.last().structure, self.named_gain())
    }
}

/// Explains a joint's residual, beside effects that are already settled.
///
/// # Errors
/// [`FilterError`].
pub fn explain(search: &Search<'_>, settled: &[Term]) -> Result<Explanation, FilterError> {
    let start = Model {
        known: vec![0.0; search.twin.known.len()],
        terms: settled.to_vec(),
    };
    let (round, without) = known_fitted(search, &start)?;
    let trust = Trust::of(search.twin.joints());
    let is_gap = is_beyond(search, &search.residual_nm(&start)?, trust.by_file)
        && is_beyond(search, &without.residual_nm, trust.by_known);
    let first = if is_gap {
        Step::new(search, round, &without)?
    } else {
        Step::quiet(round, &without)
    };
    let mut growing = Growing {
        search,
        settled: settled.len(),
        first: &first.round,
        refined: first.base.clone(),
        added: Vec::new(),
        last: first.clone(),
    };
    let without = first.base.clone();
    growing.grow()?;
    growing.settle()?;
    if is_gap && (growing.added.len() > 1 || growing.is_left(&without) || growing.is_strained()) {
        growing.start_anew(&first)?;
    }
    let named_gain = growing.named_gain(&without);
    let mut rounds = growing.added;
    rounds.push(growing.last);
    let explanation = Explanation {
        refined: growing.refined,
        without: without.clone(),
        rounds,
        named_gain,
    };
    if explanation.named_gain() > 0.0 && explanation.remains() == Remains::Most {
        // names that leave most of it would be wrong names
        return Ok(Explanation {
            refined: without.clone(),
            without,
            rounds: vec![first.unnamed()],
            named_gain: 0.0,
        });
    }
    Ok(explanation)
}

/// An explanation in the making. Effects of the model beyond the settled ones are in the order of `added`.
#[derive(Clone)]
struct Growing<'a, 's> {
    search: &'a Search<'s>,
    settled: usize,
    first: &'a Round,
    refined: Refined,
    added: Vec<Step>,
    last: Step,
}

impl Growing<'_, '_> {
    /// Reconsiders what was added until it stays.
    fn settle(&mut self) -> Result<(), FilterError> {
        for _ in 0..SWEEPS {
            if self.added.len() < 2 || !self.reconsider()? {
                break;
            }
            self.grow()?;
        }
        Ok(())
    }

    /// Half the squares and strain that the effects take off.
    fn named_gain(&self, without: &Refined) -> f64 {
        if self.added.is_empty() {
            return 0.0;
        }
        let total = |of: &Refined| self.search.left(&of.model, &of.residual_nm).total();
        0.5 * (total(without) - total(&self.refined))
    }

    /// Whether a torque of no named law is left.
    fn is_left(&self, without: &Refined) -> bool {
        remains(&self.last.structure, self.named_gain(without)) != Remains::Nothing
    }

    /// Whether the known values had to move further than their tolerances let all of them together: they stand in for an
    /// effect that is missing.
    fn is_strained(&self) -> bool {
        let count = self.refined.model.known.len() as f64;
        strain(&self.refined.model, &[]) > count + STRAINED * (2.0 * count).sqrt()
    }

    /// Begins anew with two effects at once, since the one that takes off most alone need not be one of the two that are
    /// there; or with one of twist from sizes of its own, since known values that stand in for it leave no response to it.
    fn start_anew(&mut self, first: &Step) -> Result<(), FilterError> {
        let search = self.search;
        let ranking = &first.round.ranking;
        let leading = first.standings.effects.iter().take(PAIRS_OF);
        let leading: Vec<usize> = leading.map(|(index, _)| *index).collect();
        let left = |refined: &Refined| search.left(&refined.model, &refined.residual_nm);
        let without = left(&first.base);
        let worth = |refined: &Refined, variance: f64| {
            let terms = &refined.model.terms[self.settled..];
            let effects = terms.iter().map(|term| &term.hypothesis);
            together(ranking, [without, left(refined)], variance, effects)
        };
        let with = |terms: Vec<Term>| {
            let mut model = first.base.model.clone();
            model.terms.extend(terms);
            model
        };
        let pairs = first.round.pairs(&leading, PAIRS).into_iter();
        let mut starts: Vec<Model> = pairs.map(|pair| with(pair.into())).collect();
        for effect in TWIST {
            let mut scored = ranking.scored.iter();
            if let Some(scored) = scored.find(|scored| scored.hypothesis.effect == effect) {
                let hypothesis = scored.hypothesis.clone();
                let amplitudes = vec![0.0; hypothesis.amplitudes()];
                let term = Term {
                    hypothesis,
                    amplitudes,
                };
                starts.push(search.nearer(with(vec![term]))?);
            }
        }
        let mut best: Option<Refined> = None;
        for model in starts {
            let refined = search.refine(&first.round, &model)?;
            let total = left(&refined).total();
            if total.is_finite() && best.as_ref().is_none_or(|best| total < left(best).total()) {
                best = Some(refined);
            }
        }
        let Some(best) = best else {
            return Ok(());
        };
        let variance = |other: &Refined| {
            let least = left(&self.refined).square.min(left(other).square);
            variance_of(ranking, least)
        };
        let at = variance(&best);
        if worth(&best, at) <= worth(&self.refined, at) + FURTHER_NATS {
            return Ok(());
        }
        let mut other = self.clone();
        other.added = vec![first.clone(); best.model.terms.len() - self.settled];
        other.refined = best;
        other.reconsider()?;
        other.look()?;
        other.grow()?;
        other.settle()?;
        let at = variance(&other.refined);
        if worth(&other.refined, at) > worth(&self.refined, at) {
            *self = other;
        }
        Ok(())
    }

    /// Looks at what is left.
    fn look(&mut self) -> Result<(), FilterError> {
        let last = self.search.next(self.first, &self.refined.model)?;
        self.last = Step::new(self.search, last, &self.refined)?;
        self.refined = self.last.base.clone();
        Ok(())
    }

    /// Adds effects one at a time while they are worth it.
    fn grow(&mut self) -> Result<(), FilterError> {
        while self.added.len() < EFFECTS_MAX {
            let Some(best) = self.best(&self.last) else {
                break;
            };
            let next = self.search.next(self.first, &best.refined.model)?;
            let next = Step::new(self.search, next, &best.refined)?;
            let step = std::mem::replace(&mut self.last, next);
            self.added.push(step.with(&best));
            self.refined = self.last.base.clone();
        }
        Ok(())
    }

    /// The best effect of a step that is worth being added. Several that are alike may only together outweigh none.
    fn best(&self, step: &Step) -> Option<Refitted> {
        let is_gap = self.added.is_empty() && step.probability_of("none") < 0.5;
        let mut refitted = step.refitted.iter();
        refitted
            .find(|best| is_gap || best.nats >= self.worth(best))
            .cloned()
    }

    /// What an effect must be worth beside those already added.
    fn worth(&self, best: &Refitted) -> f64 {
        if self.added.is_empty() {
            return 0.0;
        }
        let added = best.refined.model.terms.last().map(|t| &t.hypothesis);
        // what changes with every turn of the motor is not off by what changes with the load
        let is_slow = added.is_some_and(Hypothesis::is_slow);
        let terms = &self.refined.model.terms[self.settled..];
        let before = self.added.iter().zip(terms);
        let before = before.filter(|(_, term)| !(is_slow && term.hypothesis.is_periodic()));
        let most = before.map(|(step, _)| step.best_nats);
        let most = most.fold(0.0, f64::max);
        if best.is_companion(&self.refined.model) {
            most * COMPANION_PART
        } else {
            let part = most * FURTHER_PART;
            let is_periodic = added.is_some_and(Hypothesis::is_periodic);
            // what repeats with an angle can be found in anything that is left
            let enough = if self.is_strained() {
                0.0
            } else if is_periodic {
                part
            } else {
                part.min(FURTHER_MOST_NATS)
            };
            enough.max(FURTHER_NATS)
        }
    }

    /// Takes each effect out and asks again what belongs beside the others: the first may have stood for a part of what
    /// came later. True if anything changed.
    fn reconsider(&mut self) -> Result<bool, FilterError> {
        let mut changed = false;
        for _ in 0..self.added.len() {
            let before = self.added.remove(0);
            let mut model = self.refined.model.clone();
            let taken = model.terms.remove(self.settled);
            let base = self.search.refine(self.first, &model)?;
            let step = self.search.next(self.first, &base.model)?;
            model.terms.push(taken);
            let step = Step::beside(self.search, step, &base, Some(&model))?;
            let kept = std::mem::replace(&mut self.refined, base);
            match self.best(&step) {
                Some(best) => {
                    changed |= Some(best.effect) != before.added;
                    self.added.push(step.with(&best));
                    self.refined = best.refined;
                }
                None if self.added.is_empty() && before.added.is_some() => {
                    // the last one stays what it was
                    self.refined = kept;
                    self.added.push(before);
                }
                None => changed = true,
            }
        }
        if changed {
            self.look()?;
        }
        Ok(changed)
    }
}

/// Fits effects of given names, the one that takes off most first, without asking whether they are worth it.
///
/// # Errors
/// [`FilterError`].
pub fn with_structure(
    search: &Search<'_>,
    settled: &[Term],
    names: &[&str],
) -> Result<Refined, FilterError> {
    let start = Model {
        known: vec![0.0; search.twin.known.len()],
        terms: settled.to_vec(),
    };
    let (mut round, mut refined) = known_fitted(search, &start)?;
    let mut open: Vec<&str> = names.to_vec();
    while !open.is_empty() {
        let scored = round.ranking.scored.iter();
        let Some(best) = scored.clone().find(|s| open.contains(&s.hypothesis.effect)) else {
            break;
        };
        open.retain(|name| *name != best.hypothesis.effect);
        let mut model = refined.model.clone();
        model.terms.push(Term {
            hypothesis: best.hypothesis.clone(),
            amplitudes: best.amplitudes.clone(),
        });
        refined = search.refine(&round, &model)?;
        if !open.is_empty() {
            round = search.next(&round, &refined.model)?;
        }
    }
    Ok(refined)
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

/// Known values fitted, and everything beside them. They do not respond in proportion: their responses are found again
/// where the first fit ends.
fn known_fitted(search: &Search<'_>, start: &Model) -> Result<(Round, Refined), FilterError> {
    let round = search.known_alone(start)?;
    let rough = search.refine(&round, start)?;
    let round = search.first(&rough.model)?;
    let fitted = search.refine(&round, &rough.model)?;
    Ok((round, fitted))
}

/// Whether any channel shows more than so many times noise and the twin's own errors, as squares.
fn is_beyond(search: &Search<'_>, residual_nm: &[f64], times: f64) -> bool {
    search.twin.channels.iter().any(|&channel| {
        let square = Squares::of(search, residual_nm, channel).mean();
        square > times * search.twin_floor_nm(channel).powi(2)
    })
}

impl Step {
    /// Refits the leading effects by simulation, and lets that decide among them.
    fn new(search: &Search<'_>, round: Round, base: &Refined) -> Result<Self, FilterError> {
        Self::beside(search, round, base, None)
    }

    /// The same, with an effect among them that was there before, the last one of a model.
    fn beside(
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
            .take(REFITTED)
            .filter(|(_, nats)| {
                let near = NEAR_NATS.max(NEAR_PART * best_nats);
                *nats > (best_nats - near).max(-NEAR_NATS / 3.0)
            })
            .map(|(index, _)| *index)
            .filter(|index| of(*index).size_nm > 0.0)
            .collect();
        let is_twist = |index: usize| TWIST.contains(&of(index).hypothesis.effect);
        if leading.iter().any(|index| is_twist(*index)) {
            let all = standings.effects.iter().map(|(index, _)| *index);
            let others: Vec<usize> = all
                .filter(|index| is_twist(*index) && !leading.contains(index))
                .collect();
            leading.extend(others);
        }
        let mut starts: Vec<(usize, Model)> = leading
            .into_iter()
            .map(|index| {
                let scored = of(index);
                let mut model = base.model.clone();
                model.terms.push(Term {
                    hypothesis: scored.hypothesis.clone(),
                    amplitudes: scored.amplitudes.clone(),
                });
                Ok((index, search.nearer(model)?))
            })
            .collect::<Result<_, FilterError>>()?;
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
        for (index, model) in starts {
            let refined = search.refine(&round, &model)?;
            let left = search.left(&refined.model, &refined.residual_nm);
            // a joint that runs away in simulation explains nothing
            if left.total().is_finite() {
                refitted.push((index, left, refined));
            }
        }
        let simulated: Vec<Simulated> = refitted
            .iter()
            .map(|(index, left, refined)| Simulated {
                index: *index,
                left: *left,
                certainty: search.certainty(refined),
            })
            .collect();
        let base = best_base(search, &round, base, &refitted)?;
        let of_any_shape = Trust::of(search.twin.joints()).of_any_shape;
        let structure = if is_beyond(search, &base.residual_nm, of_any_shape) {
            search.structure(&round, &base)
        } else {
            Vec::new()
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

    /// Of an effect or of none, among those beside this model.
    pub fn probability_of(&self, effect: &str) -> f64 {
        let mut probabilities = self.probabilities.iter();
        probabilities
            .find(|p| p.effect == effect)
            .map_or(0.0, |p| p.probability)
    }

    /// The step, with what was added.
    fn with(mut self, best: &Refitted) -> Self {
        self.added = Some(best.effect);
        self.best_nats = best.nats;
        self
    }

    /// The step, with no effect worth naming.
    fn unnamed(mut self) -> Self {
        // what comes nearest still says where to look
        let mut standings = self.standings.clone();
        standings.quiet();
        self.probabilities = standings.probabilities(&self.round.ranking);
        self
    }

    /// Nothing beyond noise: no explanation is worth naming.
    fn quiet(round: Round, base: &Refined) -> Self {
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
