//! From the evidence to what a report says of a joint.

use std::collections::BTreeMap;

use gap_report::{
    BeforeAfter, Candidate, Gap, JointReport, NamedEffect, Parameter, PlainFriction, Remaining,
    Remains, RemainsOver, SignalGap, Verdict,
};
use joint_model::friction::SteadyFriction;
use nalgebra::DMatrix;
use robot::{Effect, EffectKind, Part};

use super::alike::is_sure;
use super::imitation::Ahead;
use super::rows::Rows;
use super::shares::{Game, Interval, Shares};
use super::{DEVIATIONS, ERRORS, Evidence, Fit, Names, Scored};
use crate::effects::numbers::{numbers, side};

/// Share of the gap below which an effect is a minor one, unless the reader wants another.
pub const MATERIALITY: f64 = 0.02;
/// Named effects that take so much explain the gap.
const EXPLAINED: f64 = 0.9;
/// Or, with structure left, explain a part of it.
const PARTLY: f64 = 0.2;
/// Below this weight a set's shares are not looked at.
const WEIGHT_MIN: f64 = 1e-3;

/// What decided a verdict, where the effects do not show it. `has_law`: whether a law on no list is ahead. `taken`, `left`: parts of the gap that names take and leave. `drives`: whether
/// what is left depends on the velocity and goes with it.
fn reason(
    verdict: Verdict,
    [has_names, has_law]: [bool; 2],
    [taken, left]: [f64; 2],
    drives: bool,
) -> String {
    let names_take = |limit: f64| {
        let [taken, limit] = [taken.max(0.0), limit].map(|share| 100.0 * share);
        // what is just below is not shown as the limit
        let taken = (10.0 * taken).floor() / 10.0;
        format!("the names take {taken:.1} % of the gap, less than {limit:.0} %")
    };
    match verdict {
        Verdict::PartlyExplained if taken >= EXPLAINED && !has_law => format!(
            "the {:.1} % that the names leave are more than the simulation may be off by",
            100.0 * left.max(0.0)
        ),
        Verdict::PartlyExplained if taken >= EXPLAINED => format!(
            "some of the {:.1} % that the names leave follows a law on no list",
            100.0 * left.max(0.0)
        ),
        Verdict::PartlyExplained => names_take(EXPLAINED),
        Verdict::Unexplained if drives => "what is left drives the joint the more the faster it moves, which no friction does: the torque's \
                                           sign, or a friction compensation of the drive"
            .to_owned(),
        Verdict::Unexplained if has_names => names_take(PARTLY),
        Verdict::Unexplained => "no name takes a part of the gap for certain".to_owned(),
        _ => String::new(),
    }
}

/// What the items of a joint's evidence are called.
pub trait Called: Sync {
    /// How many there are.
    fn items(&self) -> usize;
    /// Which of them are one name with other shapes.
    fn kind(&self, item: usize) -> usize;
    /// Whether every joint may have it.
    fn is_usual(&self, item: usize) -> bool;
    /// The effect, as a change against the file.
    fn effect(&self, item: usize, amplitudes: &[f64]) -> Effect;
    /// Its parameters with their errors, from its amplitudes' covariance.
    fn parameters(
        &self,
        item: usize,
        amplitudes: &[f64],
        covariance: &DMatrix<f64>,
    ) -> BTreeMap<String, Parameter>;
}

/// One joint with all that was found.
pub struct Found<'a> {
    /// Name.
    pub joint: &'a str,
    /// Its rows.
    pub rows: &'a Rows,
    /// What its items are called.
    pub called: &'a dyn Called,
    /// Of its gear.
    pub gear_ratio: f64,
    /// That the file states.
    pub friction: &'a SteadyFriction,
    /// Sum of squares that noise and the twin make up, of all rows.
    pub noise_square: f64,
    /// With what the arm shares.
    pub evidence: &'a Evidence,
    /// Sets by score.
    pub sets: &'a [Scored],
    /// A smooth law on no list that explains something that the names leave.
    pub leaves: Option<Ahead>,
    /// Whether the best set leaves no more than what a twin may be off by; none where nothing tells that, and the noise decides.
    pub is_at_floor: Option<bool>,
    /// Names of what the arm shares, with how many columns each has, in their order; none of what each joint calls its own way.
    pub shared: &'a [(Option<&'static str>, usize)],
    /// Which of these that is, and how it is told here, without a share yet.
    pub of_links: Option<(usize, NamedEffect)>,
    /// The gap of each compared signal.
    pub signals: Vec<SignalGap>,
    /// Whether the joint swings at one frequency, at which a law with a state is two numbers.
    pub is_one_frequency: bool,
    /// Share below which an effect is minor.
    pub materiality: f64,
}

/// What is said of a joint.
pub struct Said {
    /// For the report.
    pub report: JointReport,
    /// Shares here of what the arm shares.
    pub shared: Vec<Interval>,
    /// What the names predict of the gap.
    pub fit: Fit,
}

impl Found<'_> {
    /// The name of an item in a set, whose amplitude may decide it.
    pub(super) fn name_in(&self, names: Names, item: usize) -> &'static str {
        let fit = self.evidence.fit(names);
        let own = fit.amplitudes.iter().find(|(other, _)| *other == item);
        let amplitudes = own.map_or(&[][..], |(_, values)| values.as_slice());
        self.called.effect(item, amplitudes).name()
    }

    /// Items of a set by their place.
    pub(super) fn players(&self, scored: &Scored) -> Vec<usize> {
        (0..self.called.items())
            .filter(|index| scored.names & (1 << index) != 0)
            .collect()
    }

    /// What each name takes off, of what the file's values, and what the arm shares as it is here, leave beside all of them.
    fn game(&self, scored: &Scored) -> Game {
        let players = self.players(scored);
        let count = players.len() + self.shared.len();
        let beside = self.evidence.values_beside(scored.names);
        let left = (0..1_usize << count).map(|set| {
            let chosen = players.iter().enumerate();
            let names = chosen
                .filter(|(place, _)| set & (1 << place) != 0)
                .fold(0, |names: Names, (_, index)| names | 1 << index);
            // the columns of what the arm shares are the last
            let mut values = beside.clone();
            let mut end = values.len();
            for (place, (_, columns)) in self.shared.iter().enumerate().rev() {
                if set & (1 << (players.len() + place)) == 0 {
                    values[end - columns..end].fill(0.0);
                }
                end -= columns;
            }
            self.evidence.left_at(names, &values)
        });
        Game {
            left: left.collect(),
            players: count,
            noise: self.noise_square,
        }
    }

    /// Everything that a report has of the joint. `others`: what the other joints do, row by row.
    pub fn said(&self, others: &[Vec<f64>]) -> Said {
        let best = self.sets[0];
        let fit = self.evidence.fit(best.names);
        let game = self.game(&best);
        let shares = game.shares();
        let weights = self.weights();
        let effects = self.effects(&fit, &shares, &weights);
        let shared = shares.of[shares.of.len() - self.shared.len()..].to_vec();
        let of_links = self.of_links.iter().map(|(place, effect)| {
            let share = shared[*place];
            let effect = NamedEffect {
                share: share.value,
                share_low: share.low,
                share_high: share.high,
                shrink_alone: shares.alone[shares.of.len() - self.shared.len() + place],
                ..effect.clone()
            };
            (false, effect)
        });
        let effects = effects.into_iter();
        let effects = effects.map(|(item, effect)| (self.called.is_usual(item), effect));
        // where nothing tells what a model is off by, what few joints have must take a part of the gap for certain
        let is_floor_known = self.is_at_floor.is_some();
        let (effects, minor_effects): (Vec<_>, Vec<_>) =
            effects.chain(of_links).partition(|(is_usual, effect)| {
                let may_be_uncertain = is_floor_known || *is_usual;
                effect.share >= self.materiality && (may_be_uncertain || effect.share_low > 0.0)
            });
        let [mut effects, minor_effects] = [effects, minor_effects].map(|named| {
            let named = named.into_iter();
            named
                .map(|(_, effect)| effect)
                .collect::<Vec<NamedEffect>>()
        });
        effects.sort_by(|a, b| b.share.total_cmp(&a.share));
        let gap_nm = self.rows.gap_nm();
        // the rows are those of the first signal
        let rest_nm: Vec<f64> = self.evidence.gap_nm()[..self.rows.count()]
            .iter()
            .zip(&fit.predicted_nm)
            .map(|(gap, predicted)| gap - predicted)
            .collect();
        let rows = self.rows.count() as f64;
        let noise = self.noise_square / rows;
        let nothing = game.left[0].iter().sum::<f64>() / rows - noise;
        let left = best.left.iter().sum::<f64>() / rows - noise;
        let mut remaining_over = super::remaining::over(
            self.rows,
            others,
            self.gear_ratio,
            &rest_nm,
            [left, nothing],
        );
        let at_floor = self
            .is_at_floor
            .unwrap_or(left + noise <= ERRORS.powi(2) * noise);
        let torque_nm = &self.rows.measured_nm;
        let torque = torque_nm.iter().map(|x| x * x).sum::<f64>() / rows;
        // what depends on nothing that is looked at is no agreement if it is a part of the torque that matters
        let is_quiet = self
            .is_at_floor
            .unwrap_or(remaining_over.is_empty() && left <= self.materiality * torque);
        let candidates = self.candidates(&weights, &shares, is_quiet);
        let taken = shares.of.iter().map(|share| share.value).sum::<f64>();
        let gap = self.gap(&best, &shares, &gap_nm, nothing);
        let leaves_more = self.leaves.is_some() || self.is_at_floor == Some(false);
        let has_names = !effects.is_empty() || shared.iter().any(|s| s.value >= self.materiality);
        let confusable = self.confusable(&best);
        let is_sure = is_sure(&candidates, &confusable);
        let verdict = if !has_names {
            let is_empty = best.names == 0 && is_quiet && self.is_at_floor.is_none();
            if is_empty || at_floor {
                Verdict::NoGap
            } else {
                Verdict::Unexplained
            }
        } else if !is_sure {
            Verdict::Ambiguous
        } else if at_floor || taken >= EXPLAINED && !leaves_more {
            Verdict::Explained
        } else if taken >= PARTLY {
            Verdict::PartlyExplained
        } else {
            Verdict::Unexplained
        };
        // what a verdict goes by is told, also where the rest alone does not show it
        let is_told = |law: &Ahead| remaining_over.iter().any(|rest| rest.over == law.over);
        let law = self.leaves.filter(|law| !is_told(law));
        if let Some(Ahead { over, left }) =
            law.filter(|_| verdict != Verdict::NoGap && nothing > 0.0)
        {
            remaining_over.push(RemainsOver {
                over,
                share: (best.left.iter().sum::<f64>() - left).max(0.0) / rows / nothing,
                at: Vec::new(),
                torque_nm: Vec::new(),
            });
            remaining_over.sort_by(|a, b| b.share.total_cmp(&a.share));
        }
        let over_velocity = remaining_over
            .iter()
            .any(|rest| rest.over == Remains::Velocity);
        let drives = over_velocity && self.drives(&rest_nm);
        let report = JointReport {
            joint: self.joint.to_owned(),
            verdict,
            reason: reason(
                verdict,
                [has_names, self.leaves.is_some()],
                [taken, shares.remaining.value],
                drives,
            ),
            place: self.place(&effects, &gap_nm, &remaining_over),
            effects,
            minor_effects,
            candidates,
            confusable,
            gap,
            remaining: if remaining_over.is_empty() {
                Remaining::White
            } else {
                Remaining::Structured
            },
            remaining_share: shares.remaining.value,
            remaining_over,
            torque: None,
            plain_friction: self.plain_friction(best.names, &fit),
        };
        Said {
            report,
            shared,
            fit,
        }
    }

    /// Coulomb and viscous friction in the place of all friction of a set, where it has any other or takes more of these two than the file
    /// has: no file holds friction below zero.
    fn plain_friction(&self, names: Names, fit: &Fit) -> Option<PlainFriction> {
        let kind = |item: usize| self.called.effect(item, &[]).kind();
        let items = || (0..self.called.items()).filter(|item| kind(*item).part() == Part::Friction);
        let plain = [EffectKind::CoulombFriction, EffectKind::ViscousFriction];
        let of_plain = plain.map(|plain| items().find(|item| kind(*item) == plain));
        let [Some(coulomb), Some(viscous)] = of_plain else {
            return None;
        };
        let bits = |items: &mut dyn Iterator<Item = usize>| {
            items.fold(0, |names: Names, item| names | 1 << item)
        };
        let value = |item: usize, amplitude: f64| -> f64 {
            let told = numbers(&self.called.effect(item, &[amplitude]));
            told.values().next().copied().unwrap_or(0.0)
        };
        let file = self.friction;
        let least = [
            (coulomb, -file.coulomb.coulomb_nm),
            (viscous, -file.viscous.viscous_nm_s_rad),
        ]
        .map(|(item, least)| {
            let at_zero = value(item, 0.0);
            (item, (least - at_zero) / (value(item, 1.0) - at_zero))
        });
        let plain = bits(&mut [coulomb, viscous].into_iter());
        let friction = bits(&mut items());
        let has_less = |(item, least): &(usize, f64)| {
            let mut named = fit.amplitudes.iter();
            named.any(|(own, amplitudes)| own == item && amplitudes.iter().any(|x| x < least))
        };
        if names & friction & !plain == 0 && !least.iter().any(has_less) {
            return None;
        }
        let (amplitudes, left) = self.evidence.fit_above(names & !friction | plain, &least)?;
        Some(PlainFriction {
            coulomb_nm: value(coulomb, amplitudes[0]),
            viscous_nm_s_rad: value(viscous, amplitudes[1]),
            torque_rms_nm: left.sqrt(),
        })
    }

    /// Probability of each set, by its score.
    fn weights(&self) -> Vec<f64> {
        let scores = self.sets.iter().map(|set| set.score);
        let best = scores.fold(f64::NEG_INFINITY, f64::max);
        let odds = |set: &Scored| (set.score - best).exp();
        let sum: f64 = self.sets.iter().map(odds).sum();
        self.sets.iter().map(|set| odds(set) / sum).collect()
    }

    fn effects(&self, fit: &Fit, shares: &Shares, weights: &[f64]) -> Vec<(usize, NamedEffect)> {
        let mut place = 0;
        let mut all = Vec::new();
        for (player, (item, amplitudes)) in fit.amplitudes.iter().enumerate() {
            let effect = self.called.effect(*item, amplitudes);
            let count = amplitudes.len();
            let covariance = fit.covariance.view((place, place), (count, count));
            let parameters = self
                .called
                .parameters(*item, amplitudes, &covariance.into_owned());
            place += count;
            let share = shares.of[player];
            let kind = self.called.kind(*item);
            let with = self.sets.iter().zip(weights).filter(|(set, _)| {
                let players = self.players(set);
                players.iter().any(|k| self.called.kind(*k) == kind)
            });
            let named = NamedEffect {
                effect: effect.name().to_owned(),
                probability: with.map(|(_, weight)| weight).sum::<f64>().min(1.0),
                parameters,
                side: side(&effect),
                share: share.value,
                share_low: share.low,
                share_high: share.high,
                shrink_alone: shares.alone[player],
                of_links: false,
            };
            all.push((*item, named));
        }
        all
    }

    /// What the largest part of the gap is: each set says its largest share.
    fn candidates(&self, weights: &[f64], of_best: &Shares, is_quiet: bool) -> Vec<Candidate> {
        let mut by_name: BTreeMap<&str, f64> = BTreeMap::new();
        let here = self.of_links.as_ref().map(|(_, effect)| &*effect.effect);
        for (rank, (set, weight)) in self.sets.iter().zip(weights).enumerate() {
            if *weight < WEIGHT_MIN && rank > 0 {
                continue;
            }
            let fresh;
            let shares = if rank == 0 {
                of_best
            } else {
                fresh = self.game(set).shares();
                &fresh
            };
            let players = self.players(set);
            let largest = (0..shares.of.len())
                .max_by(|a, b| shares.of[*a].value.total_cmp(&shares.of[*b].value));
            let name = match largest {
                Some(place) if shares.of[place].value >= shares.remaining.value => {
                    match players.get(place) {
                        Some(index) => self.name_in(set.names, *index),
                        None => self.shared[place - players.len()]
                            .0
                            .or(here)
                            .unwrap_or("unknown"),
                    }
                }
                Some(_) => "unknown",
                None if is_quiet => "none",
                None => "unknown",
            };
            *by_name.entry(name).or_default() += weight;
        }
        let sum: f64 = by_name.values().sum();
        let mut all: Vec<Candidate> = by_name
            .into_iter()
            .map(|(effect, weight)| Candidate {
                effect: effect.to_owned(),
                probability: weight / sum,
            })
            .collect();
        all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        all
    }

    /// Whether what is left goes with the velocity for certain, by a line through zero: no friction does.
    fn drives(&self, rest_nm: &[f64]) -> bool {
        let sum = |of: fn(f64, f64) -> f64| -> f64 {
            let rows = rest_nm.iter().zip(&self.rows.velocity_rad_s);
            rows.map(|(nm, rad_s)| of(*nm, *rad_s)).sum()
        };
        let power = sum(|nm, rad_s| nm * rad_s);
        let squares = sum(|nm, _| nm * nm) * sum(|_, rad_s| rad_s * rad_s);
        let rows = self.evidence.independent_rows();
        power < 0.0 && rows * power * power > DEVIATIONS.powi(2) * (squares - power * power)
    }

    /// `above`: mean square above the noise that shares are parts of.
    fn gap(&self, best: &Scored, shares: &Shares, gap_nm: &[f64], above: f64) -> Gap {
        let rows = self.rows.count().max(1) as f64;
        let before = gap_nm.iter().map(|x| x * x).sum::<f64>() / rows;
        let mut after = best.left.iter().sum::<f64>() / rows;
        if best.names == 0 && self.shared.is_empty() {
            // other values of the file that leave more than it does as it is are not taken
            after = after.min(before);
        }
        let noise = self.noise_square / rows;
        let shrink = |after: f64| {
            if before > noise {
                1.0 - (after - noise) / (before - noise)
            } else {
                0.0
            }
        };
        // the interval is of what the names take; the file's tolerances come off before
        let with = |remaining: f64| shrink(remaining * above + noise);
        Gap {
            torque_rms_nm: BeforeAfter {
                before: before.sqrt(),
                after: after.sqrt(),
                noise_floor: noise.sqrt(),
                held_out: true,
            },
            position_rms_rad: BeforeAfter::default(),
            shrink: shrink(after),
            shrink_low: with(shares.remaining.high).min(shrink(after)),
            shrink_high: with(shares.remaining.low).max(shrink(after)),
        }
    }
}

/// An effect's numbers by their names, without errors yet.
pub fn parameters(effect: &Effect) -> BTreeMap<String, Parameter> {
    let parameter = |value: f64| Parameter {
        value,
        std: 0.0,
        at_bound: false,
    };
    let named = numbers(effect).into_iter();
    named
        .map(|(name, value)| (name, parameter(value)))
        .collect()
}
