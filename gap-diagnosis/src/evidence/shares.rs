//! What each name takes off the gap: Shapley values of the mean square that is left out, with intervals over the parts left out.

use rand_core::{RngCore, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::PARTS;

/// Resamplings of the parts.
pub const DRAWS: usize = 400;
/// A fixed beginning: the same recording gives the same interval.
const SEED: u64 = 1;
/// Ends of a 95 % interval.
const ENDS: [f64; 2] = [0.025, 0.975];

/// A number with its 95 % interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Interval {
    /// Of all parts.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Shares of the gap.
#[derive(Clone, Debug, Default)]
pub struct Shares {
    /// Of each player, in order.
    pub of: Vec<Interval>,
    /// What none of them takes.
    pub remaining: Interval,
    /// What each takes alone.
    pub alone: Vec<f64>,
}

/// Sums of squares left out, by which players (a bit each) are in the model.
pub struct Game {
    /// For every set of players.
    pub left: Vec<[f64; PARTS]>,
    /// How many players.
    pub players: usize,
    /// What noise leaves of the sum of squares.
    pub noise: f64,
}

impl Game {
    /// Shares with intervals.
    pub fn shares(&self) -> Shares {
        let all: [usize; PARTS] = std::array::from_fn(|part| part);
        let Some(whole) = self.with(&all) else {
            let certain = |value: f64| Interval {
                value,
                low: value,
                high: value,
            };
            return Shares {
                of: vec![certain(0.0); self.players],
                remaining: certain(1.0),
                alone: vec![0.0; self.players],
            };
        };
        let mut random = Pcg64Mcg::seed_from_u64(SEED);
        let draws: Vec<Vec<f64>> = (0..DRAWS)
            .filter_map(|_| {
                let parts = std::array::from_fn(|_| random.next_u32() as usize % PARTS);
                self.with(&parts)
            })
            .collect();
        let interval = |place: usize| {
            let mut values: Vec<f64> = draws.iter().map(|draw| draw[place]).collect();
            values.sort_by(f64::total_cmp);
            let last = values.len().saturating_sub(1) as f64;
            let at = |end: f64| {
                let value = values.get((last * end).round() as usize);
                value.copied().unwrap_or(whole[place])
            };
            Interval {
                value: whole[place],
                low: at(ENDS[0]).min(whole[place]),
                high: at(ENDS[1]).max(whole[place]),
            }
        };
        let remaining = interval(self.players);
        let alone = (0..self.players).map(|player| {
            let gap = self.sum(0, &all) - self.noise;
            (self.sum(0, &all) - self.sum(1 << player, &all)) / gap
        });
        Shares {
            of: (0..self.players).map(interval).collect(),
            remaining,
            alone: alone.collect(),
        }
    }

    fn sum(&self, players: usize, parts: &[usize; PARTS]) -> f64 {
        parts.iter().map(|part| self.left[players][*part]).sum()
    }

    /// Each player's share, then what remains; none of a gap that is within the noise.
    fn with(&self, parts: &[usize; PARTS]) -> Option<Vec<f64>> {
        let everyone = (1 << self.players) - 1;
        let nothing = self.sum(0, parts);
        if nothing <= self.noise {
            return None;
        }
        // what is left below the noise is as good as nothing, and no less
        let noise = self.noise.min(self.sum(everyone, parts));
        let gap = nothing - noise;
        let taken = taken(self.players, |set| self.sum(set, parts));
        let mut all: Vec<f64> = taken.iter().map(|taken| taken / gap).collect();
        all.push((self.sum(everyone, parts) - noise) / gap);
        Some(all)
    }
}

/// What each player takes off a sum of squares that is told of every set of them, a bit each: Shapley's values.
pub fn taken(players: usize, left: impl Fn(usize) -> f64) -> Vec<f64> {
    let of_player = |player: usize| {
        let others = (0..1 << players).filter(|set| set & (1 << player) == 0);
        let each = others.map(|set: usize| {
            let [without, with] = [set, set | 1 << player].map(&left);
            // sums that differ by their rounding are the same: what shows in one part only takes nothing of the others
            let is_same = (without - with).abs() <= f64::EPSILON.sqrt() * without;
            let gained = if is_same { 0.0 } else { without - with };
            weight(set.count_ones() as usize, players) * gained
        });
        each.sum()
    };
    (0..players).map(of_player).collect()
}

/// Part of the orders in which a player comes after so many of the others.
fn weight(before: usize, players: usize) -> f64 {
    let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
    factorial(before) * factorial(players - before - 1) / factorial(players)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_gap_within_the_noise_nobody_has_a_share() {
        let game = Game {
            left: vec![[1.0; PARTS], [0.5; PARTS]],
            players: 1,
            noise: 10.0 * PARTS as f64,
        };
        let shares = game.shares();
        assert_eq!(shares.of[0], Interval::default());
        assert_eq!(shares.remaining.value, 1.0);
        assert_eq!(shares.alone, [0.0]);
    }

    #[test]
    fn what_shows_in_one_part_only_is_not_certain() {
        let mut left = vec![[1.0; PARTS]; 2];
        left[0][3] = 100.0;
        left[1][5] -= 1e-15;
        let game = Game {
            left,
            players: 1,
            noise: 0.0,
        };
        let share = game.shares().of[0];
        assert!(share.value > 0.9 && share.low == 0.0, "{share:?}");
    }

    #[test]
    fn shares_and_rest_add_up_and_halves_are_halves() {
        // two players who take the same half, each alone; together nothing more than one quarter is left
        let left = |all: f64| [all; PARTS];
        let game = Game {
            left: vec![left(1.0), left(0.5), left(0.5), left(0.25)],
            players: 2,
            noise: 0.0,
        };
        let shares = game.shares();
        assert!((shares.of[0].value - 0.375).abs() < 1e-12);
        assert_eq!(shares.of[0], shares.of[1]);
        let sum: f64 = shares.of.iter().map(|share| share.value).sum();
        assert!((sum + shares.remaining.value - 1.0).abs() < 1e-12);
        assert!((shares.alone[0] - 0.5).abs() < 1e-12);
    }
}
