//! From held-out errors to probabilities.
//!
//! Evidence is counted in nats: half the squared error that an explanation takes off blocks it was not fitted to, in
//! units of noise and twin error, and half the squared deviations it spares the known values. It is tempered, because
//! errors of a twin are not as independent as noise. `none` stands at zero. `unknown` takes off everything above what a
//! good explanation leaves, but pays a part of it for having nothing to say.

use crate::search::{Ranking, Scored};

/// By how much evidence is tempered.
const TEMPER: f64 = 0.5;
/// What naming any effect costs: a gap must be worth it.
const NAMING: f64 = 6.0;
/// What each fitted value costs beyond the first.
const VALUE: f64 = 1.5;
/// What an effect costs beside that which shows at reversals, where friction before it slips is nobody's law.
const AT_REVERSALS: f64 = 14.0;
/// Mean squared whitened residual that a good explanation leaves.
const LEFT: f64 = 1.0;
/// What `unknown` costs at least.
const UNKNOWN: f64 = 10.0;
/// Part of the gap's evidence that `unknown` pays.
const UNKNOWN_PART: f64 = 0.25;

/// What an explanation is worth that explains nothing.
const NOTHING: f64 = -1e9;

/// What the candidates are worth beside a model.
#[derive(Clone, Debug)]
pub struct Standings {
    /// The best variant of each effect, best first: index into the ranking, and its nats.
    pub effects: Vec<(usize, f64)>,
    /// Of `unknown`.
    pub unknown_nats: f64,
}

/// Probability of an effect, `none` or `unknown`.
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
    worth(
        scored,
        errors / variance + ranking.none_strain - scored.strain,
    )
}

/// What taking so much off squares and strain is worth for this effect.
fn worth(scored: &Scored, gain: f64) -> f64 {
    let values = scored.amplitudes.len() + scored.hypothesis.shape.len();
    let at_reversals = matches!(
        scored.hypothesis.effect,
        "stribeck_friction" | "structural_damping" | "torsional_hysteresis"
    );
    let nats = tempered_nats(gain, values) - if at_reversals { AT_REVERSALS } else { 0.0 };
    // a response that is no number explains nothing
    if nats.is_finite() { nats } else { NOTHING }
}

/// What taking so much off squares and strain is worth, for an effect with so many values.
pub fn tempered_nats(gain: f64, values: usize) -> f64 {
    TEMPER * 0.5 * gain - NAMING - VALUE * values.saturating_sub(1) as f64
}

fn unknown_nats(ranking: &Ranking, without: f64, variance: f64) -> f64 {
    let gap = without - LEFT * ranking.rows as f64;
    let gap_nats = TEMPER * 0.5 * gap.max(0.0) / variance;
    (1.0 - UNKNOWN_PART) * gap_nats - UNKNOWN - NAMING
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
    Standings {
        effects,
        unknown_nats: unknown_nats(
            ranking,
            ranking.none.total() + ranking.none_strain,
            variance,
        ),
    }
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
        self.unknown_nats = self.unknown_nats.min(-UNKNOWN);
    }

    /// Corrects the nats by what simulated fits leave of squares and strain, without an effect and with each of these:
    /// strong effects, and known values far off, do not respond in proportion.
    pub fn refit(&mut self, ranking: &Ranking, without: f64, left: &[(usize, f64)]) {
        let least = left.iter().map(|(_, left)| *left).fold(without, f64::min);
        let variance = (least / ranking.rows.max(1) as f64).max(1.0);
        let value =
            |index: usize, left: f64| worth(&ranking.scored[index], (without - left) / variance);
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
        self.unknown_nats = unknown_nats(ranking, without, variance);
    }

    /// Of each effect, `none` and `unknown`; most probable first.
    pub fn probabilities(&self, ranking: &Ranking) -> Vec<Probability> {
        let mut all: Vec<(&'static str, f64)> = self
            .effects
            .iter()
            .map(|(index, nats)| (ranking.scored[*index].hypothesis.effect, *nats))
            .chain([("none", 0.0), ("unknown", self.unknown_nats)])
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
