//! Which sets of names are tried, and which of them can be.

use super::{Evidence, Fit, INEXACT, NAME_NATS, Names, Scored};

/// Names of one joint at most.
const NAMES_MAX: usize = 4;
/// Sets of one size that are made larger, the best first: all pairs of a dozen laws.
const GROWN: usize = 80;
/// Sets that fall behind the best by more nats than this have no weight: e⁻¹².
const BEHIND: f64 = 12.0;

impl Evidence {
    /// Sets of at most so many names, no name twice: none, singles and pairs, and what the best of each size make with one more.
    pub(super) fn sets(&self) -> Vec<Scored> {
        let mut all = vec![self.scored(0)];
        let mut of_size: Vec<Names> = vec![0];
        for size in 1..=NAMES_MAX {
            let mut larger: Vec<Names> = Vec::new();
            for &names in &of_size {
                let held = |kind: usize| {
                    (0..self.kinds.len()).any(|k| names & 1 << k != 0 && self.kinds[k] == kind)
                };
                let more = (0..self.kinds.len()).filter(|index| !held(self.kinds[*index]));
                larger.extend(more.map(|index| names | 1 << index));
            }
            larger.sort_unstable();
            larger.dedup();
            let mut scored: Vec<Scored> =
                larger.into_iter().map(|names| self.scored(names)).collect();
            scored.sort_by(|a, b| b.score.total_cmp(&a.score));
            let kept = if size == 1 { scored.len() } else { GROWN };
            of_size = scored.iter().take(kept).map(|set| set.names).collect();
            all.extend(scored);
        }
        all
    }

    /// Whether each name of a set, but for what every joint may have, takes more of some signal, beside the others and the file's values as
    /// they are with all of them, than no law is exact by: what is less is how the others' laws are off.
    fn are_felt(&self, names: Names) -> bool {
        let beside = self.values_beside(names);
        let left = |names: Names| {
            let by_part = self.left_of_signals_at(names, &beside);
            let sum = |signal: usize| by_part.iter().map(|part| part[signal]).sum();
            (0..self.spans.len()).map(sum).collect::<Vec<f64>>()
        };
        let [nothing, all] = [0, names].map(left);
        // values that work against the names leave more than there was to explain
        let gap = self.spans.iter().map(|span| {
            let own = &self.gap_nm[span.rows.clone()];
            own.iter().map(|x| x * x).sum::<f64>()
        });
        let nothing: Vec<f64> = nothing
            .into_iter()
            .zip(gap)
            .map(|(a, b)| a.min(b))
            .collect();
        let seldom = names & !self.usual;
        let mut each = (0..self.kinds.len()).filter(|index| seldom & 1 << index != 0);
        each.all(|index| {
            let without = left(names & !(1 << index));
            let mut signals = without.iter().zip(&nothing).zip(&all);
            signals.any(|((without, nothing), all)| {
                without - all > INEXACT.powi(2) * (nothing - all).max(0.0)
            })
        })
    }

    /// All sets that `is_possible` that are not far behind the best: first what is told, then the best first. There is always one: no name.
    /// It is what is told unless the odds against it are those that a name costs. What leaves more than the file as it is explains nothing.
    pub fn best(&self, is_possible: impl Fn(&Fit) -> bool) -> Vec<Scored> {
        let mut all = self.sets();
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        let gap = self.square(&self.gap_nm);
        let mut kept: Vec<Scored> = Vec::new();
        for scored in all {
            if let Some(best) = kept.first()
                && scored.score < best.score - BEHIND
            {
                break;
            }
            let explains = || scored.left.iter().sum::<f64>() < gap;
            if scored.names == 0
                || explains() && is_possible(&self.fit(scored.names)) && self.are_felt(scored.names)
            {
                kept.push(scored);
            }
        }
        let best = kept[0].score;
        let weight = |set: &Scored| (set.score - best).exp();
        let all: f64 = kept.iter().map(weight).sum();
        let is_probable = |set: &Scored| weight(set) / all > (-NAME_NATS).exp();
        let none = kept.iter().position(|set| set.names == 0);
        if let Some(place) = none.filter(|place| is_probable(&kept[*place])) {
            let none = kept.remove(place);
            kept.insert(0, none);
        }
        kept
    }
}
