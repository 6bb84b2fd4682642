//! A joint's explanation: effects are added one at a time while they are worth it, and taken back if they no longer are.

use joint_model::filter::FilterError;

use crate::evidence::{
    Left, Remains, cost_in_file, most_left, remains, together, unknown_probability, variance_of,
};
use crate::hypothesis::{Hypothesis, giving};
use crate::judge::{Squares, shrink_alone, shrink_of};
use crate::observe::Channel;
use crate::rank::Round;
use crate::refine::Refined;
use crate::search::{Model, Search, Term, strain};
use crate::shapes::PUSHES_OVER;
use crate::step::{Refitted, Step, is_beyond};
use crate::trust::Trust;

/// The most effects of one joint.
pub const EFFECTS_MAX: usize = 3;
/// How often the effects that were added are looked at again.
const SWEEPS: usize = 2;
/// Effects of which one is in a pair that is tried, and pairs that are fitted by simulation.
const PAIRS_OF: usize = 8;
const PAIRS: usize = 3;
/// Sizes from which an effect of twist is fitted anew.
const STARTS: usize = 2;
/// Nats behind what was found within which the best of other starts is fitted again, with responses found where it ended.
const BEHIND_NATS: f64 = 100.0;
/// Nats that a second or third effect must be worth, and part of the first one's up to some nats: no law is exact.
pub(crate) const FURTHER_NATS: f64 = 6.0;
pub(crate) const FURTHER_PART: f64 = 0.01;
pub(crate) const FURTHER_MOST_NATS: f64 = 40.0;
/// The same for one that repeats over the angle as an effect before does.
const COMPANION_PART: f64 = 0.05;
/// Nats that an effect must be worth that only another start finds where nothing was named: of so many starts one ends by chance
/// where it takes a little off.
const ANEW_NATS: f64 = 30.0;
/// Shrink below which effects make the gap larger.
const WORSE: f64 = -0.05;
/// Part of what names take off that a vibration takes off without any known value refitted: then it is the simpler cause.
const AS_MUCH: f64 = 0.9;
/// The same for any smooth torque, where one name stands for several numbers of cycles: those are then terms of its series.
const AS_MUCH_OF_SERIES: f64 = 0.8;
/// Standard deviations of a sum of squares above its mean at which known values are strained.
const STRAINED: f64 = 3.0;
/// Times noise and the twin's own errors, as squares, up to which one effect is taken for all there is.
pub(crate) const WELL_EXPLAINED: f64 = 2.0;

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
    settled_gain: f64,
}

impl Explanation {
    /// The step that added nothing more.
    pub fn last(&self) -> &Step {
        // an explanation has at least one step
        &self.rounds[self.rounds.len() - 1]
    }

    /// Whether anything is told of the joint: effects, or a torque of no named law.
    pub(crate) fn is_told(&self) -> bool {
        !self.refined.model.terms.is_empty() || self.remains() != Remains::Nothing
    }

    /// Half the squares and strain that the effects that were added take off, in units of noise and twin error.
    pub fn named_gain(&self) -> f64 {
        self.named_gain
    }

    /// The same with what was settled before: those laws are not exact either.
    fn all_gain(&self) -> f64 {
        self.named_gain + self.settled_gain
    }

    /// Whether a torque of no named law is left.
    pub fn remains(&self) -> Remains {
        remains(&self.last().structure, self.all_gain())
    }

    /// Whether the names only imitate something else: they leave most of it, or a steady vibration takes off as much, or a smooth
    /// torque does, where they leave something or are terms of its series, or the gap is larger with them.
    fn is_imitation(&self, search: &Search<'_>, first: &Step) -> Result<bool, FilterError> {
        let part = if self.is_repeated() {
            AS_MUCH_OF_SERIES
        } else if self.remains() == Remains::Something {
            1.0
        } else {
            f64::INFINITY
        };
        let smooth_nats = most_left(&first.structure).map_or(0.0, |(_, nats)| nats);
        Ok(self.remains() == Remains::Most
            || search.vibration_gain(&first.base.residual_nm) > AS_MUCH * self.named_gain()
            || smooth_nats > part * self.named_gain()
            || self.is_worse(search)?)
    }

    /// Whether the gap is larger with the names than as the robot file has it: squares may fall where rows count and rise where
    /// they count little. What is within the twin's errors is no gap with them either.
    fn is_worse(&self, search: &Search<'_>) -> Result<bool, FilterError> {
        let start = Model::of_settled(search, &self.refined.model.settled);
        let before_nm = search.residual_nm(&start)?;
        let after_nm = &self.refined.residual_nm;
        let after = Squares::of(search, after_nm, Channel::Motor).mean();
        let floor = search.twin_floor_nm(Channel::Motor).powi(2);
        Ok(after > WELL_EXPLAINED * floor && shrink_of(search, &before_nm, after_nm) < WORSE)
    }

    /// Whether one name stands for several numbers of cycles.
    fn is_repeated(&self) -> bool {
        let terms = &self.refined.model.terms;
        let named = |term: usize| &terms[term].hypothesis;
        (0..terms.len()).any(|one| (0..one).any(|other| named(one).repeats(named(other))))
    }

    /// Probability that the cause is on no list.
    pub fn unknown_probability(&self) -> f64 {
        unknown_probability(&self.last().structure, self.all_gain())
    }
}

/// Explains a joint's residual, beside effects that are already settled.
///
/// # Errors
/// [`FilterError`].
pub fn explain(search: &Search<'_>, settled: &[Term]) -> Result<Explanation, FilterError> {
    Beginning::of(search, settled)?.explain(search)
}

/// What explains a joint's residual, as far as one effect.
#[derive(Clone, Debug)]
pub struct Beginning {
    /// Every effect beside what is known and settled.
    pub(crate) first: Step,
    /// Whether there is more than what a twin gets wrong.
    is_gap: bool,
    /// Responses of every effect, where those of the step are of some only.
    responses: Option<Round>,
}

impl Beginning {
    /// Beside effects that are already settled.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn of(search: &Search<'_>, settled: &[Term]) -> Result<Self, FilterError> {
        let start = Model::of_settled(search, settled);
        let (round, without) = known_fitted(search, &start)?;
        Self::from(search, round, without)
    }

    /// The same with one effect more settled: what responded without it still tells which effects are worth a look.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn beside(&self, search: &Search<'_>, term: &Term) -> Result<Self, FilterError> {
        let mut start = Model::of_settled(search, &self.first.base.model.settled);
        start.settled.push(term.clone());
        let before = self.responses();
        let rough = search.refine(before, &start)?;
        let round = search.next(before, &rough.model)?;
        let without = search.refine(&round, &rough.model)?;
        let mut beginning = Self::from(search, round, without)?;
        beginning.responses = Some(before.clone());
        Ok(beginning)
    }

    fn from(search: &Search<'_>, round: Round, without: Refined) -> Result<Self, FilterError> {
        let start = Model::of_settled(search, &without.model.settled);
        let trust = Trust::of(search.twin.joints());
        let is_gap = is_beyond(search, &search.residual_nm(&start)?, trust.by_file)
            && is_beyond(search, &without.residual_nm, trust.by_known);
        let first = if is_gap {
            Step::new(search, round, &without)?
        } else {
            Step::quiet(round, &without)
        };
        Ok(Self {
            first,
            is_gap,
            responses: None,
        })
    }

    fn responses(&self) -> &Round {
        self.responses.as_ref().unwrap_or(&self.first.round)
    }

    /// The whole explanation.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn explain(&self, search: &Search<'_>) -> Result<Explanation, FilterError> {
        let first = &self.first;
        let is_gap = self.is_gap;
        let mut growing = Growing {
            search,
            responses: self.responses().clone(),
            refined: first.base.clone(),
            added: Vec::new(),
            last: first.clone(),
        };
        let without = first.base.clone();
        growing.grow()?;
        growing.settle()?;
        if is_gap {
            growing.start_anew(first)?;
        }
        let is_series = growing.drop_series()?;
        let named_gain = growing.named_gain(&without);
        let settled_gain = settled_gain(search, &without)?;
        let mut rounds = growing.added;
        rounds.push(growing.last);
        let explanation = Explanation {
            refined: growing.refined,
            without: without.clone(),
            rounds,
            named_gain,
            settled_gain,
        };
        let is_named = explanation.named_gain() > 0.0;
        if is_series && !is_named || is_named && explanation.is_imitation(search, first)? {
            return Ok(Explanation {
                refined: without.clone(),
                without,
                rounds: vec![first.clone().unnamed()],
                named_gain: 0.0,
                settled_gain,
            });
        }
        Ok(explanation)
    }
}

/// An explanation in the making. Effects of the model are in the order of `added`.
#[derive(Clone)]
struct Growing<'a, 's> {
    search: &'a Search<'s>,
    /// Of every effect.
    responses: Round,
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

    /// Effects that each make the gap larger and help against one another only, as terms of a series do.
    fn series(&self) -> Result<Vec<usize>, FilterError> {
        let model = &self.refined.model;
        if model.terms.len() < 2 {
            return Ok(Vec::new());
        }
        let start = Model::of_settled(self.search, &model.settled);
        let before_nm = self.search.residual_nm(&start)?;
        let terms = 0..model.terms.len();
        let is_worse: Vec<bool> = terms
            .map(|term| {
                let shrink =
                    shrink_alone(self.search, &self.refined, &model.settled, term, &before_nm);
                shrink < WORSE
            })
            .collect();
        let has_torque_sensor = self.search.twin.channels.contains(&Channel::Link);
        let is_of_series = |term: &usize| {
            let mut others = (0..is_worse.len()).filter(|other| other != term && is_worse[*other]);
            let hypothesis = |term: usize| &model.terms[term].hypothesis;
            is_worse[*term]
                && others.any(|other| {
                    hypothesis(*term).is_in_series_with(hypothesis(other), has_torque_sensor)
                })
        };
        Ok((0..is_worse.len()).filter(is_of_series).collect())
    }

    /// Takes the effects of a series out. True if there were some.
    fn drop_series(&mut self) -> Result<bool, FilterError> {
        let series = self.series()?;
        if series.is_empty() {
            return Ok(false);
        }
        let mut rest = self.refined.model.clone();
        for term in series.into_iter().rev() {
            rest.terms.remove(term);
            self.added.remove(term);
        }
        self.refined = self.search.refine(&self.responses, &rest)?;
        self.look()?;
        Ok(true)
    }

    /// Whether a torque of no named law is left that an effect may be: pushes at a few moments are none.
    fn is_left(&self, without: &Refined) -> bool {
        let structure = self.last.structure.iter();
        let lasting: Vec<_> = structure
            .filter(|(over, _)| *over != PUSHES_OVER)
            .copied()
            .collect();
        remains(&lasting, self.named_gain(without)) != Remains::Nothing
    }

    /// Whether the known values had to move further than their tolerances let all of them together: they stand in for an
    /// effect that is missing.
    fn is_strained(&self) -> bool {
        let count = self.refined.model.known.len() as f64;
        strain(&self.refined.model, &[]) > count + STRAINED * (2.0 * count).sqrt()
    }

    /// Whether a known value had to move as far as it may.
    fn is_at_bound(&self) -> bool {
        let known = self.refined.model.known.iter();
        let mut bounded = known.zip(self.search.bounds());
        // what cannot be negative is at zero where nothing moved it
        bounded.any(|(value, bound)| bound.end(*value).is_some_and(|end| end != 0.0))
    }

    /// Whether another start may end elsewhere: none or several effects were named, something is left, more than noise and the
    /// twin's own errors is, or known values stand in for an effect.
    fn may_have_missed(&self, without: &Refined) -> bool {
        self.added.len() != 1
            || self.is_left(without)
            || self.is_strained()
            || self.is_at_bound()
            || is_beyond(self.search, &self.refined.residual_nm, WELL_EXPLAINED)
    }

    /// Models of two effects at once, since the one that takes off most alone need not be one of the two that are there: all that are
    /// leading, or those only whose responses tell more than that of any one effect.
    fn pairs(&self, first: &Step, must_lead: bool) -> Vec<Model> {
        let leading = first.standings.effects.iter().take(PAIRS_OF);
        let leading: Vec<usize> = leading.map(|(index, _)| *index).collect();
        let more = if must_lead {
            FURTHER_NATS
        } else {
            f64::NEG_INFINITY
        };
        let pairs = first.round.pairs(&leading, PAIRS, more).into_iter();
        let models = pairs.map(|pair| {
            let mut model = first.base.model.clone();
            model.terms.extend(pair);
            model
        });
        models.collect()
    }

    /// Models with an effect of twist at a size of its own, alone and beside what was added: known values that stand in for it leave
    /// no response to it.
    fn twisted(&self, first: &Step) -> Result<Vec<Model>, FilterError> {
        let added = &self.refined.model.terms;
        let gives = |term: &Term| term.hypothesis.gives();
        let has_room = (1..EFFECTS_MAX).contains(&added.len()) && !added.iter().any(gives);
        let beside = has_room.then_some(&self.refined);
        let mut models = Vec::new();
        for effect in giving() {
            let mut terms: Vec<Term> = Vec::new();
            for scored in &first.round.ranking.scored {
                let hypothesis = &scored.hypothesis;
                let is_there = |of: &Term| of.hypothesis.shape == hypothesis.shape;
                if hypothesis.effect == effect && !terms.iter().any(is_there) {
                    terms.push(Term {
                        hypothesis: hypothesis.clone(),
                        amplitudes: vec![0.0; hypothesis.amplitudes()],
                    });
                }
            }
            terms.retain(|term| self.may_be_worth(first, term));
            if !terms.is_empty() {
                for refined in [Some(&first.base), beside].into_iter().flatten() {
                    let starts = self.search.starts(refined, &terms)?;
                    models.extend(starts.into_iter().take(STARTS));
                }
            }
        }
        Ok(models)
    }

    /// Whether an effect may be worth a name that only another start finds: where nothing was named it takes off no more than there is.
    fn may_be_worth(&self, first: &Step, term: &Term) -> bool {
        if !self.added.is_empty() {
            return true;
        }
        let ranking = &first.round.ranking;
        let left = self
            .search
            .left(&self.refined.model, &self.refined.residual_nm);
        let least = Trust::of(ranking.joints).least;
        together(ranking, [left, Left::default()], least, [term]) > ANEW_NATS
    }

    /// Begins anew from elsewhere, and keeps what comes of it if it is worth more.
    fn start_anew(&mut self, first: &Step) -> Result<(), FilterError> {
        let is_doubted = self.may_have_missed(&first.base);
        let search = self.search;
        let ranking = &first.round.ranking;
        let left = |refined: &Refined| search.left(&refined.model, &refined.residual_nm);
        let without = left(&first.base);
        let named: Vec<&'static str> = self.added.iter().filter_map(|step| step.added).collect();
        let is_strained = self.is_strained();
        let worth = |refined: &Refined, variance: f64| {
            let terms = &refined.model.terms;
            if terms
                .iter()
                .any(|of| of.hypothesis.is_at_its_end(&search.scale))
            {
                return f64::NEG_INFINITY;
            }
            let effects = terms.iter().map(|term| &term.hypothesis);
            // a law of the file that is named has paid for its place already
            let paid = effects.filter(|effect| named.contains(&effect.effect));
            let paid: f64 = paid.map(|effect| cost_in_file(ranking, effect)).sum();
            together(ranking, [without, left(refined)], variance, terms) + paid
        };
        // what more names than before must be worth, as one that is added must
        let further = |refined: &Refined| {
            let more = refined.model.terms.len().saturating_sub(named.len());
            let most = self.added.iter().map(|step| step.best_nats);
            let part = FURTHER_PART * most.fold(0.0, f64::max);
            if named.is_empty() || is_strained {
                0.0
            } else {
                more as f64 * part.clamp(FURTHER_NATS, FURTHER_MOST_NATS)
            }
        };
        let mut starts = Vec::new();
        if is_doubted {
            starts = self.twisted(first)?;
        }
        if !self.added.is_empty() || self.is_left(&first.base) {
            // beside an effect that nothing speaks against, two must look better from the start
            starts.extend(self.pairs(first, !is_doubted));
        }
        let mut refined = search.refine_best(&first.round, &starts)?;
        refined.retain(|refined| left(refined).total().is_finite());
        let squares = refined.iter().map(|refined| left(refined).square);
        let variance = variance_of(ranking, squares.fold(left(&self.refined).square, f64::min));
        let most = |a: &Refined, b: &Refined| worth(a, variance).total_cmp(&worth(b, variance));
        let Some(mut best) = refined.into_iter().max_by(most) else {
            return Ok(());
        };
        let least = worth(&self.refined, variance) - BEHIND_NATS;
        if worth(&best, variance) <= least.max(0.0) {
            return Ok(());
        }
        let about = search.about(&self.responses, &best.model)?;
        best = search.refine(&about, &best.model)?;
        let more = if self.added.is_empty() {
            ANEW_NATS
        } else {
            FURTHER_NATS
        };
        if worth(&best, variance) <= worth(&self.refined, variance) + more.max(further(&best)) {
            return Ok(());
        }
        let mut other = self.clone();
        other.added = vec![first.clone(); best.model.terms.len()];
        other.refined = best;
        other.responses = about;
        let begun = names(&other.refined.model);
        other.reconsider()?;
        other.grow()?;
        if names(&other.refined.model) != begun {
            other.settle()?;
        }
        let least = left(&self.refined).square.min(left(&other.refined).square);
        let variance = variance_of(ranking, least);
        let before = worth(&self.refined, variance);
        let is_worth_more = worth(&other.refined, variance) > before + further(&other.refined);
        // a series from end to end names nothing, so that it is no better than names that leave no more than noise
        if is_worth_more
            && (self.added.is_empty()
                || is_beyond(search, &self.refined.residual_nm, WELL_EXPLAINED)
                || other.series()?.len() < other.added.len())
        {
            *self = other;
        }
        Ok(())
    }

    /// Looks at what is left.
    fn look(&mut self) -> Result<(), FilterError> {
        let last = self.search.next(&self.responses, &self.refined.model)?;
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
            let next = self.search.next(&self.responses, &best.refined.model)?;
            let next = Step::new(self.search, next, &best.refined)?;
            let step = std::mem::replace(&mut self.last, next);
            self.added.push(step.with(&best));
            self.refined = self.last.base.clone();
        }
        Ok(())
    }

    /// The best effect of a step that is worth being added.
    fn best(&self, step: &Step) -> Option<Refitted> {
        let is_gap = self.added.is_empty() && step.outweighs_none();
        let mut refitted = step.refitted.iter().filter(|best| !best.is_named_before());
        refitted
            .find(|best| is_gap || best.nats >= self.worth(best) && self.is_shown(step, best))
            .cloned()
    }

    /// Whether an effect is more than a part of what nothing explains: twist that no encoder shows bends to fit a little of
    /// anything beside other effects. It must take off as much as is left beyond what is taken for well explained.
    fn is_shown(&self, step: &Step, best: &Refitted) -> bool {
        let ranking = &step.round.ranking;
        let added = best.refined.model.terms.last();
        let is_twist = added.is_some_and(|term| term.hypothesis.gives());
        if self.added.is_empty() || ranking.sees_torsion || !is_twist {
            return true;
        }
        let square = |refined: &Refined| self.search.square(&refined.residual_nm);
        let [before, after] = [&step.base, &best.refined].map(square);
        let beyond = after - WELL_EXPLAINED * ranking.rows as f64;
        before - after >= beyond
    }

    /// What an effect must be worth beside those already added.
    fn worth(&self, best: &Refitted) -> f64 {
        if self.added.is_empty() {
            return 0.0;
        }
        let added = best.refined.model.terms.last().map(|t| &t.hypothesis);
        // what changes with every turn of the motor is not off by what changes with the load
        let is_slow = added.is_some_and(Hypothesis::is_slow);
        let before = self.added.iter().zip(&self.refined.model.terms);
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
            let taken = model.terms.remove(0);
            let base = self.search.refine(&self.responses, &model)?;
            let step = self
                .search
                .next_with(&self.responses, &base.model, Some(&taken))?;
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

/// Names of a model's added effects.
pub(crate) fn names(model: &Model) -> Vec<&'static str> {
    let terms = model.terms.iter();
    terms.map(|term| term.hypothesis.effect).collect()
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
    let start = Model::of_settled(search, settled);
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

/// Known values fitted beside what is settled.
///
/// # Errors
/// [`FilterError`].
pub(crate) fn without_effects(
    search: &Search<'_>,
    settled: &[Term],
) -> Result<Refined, FilterError> {
    let rough = roughly_fitted(search, &Model::of_settled(search, settled))?;
    search.refine(&search.known_alone(&rough.model)?, &rough.model)
}

/// Half the squares that settled effects take off.
fn settled_gain(search: &Search<'_>, without: &Refined) -> Result<f64, FilterError> {
    if without.model.settled.is_empty() {
        return Ok(0.0);
    }
    let bare = Model {
        settled: Vec::new(),
        ..without.model.clone()
    };
    let more = search.square(&search.residual_nm(&bare)?) - search.square(&without.residual_nm);
    Ok(0.5 * more.max(0.0))
}

/// Known values fitted, and everything beside them. They do not respond in proportion: their responses are found again
/// where the first fit ends.
fn known_fitted(search: &Search<'_>, start: &Model) -> Result<(Round, Refined), FilterError> {
    let rough = roughly_fitted(search, start)?;
    let round = search.first(&rough.model)?;
    let fitted = search.refine(&round, &rough.model)?;
    Ok((round, fitted))
}

/// Known values fitted with their responses about the model that they begin from.
pub(crate) fn roughly_fitted(search: &Search<'_>, start: &Model) -> Result<Refined, FilterError> {
    search.refine(&search.known_alone(start)?, start)
}
