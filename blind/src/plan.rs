//! Which cases are made: how many of each kind, in an order that tells nothing.

use robot::Effect;

use crate::label::CaseKind;
use crate::random::Random;
use crate::rig::RigKind;

/// Share of each kind.
const MIX: [(CaseKind, f64); 5] = [
    (CaseKind::NoGap, 0.30),
    (CaseKind::OneEffect, 0.40),
    (CaseKind::TwoEffects, 0.16),
    (CaseKind::Unknown, 0.08),
    (CaseKind::Pair, 0.06),
];
/// Gaps over noise; the last is rare.
const LEVELS: [f64; 3] = [1.0, 3.0, 0.3];
const RARE_LEVEL: f64 = 0.1;
/// Where the count of a kind may begin: every law of either half, and every design, comes first as often as any other.
const ORDINALS: usize = 72;
/// The random streams of cases begin here; those below are the plan's.
const FIRST_STREAM: u64 = 16;

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// How many cases.
    pub cases: usize,
    /// Makes the same cases again.
    pub seed: u64,
    /// Share of cases about the seven-joint arm; the others are one-joint benches.
    pub seven_joint_share: f64,
    /// Only this kind; the mix if none.
    pub kind: Option<CaseKind>,
    /// Length of each recording.
    pub duration_s: f64,
}

/// What one case shall be.
#[derive(Clone, Debug, PartialEq)]
pub struct CasePlan {
    /// Counts from 1.
    pub number: usize,
    /// What kind of answer it has.
    pub kind: CaseKind,
    /// What kind of robot it is about.
    pub rig: RigKind,
    /// Gap over noise.
    pub level: f64,
    /// Names of effects, in the order in which they are tried.
    pub(crate) effects: Vec<&'static str>,
    /// Counts the cases of this kind, from 0.
    pub(crate) ordinal: usize,
    pub(crate) seed: u64,
    pub(crate) stream: u64,
    /// Length of the recording.
    pub(crate) duration_s: f64,
}

/// The cases of an order, each to be made on its own.
pub fn plan(order: &Order) -> Vec<CasePlan> {
    let mut random = Random::new(order.seed, 0);
    let mut kinds = kinds(order);
    random.shuffle(&mut kinds);
    let arms = (order.cases as f64 * order.seven_joint_share).round() as usize;
    let mut rigs = vec![RigKind::OneJoint; order.cases];
    rigs[..arms.min(order.cases)].fill(RigKind::SevenJoints);
    random.shuffle(&mut rigs);
    let mut turns = Turns::default();
    kinds
        .into_iter()
        .zip(rigs)
        .enumerate()
        .map(|(index, (kind, rig))| CasePlan {
            number: index + 1,
            kind,
            rig,
            level: match kind {
                CaseKind::NoGap => 0.0,
                _ if random.chance(RARE_LEVEL) => LEVELS[2],
                _ => random.pick(&LEVELS[..2]),
            },
            effects: match kind {
                CaseKind::OneEffect | CaseKind::TwoEffects => turns.next(&mut random),
                _ => Vec::new(),
            },
            ordinal: turns.ordinal(kind, &mut random),
            seed: order.seed,
            stream: FIRST_STREAM + index as u64,
            duration_s: order.duration_s,
        })
        .collect()
}

fn kinds(order: &Order) -> Vec<CaseKind> {
    if let Some(kind) = order.kind {
        return vec![kind; order.cases];
    }
    let mut kinds = Vec::with_capacity(order.cases);
    let mut share = 0.0;
    for (kind, part) in MIX {
        share += part;
        let until = (share * order.cases as f64).round() as usize;
        kinds.resize(until.min(order.cases), kind);
    }
    kinds.resize(order.cases, CaseKind::NoGap);
    kinds
}

/// Every effect comes first as often as any other.
#[derive(Default)]
struct Turns {
    left: Vec<&'static str>,
    counts: [usize; 5],
}

impl Turns {
    fn next(&mut self, random: &mut Random) -> Vec<&'static str> {
        if self.left.is_empty() {
            self.left = Effect::names().to_vec();
            random.shuffle(&mut self.left);
        }
        let first = self.left.pop();
        let mut others = Effect::names().to_vec();
        random.shuffle(&mut others);
        others.retain(|name| Some(*name) != first);
        first.into_iter().chain(others).collect()
    }

    fn ordinal(&mut self, kind: CaseKind, random: &mut Random) -> usize {
        let count = &mut self.counts[kind as usize];
        if *count == 0 {
            *count = random.index(ORDINALS);
        }
        *count += 1;
        *count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order() -> Order {
        Order {
            cases: 100,
            seed: 5,
            seven_joint_share: 0.25,
            kind: None,
            duration_s: 30.0,
        }
    }

    #[test]
    fn the_mix_is_kept_and_a_seed_repeats() {
        let cases = plan(&order());
        let count = |kind| cases.iter().filter(|case| case.kind == kind).count();
        assert_eq!(CaseKind::ALL.map(count), [30, 40, 16, 8, 6]);
        let arms = cases.iter().filter(|case| case.rig == RigKind::SevenJoints);
        assert_eq!(arms.count(), 25);
        assert_eq!(plan(&order()), cases);
        assert_ne!(plan(&Order { seed: 6, ..order() }), cases);
    }

    #[test]
    fn only_cases_without_a_gap_have_no_level() {
        for case in plan(&order()) {
            assert_eq!(case.level == 0.0, case.kind == CaseKind::NoGap);
        }
    }
}
