//! From held-out errors to probabilities.
//!
//! Evidence is counted in nats: half the squared error that an explanation takes off blocks it was not fitted to, in
//! units of noise and twin error, tempered, because errors of a twin are not as independent as noise; and half the squared
//! deviations it spares the known values, whose tolerance is a prior like any other. `none` stands at zero. Whether something is left that no effect of
//! the list explains is told by torques of no named law ([`crate::shapes`]).

use crate::rank::{Ranking, Scored};

/// By how much evidence is tempered.
const TEMPER: f64 = 0.5;
/// What naming any effect costs: a gap must be worth it.
const NAMING: f64 = 7.0;
/// What each fitted value costs beyond the first.
const VALUE: f64 = 1.5;
/// What an effect costs beside that whose cycles are the best of very many.
const AMONG_MANY: f64 = 14.0;
/// What an effect costs beside that which shows at reversals, where friction before it slips is nobody's law.
const AT_REVERSALS: f64 = 14.0;
const AT_REVERSALS_ALWAYS: [&str; 3] = [
    "stribeck_friction",
    "structural_damping",
    "torsional_hysteresis",
];
/// What damping of the gear costs beside: below the band's limit it makes next to no torque.
const DAMPING: f64 = 6.0;
/// What an effect costs beside whose law the robot file has already, refitted: the twin's version of it is not the robot's.
const IN_FILE: f64 = 40.0;
/// What twist of the gear costs beside in an arm: the other links' torque swings with the twist of their gears.
const OTHERS_TWIST: f64 = 12.0;
/// Those that show elsewhere only to a second encoder or a torque sensor.
const AT_REVERSALS_UNSEEN: [&str; 3] = ["torsional_compliance", "soft_windup", "backlash"];
/// What torques of no named law are worth in a good twin: over velocity, acceleration and travel since a reversal its
/// friction is another's law, over anything else it is as the robot.
const TWINS_FRICTION: f64 = 90.0;
const TWINS_REST: f64 = 60.0;
/// Part of what the named effects are worth that may be left in such torques: no law is exact.
const INEXACT: f64 = 0.05;
/// Left beyond this part, the named effects only imitate something else.
const IMITATION: f64 = 0.2;
/// Nats over which an opinion about what is left turns.
const TURNS_NATS: f64 = 8.0;

/// What an explanation is worth that explains nothing.
const NOTHING: f64 = -1e9;

/// What the candidates are worth beside a model.
#[derive(Clone, Debug)]
pub struct Standings {
    /// The best variant of each effect, best first: index into the ranking, and its nats.
    pub effects: Vec<(usize, f64)>,
}

/// What a simulated fit leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// Probability of an effect or of none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probability {
    /// Identifier.
    pub effect: &'static str,
    /// All sum to 1.
    pub probability: f64,
}

/// The part of squared errors that noise and twin error make up: more than one where the noise is larger than thought.
fn variance(ranking: &Ranking) -> f64 {
    let best = ranking
        .scored
        .first()
        .map_or(ranking.none.total(), |scored| scored.held_out.total());
    (best / ranking.rows.max(1) as f64).max(1.0)
}

fn nats(ranking: &Ranking, scored: &Scored, variance: f64) -> f64 {
    let errors = ranking.none.total() - scored.held_out.total();
    let spared = ranking.none_strain - scored.strain;
    worth(ranking, scored, errors / variance, spared)
}

/// What taking so much off squares and strain is worth for this effect.
fn worth(ranking: &Ranking, scored: &Scored, errors: f64, spared: f64) -> f64 {
    let values = scored.amplitudes.len() + scored.hypothesis.shape.len();
    let effect = scored.hypothesis.effect;
    let is_twist = AT_REVERSALS_UNSEEN.contains(&effect);
    let at_reversals = AT_REVERSALS_ALWAYS.contains(&effect) || is_twist && !ranking.sees_torsion;
    let beside = if effect == "structural_damping" {
        AT_REVERSALS + DAMPING
    } else if at_reversals {
        AT_REVERSALS
    } else if scored.hypothesis.is_periodic() {
        AMONG_MANY
    } else {
        0.0
    };
    let mut beside = beside + (ranking.joints as f64).ln();
    if is_twist && ranking.joints > 1 {
        beside += OTHERS_TWIST;
    }
    if ranking.is_in_file(&scored.hypothesis) {
        beside += IN_FILE;
    }
    let nats = tempered_nats(errors - ranking.roughness, values) + 0.5 * spared - beside;
    // a response that is no number explains nothing
    if nats.is_finite() { nats } else { NOTHING }
}

/// What taking so much off squares is worth, for an effect with so many values.
pub fn tempered_nats(gain: f64, values: usize) -> f64 {
    TEMPER * 0.5 * gain - NAMING - VALUE * values.saturating_sub(1) as f64
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
    Standings { effects }
}

impl Standings {
    /// Of a hypothesis, by its index.
    pub fn nats_of(&self, index: usize) -> f64 {
        self.effects
            .iter()
            .find(|(other, _)| *other == index)
            .map_or(f64::NEG_INFINITY, |(_, nats)| *nats)
    }

    /// Nothing beyond noise: no explanation is worth naming.
    pub fn quiet(&mut self) {
        for (_, nats) in &mut self.effects {
            *nats = nats.min(-NAMING);
        }
    }

    /// Corrects the nats by what simulated fits leave of squares and strain, without an effect and with each of these:
    /// strong effects, and known values far off, do not respond in proportion.
    pub fn refit(&mut self, ranking: &Ranking, without: Left, left: &[(usize, Left)]) {
        let squares = left.iter().map(|(_, left)| left.square);
        let least = squares.fold(without.square, f64::min);
        let variance = (least / ranking.rows.max(1) as f64).max(1.0);
        let value = |index: usize, left: Left| {
            let errors = (without.square - left.square) / variance;
            let spared = without.strain - left.strain;
            worth(ranking, &ranking.scored[index], errors, spared)
        };
        // the others stay as far behind the last that was simulated as their linear responses were
        let last = left
            .iter()
            .map(|(index, left)| (self.nats_of(*index), value(*index, *left)))
            .fold((f64::INFINITY, 0.0), |last, next| {
                if next.0 < last.0 { next } else { last }
            });
        for (index, nats) in &mut self.effects {
            *nats = match left.iter().find(|(other, _)| other == index) {
                Some((_, left)) => value(*index, *left),
                None if last.0.is_finite() => (*nats - last.0 + last.1).min(last.1),
                None => *nats,
            };
        }
        self.effects.sort_by(|a, b| b.1.total_cmp(&a.1));
    }

    /// Of each effect and `none`; most probable first.
    pub fn probabilities(&self, ranking: &Ranking) -> Vec<Probability> {
        let mut all: Vec<(&'static str, f64)> = self
            .effects
            .iter()
            .map(|(index, nats)| (ranking.scored[*index].hypothesis.effect, *nats))
            .chain([("none", 0.0)])
            .collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
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

/// What torques of no named law are worth beyond a good twin's: the variable, and nats.
pub fn beyond_twin(structure: &[(&'static str, f64)]) -> Option<(&'static str, f64)> {
    structure
        .iter()
        .map(|&(over, nats)| {
            let friction = matches!(
                over,
                "velocity" | "acceleration" | "jerk" | "travel since the last reversal"
            );
            let allowed = if friction { TWINS_FRICTION } else { TWINS_REST };
            (over, nats - allowed)
        })
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

/// What remains beside effects that take so much off.
pub fn remains(structure: &[(&'static str, f64)], named_nats: f64) -> Remains {
    let left_nats = beyond_twin(structure).map_or(0.0, |(_, nats)| nats);
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
    let left_nats = beyond_twin(structure).map_or(0.0, |(_, nats)| nats);
    let named_nats = named_nats.max(0.0);
    let is_left = 1.0 / (1.0 + ((INEXACT * named_nats - left_nats) / TURNS_NATS).exp());
    let left_nats = left_nats.max(0.0);
    is_left * left_nats / (left_nats + named_nats).max(1e-9)
}
