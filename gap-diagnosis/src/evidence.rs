//! From held-out errors to probabilities.
//!
//! Evidence is counted in nats: half the squared error that an explanation takes off blocks it was not fitted to, in
//! units of noise and twin error, tempered, because errors of a twin are not as independent as noise; and half the squared
//! deviations it spares the known values, whose tolerance is a prior like any other. `none` stands at zero. Whether something is left that no effect of
//! the list explains is told by torques of no named law ([`crate::shapes`]).

use crate::hypothesis::Hypothesis;
use crate::rank::{Ranking, Scored};
use crate::search::Term;
use crate::trust::Trust;

/// By how much evidence is tempered.
const TEMPER: f64 = 0.5;
/// What naming any effect costs: a gap must be worth it.
const NAMING: f64 = 7.0;
/// What each fitted value costs beyond the first, and a tilt of the base that one joint alone tells of: to it that is no more than a
/// torque of gravity.
const VALUE: f64 = 1.5;
/// What an effect costs beside that whose cycles are the best of very many.
const AMONG_MANY: f64 = 14.0;
/// What one costs beside whose cycles are no whole number: of those there are many times more.
const NO_WHOLE_NUMBER: f64 = 7.0;
/// What an effect costs beside that which shows at reversals, where friction before it slips is nobody's law.
const AT_REVERSALS: f64 = 14.0;
/// What friction costs beside that rises with speed from rest: a joint that rubs less as it begins to move may be one that has not
/// slipped yet.
const RISES: f64 = 7.0;
/// What twist costs beside where rows come more slowly than any loop: what a gear's swing does between two of them is not recorded.
const ALIASED_TWIST: f64 = 30.0;
/// What an effect costs beside whose law the robot file has already, refitted: the twin's version of it is not the robot's.
const IN_FILE: f64 = 35.0;
/// What twist of the gear costs beside in an arm: the other links' torque swings with the twist of their gears.
const OTHERS_TWIST: f64 = 12.0;
/// Part of what the named effects are worth that may be left in such torques: no law is exact.
const INEXACT: f64 = 0.05;
/// Left beyond this part, the named effects only imitate something else.
const IMITATION: f64 = 0.2;
/// Nats over which an opinion about what is left turns.
const TURNS_NATS: f64 = 8.0;

/// Standard errors, from the scatter between blocks of time, above which an effect's size is not in doubt.
const SURE_ERRORS: f64 = 5.0;
/// What is left with an effect over what is left without it, as squares, below which its size is not in doubt either.
const ALMOST_ALL: f64 = 0.1;
/// Times what an effect is worth without the second in which it takes most off that it is worth at most.
const BEYOND_ONE_SECOND: f64 = 5.0;
/// Nats by which an effect must leave less than another for the other not to be preferred because its size is surer.
const DECISIVE_NATS: f64 = 30.0;

/// Both add the same torque whichever way a joint turns. They part only where it sticks, where a twin's friction is no better
/// than another's.
pub(crate) const SAME_TORQUE: [&str; 2] = ["torque_offset", "asymmetric_friction"];

/// Part of the nats that tells them apart, both simulated. Of 23 benches with one of them the right one led in 12, by up to 132 nats, and
/// the wrong one in 9, by up to 8.
const AT_REST: f64 = 0.2;

/// What an explanation is worth that explains nothing.
const NOTHING: f64 = -1e9;

/// What the candidates are worth beside a model.
#[derive(Clone, Debug)]
pub struct Standings {
    /// The best variant of each effect, best first: index into the ranking, and its nats.
    pub effects: Vec<(usize, f64)>,
}

/// What a simulated fit leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Left {
    /// Whitened squares of the residual.
    pub square: f64,
    /// Squared deviations of the known values.
    pub strain: f64,
}

impl Left {
    /// Both.
    pub fn total(self) -> f64 {
        self.square + self.strain
    }
}

/// An effect fitted by simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulated {
    /// Of its hypothesis in the ranking.
    pub index: usize,
    /// What it leaves.
    pub left: Left,
    /// Squares that it takes off the second in which it takes most off.
    pub most_in_a_second: f64,
    /// Squared size in units of its covariance.
    pub certainty: Option<f64>,
    /// Whether it is a law still, and not at the end of where it is one.
    pub is_law: bool,
}

/// Probability of an effect or of none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probability {
    /// Identifier.
    pub effect: &'static str,
    /// All sum to 1.
    pub probability: f64,
}

/// [`variance_of`] the best hypothesis.
fn variance(ranking: &Ranking) -> f64 {
    let best = ranking.scored.first().map(|scored| &scored.held_out);
    variance_of(ranking, best.unwrap_or(&ranking.none).total())
}

fn nats(ranking: &Ranking, scored: &Scored, variance: f64) -> f64 {
    let errors = ranking.none.total() - scored.held_out.total();
    let spared = ranking.none_strain - scored.strain;
    worth(ranking, scored, errors / variance, spared)
}

/// What taking so much off squares and strain is worth for this effect.
fn worth(ranking: &Ranking, scored: &Scored, errors: f64, spared: f64) -> f64 {
    let gain = tempered(errors - ranking.roughness) + 0.5 * spared;
    let nats = gain - cost(ranking, &scored.hypothesis, &scored.amplitudes);
    // a response that is no number explains nothing
    if nats.is_finite() { nats } else { NOTHING }
}

/// What an effect must be worth by the scatter of its size: what naming it costs, and of twist of the gear what it costs beside as
/// well. That shows at reversals, where rows count so little that next to nothing is left of them, however wrong the twin is there.
fn cost_in_doubt(ranking: &Ranking, hypothesis: &Hypothesis) -> f64 {
    if hypothesis.is_hidden_twist(ranking.sees_torsion) {
        return cost(ranking, hypothesis, &[]);
    }
    let values = hypothesis.amplitudes() + hypothesis.shape.len();
    naming(values) + Trust::of(ranking.joints).naming_nats
}

/// What naming this effect costs at this size, in nats.
fn cost(ranking: &Ranking, hypothesis: &Hypothesis, amplitudes: &[f64]) -> f64 {
    let rises =
        hypothesis.effect == "stribeck_friction" && amplitudes.first().is_some_and(|a| *a < 0.0);
    let beside = if rises {
        AT_REVERSALS + RISES
    } else if hypothesis.shows_at_reversals(ranking.sees_torsion) {
        AT_REVERSALS
    } else if hypothesis.is_periodic() && hypothesis.shape_is_free() {
        AMONG_MANY + NO_WHOLE_NUMBER
    } else if hypothesis.is_periodic() {
        AMONG_MANY
    } else {
        0.0
    };
    let mut beside = beside + hypothesis.in_any_twin_nats() + Trust::of(ranking.joints).naming_nats;
    if ranking.is_aliased && hypothesis.is_twist() {
        beside += ALIASED_TWIST;
    }
    if hypothesis.gives() && ranking.joints > 1 {
        beside += OTHERS_TWIST;
    }
    if hypothesis.effect == "base_tilt" && ranking.joints == 1 {
        beside += VALUE;
    }
    naming(hypothesis.amplitudes() + hypothesis.shape.len())
        + beside
        + cost_in_file(ranking, hypothesis)
}

/// The part of it for a law that the robot file has already.
pub(crate) fn cost_in_file(ranking: &Ranking, hypothesis: &Hypothesis) -> f64 {
    if ranking.is_in_file(hypothesis) {
        IN_FILE
    } else {
        0.0
    }
}

/// Lets other effects owe what a law of the file costs once it is worth that: its cost is a doubt about the twin, and a gap that
/// outweighs the doubt is one whatever it is called. What leaves less even so does not owe it.
///
/// Of each effect the cost, what it is worth, and what it is worth with its size in doubt.
fn owe(costs_in_file: &[f64], all: &mut [[f64; 2]]) {
    let paid = (0..all.len()).filter(|k| costs_in_file[*k] > 0.0 && all[*k][1] > 0.0);
    let Some(best) = paid.max_by(|a, b| all[*a][0].total_cmp(&all[*b][0])) else {
        return;
    };
    let cost = costs_in_file[best];
    let without_cost = all[best][0] + cost;
    for (values, own) in all.iter_mut().zip(costs_in_file) {
        if values[0] + own < without_cost {
            for value in values {
                *value -= cost - own;
            }
        }
    }
}

/// What a model with these effects is worth that leaves so much, beside one without them: `variance` as of
/// [`variance_of`] the best model they are compared with.
pub fn together<'a>(
    ranking: &Ranking,
    [without, left]: [Left; 2],
    variance: f64,
    effects: impl IntoIterator<Item = &'a Term>,
) -> f64 {
    let errors = (without.square - left.square) / variance;
    let spared = without.strain - left.strain;
    let cost = |term: &Term| cost(ranking, &term.hypothesis, &term.amplitudes);
    let costs = effects.into_iter().map(cost);
    tempered(errors) + 0.5 * spared - costs.sum::<f64>()
}

/// The part of squared errors that noise and twin error make up: more than one where they are larger than thought, less
/// where a twin is better than most.
pub fn variance_of(ranking: &Ranking, least: f64) -> f64 {
    (least / ranking.rows.max(1) as f64).max(Trust::of(ranking.joints).least)
}

/// What taking so much off squares is worth, for an effect with so many values.
pub fn tempered_nats(gain: f64, values: usize) -> f64 {
    tempered(gain) - naming(values)
}

fn tempered(gain: f64) -> f64 {
    TEMPER * 0.5 * gain
}

/// The most that an effect of so many squared standard errors is worth beyond what naming it costs: half of them where they are
/// few, anything where its size is not in doubt.
fn most_worth(square: f64, cost: f64) -> f64 {
    let doubt = 1.0 - square / SURE_ERRORS.powi(2);
    let worth = 0.5 * square - cost;
    if worth <= 0.0 {
        worth
    } else if doubt > 0.0 {
        worth / doubt
    } else {
        f64::INFINITY
    }
}

/// The most that an effect is worth that is worth so much without the second in which it takes most off. A law holds all the
/// time; what happens once, when a joint breaks away or gets stuck, is an event to which a law with enough freedom can be bent.
pub(crate) fn most_by_rest(worth_of_rest: f64) -> f64 {
    if worth_of_rest > 0.0 {
        BEYOND_ONE_SECOND * worth_of_rest
    } else {
        worth_of_rest
    }
}

/// The same, but for what happens once by its law and is nearly all that there is.
fn most_in_all(worth_of_rest: f64, is_once: bool) -> f64 {
    if is_once {
        f64::INFINITY
    } else {
        most_by_rest(worth_of_rest)
    }
}

/// What effects are worth, each given with what it would be if its size were not in doubt first: what leaves decisively more than
/// another stays behind it, however much that one's size is in doubt.
fn decided(all: &[[f64; 2]]) -> impl Iterator<Item = f64> {
    all.iter().map(|[sure, doubted]| {
        let better = all
            .iter()
            .filter(|[other, _]| *other > sure + DECISIVE_NATS);
        better.fold(*doubted, |least, [_, other]| {
            least.min(*other - DECISIVE_NATS)
        })
    })
}

/// What naming an effect with so many values costs.
pub(crate) fn naming(values: usize) -> f64 {
    NAMING + VALUE * values.saturating_sub(1) as f64
}

/// What every effect is worth.
pub fn standings(ranking: &Ranking) -> Standings {
    let variance = variance(ranking);
    let mut effects: Vec<(usize, f64)> = Vec::new();
    let mut all: Vec<(usize, f64)> = ranking
        .scored
        .iter()
        .enumerate()
        .map(|(index, scored)| (index, nats(ranking, scored, variance)))
        .collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    for (index, nats) in all {
        let name = ranking.scored[index].hypothesis.effect;
        if !effects
            .iter()
            .any(|(other, _)| ranking.scored[*other].hypothesis.effect == name)
        {
            effects.push((index, nats));
        }
    }
    let mut standings = Standings { effects };
    // responses in proportion say nothing of a joint at rest
    standings.draw_together(ranking, 0.0);
    standings
}

/// What is worth less than another, where a part of that counts.
fn led(most: f64, nats: f64, part: f64) -> f64 {
    most - part * (most - nats)
}

fn is_same_torque(ranking: &Ranking, index: usize) -> bool {
    SAME_TORQUE.contains(&ranking.scored[index].hypothesis.effect)
}

impl Standings {
    /// Of the two that add the same torque lets the better one lead by this part of the nats by which it does.
    fn draw_together(&mut self, ranking: &Ranking, part: f64) {
        let mut most = None;
        for (index, nats) in &mut self.effects {
            if is_same_torque(ranking, *index) {
                // the better one comes first
                let most = *most.get_or_insert(*nats);
                *nats = led(most, *nats, part);
            }
        }
        self.effects.sort_by(|a, b| b.1.total_cmp(&a.1));
    }

    /// Of a hypothesis, by its index.
    pub fn nats_of(&self, index: usize) -> f64 {
        self.effects
            .iter()
            .find(|(other, _)| *other == index)
            .map_or(f64::NEG_INFINITY, |(_, nats)| *nats)
    }

    /// An effect was chosen: what is worth more was passed over, and is none of the answers that are left.
    pub(crate) fn choose(&mut self, ranking: &Ranking, effect: &str) {
        let is_chosen = |index: usize| ranking.scored[index].hypothesis.effect == effect;
        let mut effects = self.effects.iter();
        let Some(&(_, chosen)) = effects.find(|(index, _)| is_chosen(*index)) else {
            return;
        };
        self.effects.retain(|(_, nats)| *nats <= chosen);
    }

    /// Nothing beyond noise: no explanation is worth naming.
    pub fn quiet(&mut self) {
        let best = self.effects.iter().map(|(_, nats)| *nats);
        // what comes nearest stays nearest
        let over = (best.fold(f64::NEG_INFINITY, f64::max) + NAMING).max(0.0);
        for (_, nats) in &mut self.effects {
            *nats -= over;
        }
    }

    /// Corrects the nats by what simulated fits leave of squares and strain, without an effect and with each of these:
    /// strong effects, and known values far off, do not respond in proportion.
    ///
    /// An effect of few standard errors is worth no more than they allow: they know from the scatter between blocks of time
    /// how far a twin's errors look like the effect. What leaves decisively more than such an effect stays behind it. One that
    /// takes off nearly everything is not in doubt, however unsure its size is beside known values that can do a part of it.
    ///
    /// What is no law any more where it fits best is worth nothing. What happens once is no law either, but for what may: a limit
    /// that is met in one moment and takes off nearly everything.
    pub fn refit(&mut self, ranking: &Ranking, without: Left, simulated: &[Simulated]) {
        let squares = simulated.iter().map(|simulated| simulated.left.square);
        let least = squares.fold(without.square, f64::min);
        let variance = variance_of(ranking, least);
        // by what it leaves, and with what its size is in doubt
        let values = |simulated: &Simulated| {
            let scored = &ranking.scored[simulated.index];
            if !simulated.is_law {
                return [worth(ranking, scored, 0.0, 0.0); 2];
            }
            let errors = (without.square - simulated.left.square) / variance;
            let spared = without.strain - simulated.left.strain;
            let is_all = simulated.left.square <= ALMOST_ALL * without.square;
            let in_rest = errors - simulated.most_in_a_second / variance;
            let of_rest = worth(ranking, scored, in_rest, spared);
            let of_rest = most_in_all(of_rest, is_all && scored.hypothesis.may_be_once());
            let worth = worth(ranking, scored, errors, spared);
            let cost = cost_in_doubt(ranking, &scored.hypothesis);
            let certainty = simulated.certainty.filter(|_| !is_all);
            let most = certainty.map_or(f64::INFINITY, |square| most_worth(square, cost));
            [worth, worth.min(most).min(of_rest)]
        };
        let mut all: Vec<[f64; 2]> = simulated.iter().map(values).collect();
        let costs_in_file: Vec<f64> = simulated
            .iter()
            .map(|simulated| cost_in_file(ranking, &ranking.scored[simulated.index].hypothesis))
            .collect();
        owe(&costs_in_file, &mut all);
        let mut simulated: Vec<(usize, f64, f64)> = simulated
            .iter()
            .zip(decided(&all))
            .map(|(one, value)| (one.index, self.nats_of(one.index), value))
            .collect();
        simulated.sort_by(|a, b| b.1.total_cmp(&a.1));
        for (index, nats) in &mut self.effects {
            let own = simulated.iter().find(|(other, ..)| other == index);
            // the others stay as far behind the next better one that was simulated as their linear responses were, and are
            // worth no more than these: what would be was simulated. One without a linear response is no measure for them
            let next = || {
                let mut responding = simulated
                    .iter()
                    .filter(|(index, ..)| ranking.scored[*index].size_nm > 0.0);
                let first = responding.clone().next();
                let better = responding.rfind(|(_, linear, _)| linear >= nats);
                better.or(first)
            };
            *nats = match own.or_else(next) {
                Some((other, _, value)) if other == index => *value,
                Some((_, linear, value)) => (value + (*nats - linear).min(0.0)).min(*nats),
                None => *nats,
            };
        }
        self.effects.sort_by(|a, b| b.1.total_cmp(&a.1));
        let both = simulated
            .iter()
            .filter(|(index, ..)| is_same_torque(ranking, *index));
        let are_simulated = both.count() == SAME_TORQUE.len();
        self.draw_together(ranking, if are_simulated { AT_REST } else { 0.0 });
    }

    /// Of each effect and `none`; most probable first.
    pub fn probabilities(&self, ranking: &Ranking) -> Vec<Probability> {
        let mut all: Vec<(&'static str, f64)> = self
            .effects
            .iter()
            .map(|(index, nats)| (ranking.scored[*index].hypothesis.effect, *nats))
            .chain([("none", 0.0)])
            .collect();
        // what nothing tells apart stands by name
        all.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(b.0)));
        let most = all[0].1;
        let sum: f64 = all.iter().map(|(_, nats)| (nats - most).exp()).sum();
        all.into_iter()
            .map(|(effect, nats)| Probability {
                effect,
                probability: (nats - most).exp() / sum,
            })
            .collect()
    }
}

/// Whether a torque of no named law is left beside what is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remains {
    /// Nothing beyond what a twin gets wrong.
    Nothing,
    /// Something, small beside what is named.
    Something,
    /// So much that what is named only imitates it.
    Most,
}

/// The torque of no named law that is worth most: over what, and nats.
pub fn most_left(structure: &[(&'static str, f64)]) -> Option<(&'static str, f64)> {
    let most = structure.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    most.copied()
}

/// What remains beside effects that take so much off.
pub fn remains(structure: &[(&'static str, f64)], named_nats: f64) -> Remains {
    let left_nats = most_left(structure).map_or(0.0, |(_, nats)| nats);
    let named_nats = named_nats.max(0.0);
    if left_nats <= INEXACT * named_nats {
        Remains::Nothing
    } else if left_nats <= IMITATION * named_nats {
        Remains::Something
    } else {
        Remains::Most
    }
}

/// Probability that the cause is on no list.
pub fn unknown_probability(structure: &[(&'static str, f64)], named_nats: f64) -> f64 {
    let left_nats = most_left(structure).map_or(0.0, |(_, nats)| nats);
    let named_nats = named_nats.max(0.0);
    let is_left = 1.0 / (1.0 + ((INEXACT * named_nats - left_nats) / TURNS_NATS).exp());
    let left_nats = left_nats.max(0.0);
    is_left * left_nats / (left_nats + named_nats).max(1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::HeldOut;
    use crate::hypothesis::tests::{ARM, scale};
    use crate::hypothesis::{periodic, plain};

    #[test]
    fn what_is_left_counts_beside_what_is_named() {
        let left = [("time", -12.0), ("position", 40.0)];
        assert_eq!(most_left(&left), Some(("position", 40.0)));
        assert_eq!(remains(&left, 0.0), Remains::Most);
        assert_eq!(remains(&left, 400.0), Remains::Something);
        assert_eq!(remains(&left, 4000.0), Remains::Nothing);
        assert_eq!(remains(&[], 0.0), Remains::Nothing);
        assert!(unknown_probability(&left, 0.0) > 0.9);
        assert!(unknown_probability(&left, 4000.0) < 0.1);
        assert!(unknown_probability(&[("time", -12.0)], 0.0) < 0.1);
    }

    #[test]
    fn what_is_less_likely_costs_more() {
        let ranking = |is_aliased: bool| Ranking {
            none: HeldOut { square: Vec::new() },
            none_strain: 0.0,
            scored: Vec::new(),
            rows: 1,
            roughness: 0.0,
            file_falls: false,
            file_cycles: Vec::new(),
            joints: 1,
            sees_torsion: true,
            is_aliased,
        };
        let all = plain(&scale(), ARM);
        let of = |name: &str, is_aliased: bool, amplitude: f64| {
            let hypothesis = all.iter().find(|one| one.effect == name);
            let hypothesis = hypothesis.expect("it is on the list");
            cost(&ranking(is_aliased), hypothesis, &[amplitude])
        };
        let stribeck = |amplitude: f64| of("stribeck_friction", false, amplitude);
        assert_eq!(stribeck(-1.0) - stribeck(1.0), RISES);
        for name in ["torsional_hysteresis", "torsional_compliance"] {
            assert_eq!(of(name, true, 1.0) - of(name, false, 1.0), ALIASED_TWIST);
        }
        let name = "link_inertia";
        assert_eq!(of(name, true, 1.0), of(name, false, 1.0));
        let cycles = |cycles: f64| cost(&ranking(false), &periodic(cycles)[2], &[1.0, 0.0]);
        assert_eq!(cycles(2.3) - cycles(2.0), NO_WHOLE_NUMBER);
    }

    #[test]
    fn doubt_about_a_size_ends_without_a_leap_and_decides_little() {
        let most = |errors: f64| most_worth(errors * errors, 7.0);
        assert!(most(3.0) < 0.0);
        assert!((4.0..15.0).contains(&most(4.3)), "{}", most(4.3));
        assert!(most(4.9) > 100.0);
        assert_eq!(most(5.0), f64::INFINITY);
        let of = |all: [[f64; 2]; 2]| decided(&all).collect::<Vec<_>>();
        // what leaves decisively less stays ahead of what is surer of its size
        assert_eq!(of([[500.0, 20.0], [380.0, 380.0]]), [20.0, -10.0]);
        assert_eq!(of([[500.0, 20.0], [480.0, 480.0]]), [20.0, 480.0]);
    }

    #[test]
    fn what_happens_once_is_no_law() {
        // worth naming, but not without one second
        assert_eq!(most_by_rest(-4.0), -4.0);
        assert!(most_by_rest(0.0) <= 0.0);
        // what lasts is not bounded: nine tenths of it are in the other seconds
        let naming_nats = 10.0;
        for gain_nats in [12.0, 100.0, 1e4] {
            let of_rest = most_by_rest(0.9 * gain_nats - naming_nats);
            assert!(of_rest >= gain_nats - naming_nats, "{gain_nats}");
        }
        // one that moves for a third of the time only loses nothing either, once it is well seen
        assert!(most_by_rest(0.67 * 25.0 - naming_nats) >= 25.0 - naming_nats);
        // but for a limit, which may be met once
        let all = plain(&scale(), ARM);
        let once = all.iter().filter(|one| one.may_be_once());
        let once: Vec<&str> = once.map(|one| one.effect).collect();
        assert!(!once.is_empty() && once.iter().all(|name| *name == "torque_saturation"));
        assert_eq!(most_in_all(-10.0, true), f64::INFINITY);
        assert_eq!(most_in_all(-10.0, false), -10.0);
    }

    #[test]
    fn a_law_of_the_file_that_is_worth_its_cost_lets_what_is_worse_owe_it() {
        let costs = [35.0, 0.0, 0.0];
        let of = |mut all: [[f64; 2]; 3]| {
            owe(&costs, &mut all);
            all.map(|[_, worth]| worth)
        };
        // ahead by 20 with the cost, behind by 15 without it; the third leaves less even so
        let all = [[100.0, 100.0], [120.0, 120.0], [150.0, 140.0]];
        assert_eq!(of(all), [100.0, 85.0, 140.0]);
        // within what a twin of the law gets wrong it is worth nothing, and nothing is owed
        let all = [[-10.0, -10.0], [12.0, 12.0], [3.0, 3.0]];
        assert_eq!(of(all), [-10.0, 12.0, 3.0]);
    }

    #[test]
    fn twist_of_a_doubtful_size_is_worth_nothing() {
        let all = plain(&scale(), ARM);
        let is_hidden = |name: &str, sees_torsion: bool| {
            let hypothesis = all.iter().find(|one| one.effect == name);
            hypothesis
                .expect("it is on the list")
                .is_hidden_twist(sees_torsion)
        };
        for sees_torsion in [true, false] {
            assert!(is_hidden("structural_damping", sees_torsion));
            assert!(!is_hidden("stribeck_friction", sees_torsion));
        }
        assert!(is_hidden("backlash", false) && !is_hidden("backlash", true));
        // 4.7 standard errors, with what naming costs and with what reversals cost beside
        let square = 4.7 * 4.7;
        assert!(most_worth(square, naming(2)) > 10.0);
        assert!(most_worth(square, naming(2) + AT_REVERSALS) < 0.0);
        // nor does it leap to anything where other sizes are no longer in doubt
        assert!(most_worth(5.5 * 5.5, naming(2) + AT_REVERSALS) < 0.0);
    }

    #[test]
    fn what_adds_the_same_torque_is_told_apart_by_little() {
        assert_eq!(led(40.0, 32.0, 0.0), 40.0);
        assert!(led(40.0, 32.0, AT_REST) > 38.0);
        assert!(led(40.0, 0.0, AT_REST) < 33.0);
    }

    #[test]
    fn what_comes_nearest_within_the_noise_stays_nearest() {
        let quiet = |effects: &[(usize, f64)]| {
            let mut standings = Standings {
                effects: effects.to_vec(),
            };
            standings.quiet();
            standings.effects
        };
        assert_eq!(
            quiet(&[(2, 13.0), (0, 3.0)]),
            [(2, -NAMING), (0, -NAMING - 10.0)]
        );
        // what is worth less than that already is left alone
        assert_eq!(quiet(&[(1, -9.0)]), [(1, -9.0)]);
    }

    #[test]
    fn evidence_grows_with_what_is_taken_off_and_falls_with_every_value() {
        assert!(tempered_nats(100.0, 1) > tempered_nats(90.0, 1));
        assert!(tempered_nats(100.0, 1) > tempered_nats(100.0, 2));
        assert!(tempered_nats(0.0, 1) < 0.0);
    }
}
