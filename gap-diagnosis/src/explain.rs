//! A joint's explanation: effects are added one at a time while they are worth it, and taken back if they no longer are.

use joint_model::filter::FilterError;

use crate::evidence::{
    Left, Probability, Remains, Standings, remains, standings, unknown_probability,
};
use crate::judge::Squares;
use crate::rank::{ALIKE, Round};
use crate::refine::Refined;
use crate::search::{Model, Search, Term};

/// The most effects of one joint.
pub const EFFECTS_MAX: usize = 3;
/// What is left below this part of the squared floor, known values fitted, is within the twin's own errors.
const WITHIN_TWIN: f64 = 0.3;
/// Below this part the twin's own errors may have any shape.
const TWINS_SHAPE: f64 = 0.7;
/// How often the effects that were added are looked at again.
const SWEEPS: usize = 2;
/// Effects that are fitted by simulation, not only by their linear response, before one is chosen.
const REFITTED: usize = 4;
/// Nats within which another effect is refitted too.
const NEAR_NATS: f64 = 30.0;
/// Nats that a second or third effect must be worth, and part of the first one's up to some nats: no law is exact.
const FURTHER_NATS: f64 = 6.0;
const FURTHER_PART: f64 = 0.01;
const FURTHER_MOST_NATS: f64 = 40.0;
/// The same for one that repeats over the angle as an effect before does.
const COMPANION_PART: f64 = 0.05;

/// What explains a joint's residual.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// The final model.
    pub refined: Refined,
    /// The robot file's model with known values refitted, without effects.
    pub without: Refined,
    /// Each step's candidates: those of the first, then those beside the effects before.
    pub rounds: Vec<Step>,
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
    /// What torques of no named law would be worth: over what, and nats.
    pub structure: Vec<(&'static str, f64)>,
    /// The leading effects, fitted by simulation, best first.
    refitted: Vec<Refitted>,
    /// What the best of them is worth.
    pub best_nats: f64,
    /// Half the squares and strain that the one that was added takes off.
    gain: f64,
}

/// An effect fitted by simulation.
#[derive(Clone, Debug)]
struct Refitted {
    effect: &'static str,
    nats: f64,
    /// Half the squares and strain that it takes off.
    gain: f64,
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
        let added = self.rounds.iter().filter(|step| step.added.is_some());
        added.map(|step| step.gain).sum()
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
    let is_gap = is_beyond(search, &search.residual_nm(&start)?, 1.0)
        && is_beyond(search, &without.residual_nm, WITHIN_TWIN);
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
    for _ in 0..SWEEPS {
        if growing.added.len() < 2 || !growing.reconsider()? {
            break;
        }
        growing.grow()?;
    }
    let mut rounds = growing.added;
    rounds.push(growing.last);
    let explanation = Explanation {
        refined: growing.refined,
        without: without.clone(),
        rounds,
    };
    if explanation.named_gain() > 0.0 && explanation.remains() == Remains::Most {
        // names that leave most of it would be wrong names
        return Ok(Explanation {
            refined: without.clone(),
            without,
            rounds: vec![first],
        });
    }
    Ok(explanation)
}

/// An explanation in the making. Effects of the model beyond the settled ones are in the order of `added`.
struct Growing<'a, 's> {
    search: &'a Search<'s>,
    settled: usize,
    first: &'a Round,
    refined: Refined,
    added: Vec<Step>,
    last: Step,
}

impl Growing<'_, '_> {
    /// Adds effects one at a time while they are worth it.
    fn grow(&mut self) -> Result<(), FilterError> {
        while self.added.len() < EFFECTS_MAX {
            let worth = |best: &&Refitted| best.nats >= self.worth(best);
            let Some(best) = self.last.refitted.iter().find(worth).cloned() else {
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

    /// What an effect must be worth beside those already added.
    fn worth(&self, best: &Refitted) -> f64 {
        let most = self.added.iter().map(|step| step.best_nats);
        let Some(most) = most.max_by(f64::total_cmp) else {
            return 0.0;
        };
        if best.is_companion(&self.refined.model) {
            most * COMPANION_PART
        } else {
            let part = most * FURTHER_PART;
            let terms = &best.refined.model.terms;
            let is_periodic = terms.last().is_some_and(|t| t.hypothesis.is_periodic());
            // what repeats with an angle can be found in anything that is left
            let enough = if is_periodic {
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
            model.terms.remove(self.settled);
            let base = self.search.refine(self.first, &model)?;
            let step = self.search.next(self.first, &base.model)?;
            let step = Step::new(self.search, step, &base)?;
            let kept = std::mem::replace(&mut self.refined, base);
            let best = step.refitted.first().cloned();
            match best.filter(|best| best.nats >= self.worth(best)) {
                Some(best) => {
                    changed |= Some(best.effect) != before.added;
                    self.added.push(step.with(&best));
                    self.refined = best.refined;
                }
                None if self.added.is_empty() => {
                    // the last one stays what it was
                    self.refined = kept;
                    self.added.push(before);
                }
                None => changed = true,
            }
        }
        if changed {
            let last = self.search.next(self.first, &self.refined.model)?;
            self.last = Step::new(self.search, last, &self.refined)?;
            self.refined = self.last.base.clone();
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
        let mut standings = standings(&round.ranking);
        let best_nats = standings.effects.first().map_or(0.0, |(_, nats)| *nats);
        let mut refitted = Vec::new();
        let leading: Vec<(usize, f64)> = standings
            .effects
            .iter()
            .copied()
            .take(REFITTED)
            .filter(|(_, nats)| *nats > (best_nats - NEAR_NATS).max(-NEAR_NATS / 3.0))
            .filter(|(index, _)| round.ranking.scored[*index].size_nm > 0.0)
            .collect();
        for (index, _) in leading {
            let scored = &round.ranking.scored[index];
            let mut model = base.model.clone();
            model.terms.push(Term {
                hypothesis: scored.hypothesis.clone(),
                amplitudes: scored.amplitudes.clone(),
            });
            let refined = search.refine(&round, &model)?;
            let left = search.left(&refined.model, &refined.residual_nm);
            // a joint that runs away in simulation explains nothing
            if left.total().is_finite() {
                refitted.push((index, left, refined));
            }
        }
        let left: Vec<(usize, Left)> = refitted.iter().map(|(i, left, _)| (*i, *left)).collect();
        let base = best_base(search, &round, base, &refitted)?;
        let structure = if is_beyond(search, &base.residual_nm, TWINS_SHAPE) {
            search.structure(&round, &base)
        } else {
            Vec::new()
        };
        let without = search.left(&base.model, &base.residual_nm);
        standings.refit(&round.ranking, without, &left);
        let mut refitted: Vec<Refitted> = refitted
            .into_iter()
            .map(|(index, left, refined)| Refitted {
                effect: round.ranking.scored[index].hypothesis.effect,
                nats: standings.nats_of(index),
                gain: 0.5 * (without.total() - left.total()),
                refined,
            })
            .collect();
        refitted.sort_by(|a, b| b.nats.total_cmp(&a.nats));
        Ok(Self {
            best_nats: refitted.first().map_or(0.0, |best| best.nats),
            gain: 0.0,
            base,
            structure,
            probabilities: standings.probabilities(&round.ranking),
            standings,
            round,
            refitted,
            added: None,
        })
    }

    /// The step, with what was added.
    fn with(mut self, best: &Refitted) -> Self {
        self.added = Some(best.effect);
        self.best_nats = best.nats;
        self.gain = best.gain;
        self
    }

    /// Nothing beyond noise: no explanation is worth naming.
    fn quiet(round: Round, base: &Refined) -> Self {
        let mut standings = standings(&round.ranking);
        standings.quiet();
        Self {
            best_nats: 0.0,
            gain: 0.0,
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
