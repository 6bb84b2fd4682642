//! Names of a joint that could stand for one another.

use gap_report::{Candidate, Confusable};

use super::told::Found;
use super::{DEVIATIONS, NAME_NATS, Names, Scored};

/// Nats by which one name would have to be ahead of another, if it were true, to be told from it: three standard deviations.
const APART_NATS: f64 = 0.5 * DEVIATIONS * DEVIATIONS;

impl Found<'_> {
    /// Names that could stand for one another: sets within a few nats that differ in one name.
    pub(super) fn confusable(&self, best: &Scored) -> Vec<Confusable> {
        let mut pairs: Vec<Confusable> = Vec::new();
        let near = |set: &&Scored| best.score - set.score <= NAME_NATS;
        for set in self.sets.iter().skip(1).take_while(near) {
            let behind = (best.score - set.score).max(0.0);
            let (gone, come) = (best.names & !set.names, set.names & !best.names);
            if gone.count_ones() != 1 || come.count_ones() != 1 {
                continue;
            }
            let one = self.name_in(best.names, gone.trailing_zeros() as usize);
            let other = self.name_in(set.names, come.trailing_zeros() as usize);
            let is_known = pairs
                .iter()
                .any(|pair| pair.effects[0] == one && pair.effects[1] == other);
            if one != other && !is_known {
                pairs.push(Confusable {
                    effects: [one.to_owned(), other.to_owned()],
                    distance: 2.0 * behind,
                    reason: format!(
                        "alike on this motion: {behind:.1} nats apart, of what {:.0} independent rows tell",
                        self.evidence.independent_rows()
                    ),
                });
            }
        }
        if self.is_one_frequency {
            self.alike_at_one_frequency(best, &mut pairs);
        }
        for gone in self.players(best) {
            // what takes its place may itself be one of several, if it is as probable
            let mut truth = vec![(best.names, gone)];
            truth.extend(self.in_place_of(best.names, gone).filter_map(|(come, _)| {
                let names = best.names & !(1 << gone) | 1 << come;
                let score = self.evidence.scored(names).score;
                (best.score - score <= NAME_NATS).then_some((names, come))
            }));
            for (names, own) in truth {
                for (come, apart) in self.in_place_of(names, own) {
                    let pair = [self.name_in(names, own), self.name_in(names, come)];
                    if pair[0] == pair[1] {
                        continue;
                    }
                    if pairs.iter().any(|known| {
                        pair.iter()
                            .all(|name| known.effects.iter().any(|own| own == name))
                    }) {
                        continue;
                    }
                    pairs.push(Confusable {
                        effects: pair.map(str::to_owned),
                        distance: 2.0 * apart,
                        reason: "one takes the other's place on this motion, whichever is there"
                            .to_owned(),
                    });
                }
            }
        }
        pairs.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        pairs
    }

    /// Driven at one frequency, what is linear shows there as two numbers: in step with the position, and with the velocity. All else is how
    /// friction turns round and what it sets swinging, by which nothing should be told from anything.
    fn alike_at_one_frequency(&self, best: &Scored, pairs: &mut Vec<Confusable>) {
        let position_rad = &self.rows.position_rad;
        let mean = position_rad.iter().sum::<f64>() / position_rad.len().max(1) as f64;
        let waves = [
            position_rad.iter().map(|q| q - mean).collect::<Vec<f64>>(),
            self.rows.velocity_rad_s.clone(),
        ];
        let limit = self.evidence.inexact_part();
        for gone in self.players(best) {
            for come in 0..self.called.items() {
                if self.called.kind(come) == self.called.kind(gone) {
                    continue;
                }
                let left = self.evidence.apart_in(&waves, best.names, gone, come);
                let pair = [
                    self.name_in(best.names, gone),
                    self.called.effect(come, &[]).name(),
                ];
                let is_known = pairs.iter().any(|known| known.effects == pair);
                if left.is_some_and(|left| left < limit) && pair[0] != pair[1] && !is_known {
                    pairs.push(Confusable {
                        effects: pair.map(str::to_owned),
                        distance: 0.0,
                        reason:
                            "one frequency only: there both are one torque in step with the motion"
                                .to_owned(),
                    });
                }
            }
        }
    }

    /// Items that would take one's place in a set, with the nats by which they would be behind if it were the truth. What could be left
    /// out without being missed has no place to take.
    fn in_place_of(&self, names: Names, gone: usize) -> impl Iterator<Item = (usize, f64)> {
        let is_missed = self.evidence.apart(names, gone, None) > APART_NATS;
        let held = (0..self.called.items()).filter(move |item| names & 1 << item != 0);
        let kinds: Vec<usize> = held.map(|item| self.called.kind(item)).collect();
        (0..self.called.items())
            .filter(move |come| is_missed && !kinds.contains(&self.called.kind(*come)))
            .map(move |come| (come, self.evidence.apart(names, gone, Some(come))))
            .filter(|(_, apart)| *apart <= APART_NATS)
    }
}

/// Whether the first candidate is told from all others that could stand for it, by the odds that a name costs.
pub(super) fn is_sure(candidates: &[Candidate], confusable: &[Confusable]) -> bool {
    let Some((first, others)) = candidates.split_first() else {
        return true;
    };
    let is_alike = |other: &Candidate| {
        confusable.iter().any(|pair| {
            let has = |name: &String| pair.effects.contains(name);
            has(&first.effect) && has(&other.effect)
        })
    };
    let odds = |other: &Candidate| other.probability > first.probability * (-NAME_NATS).exp();
    !others.iter().any(|other| is_alike(other) && odds(other))
}
