//! From the evidence to what a report says of a joint.

use std::collections::BTreeMap;

use joint_model::friction::SteadyFriction;
use nalgebra::DMatrix;
use robot::Effect;

use super::imitation::Ahead;
use super::rows::Rows;
use super::shares::{Game, Interval, Shares};
use super::{DEVIATIONS, ERRORS, Evidence, Fit, NAME_NATS, Names, Scored};
use crate::effects::numbers::{numbers, side};
use crate::report::{
    BandShare, BeforeAfter, Candidate, Confusable, Gap, JointReport, NamedEffect, Parameter,
    PlainFriction, Regime, Remaining, Remains, RemainsOver, SignalGap, Verdict, Where,
};
use robot::{EffectKind, Part, Stage};

/// Share of the gap below which an effect is a minor one, unless the reader wants another.
pub const MATERIALITY: f64 = 0.02;
/// Named effects that take so much explain the gap.
const EXPLAINED: f64 = 0.9;
/// Or, with structure left, explain a part of it.
const PARTLY: f64 = 0.2;
/// Nats by which one name would have to be ahead of another, if it were true, to be told from it: three standard deviations.
const ALIKE: f64 = 0.5 * DEVIATIONS * DEVIATIONS;
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
    fn name_in(&self, names: Names, item: usize) -> &'static str {
        let fit = self.evidence.fit(names);
        let own = fit.amplitudes.iter().find(|(other, _)| *other == item);
        let amplitudes = own.map_or(&[][..], |(_, values)| values.as_slice());
        self.called.effect(item, amplitudes).name()
    }

    /// Items of a set by their place.
    fn players(&self, scored: &Scored) -> Vec<usize> {
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
        let (effects, minor_effects): (Vec<_>, Vec<_>) =
            effects.chain(of_links).partition(|(is_usual, effect)| {
                // what few joints have must take a part of the gap for certain
                effect.share >= self.materiality && (*is_usual || effect.share_low > 0.0)
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

    /// Names that could stand for one another: sets within a few nats that differ in one name.
    fn confusable(&self, best: &Scored) -> Vec<Confusable> {
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
        let is_missed = self.evidence.apart(names, gone, None) > ALIKE;
        let held = (0..self.called.items()).filter(move |item| names & 1 << item != 0);
        let kinds: Vec<usize> = held.map(|item| self.called.kind(item)).collect();
        (0..self.called.items())
            .filter(move |come| is_missed && !kinds.contains(&self.called.kind(*come)))
            .map(move |come| (come, self.evidence.apart(names, gone, Some(come))))
            .filter(|(_, apart)| *apart <= ALIKE)
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

    fn place(&self, effects: &[NamedEffect], gap_nm: &[f64], remaining: &[RemainsOver]) -> Where {
        let mut stages: BTreeMap<Stage, f64> = BTreeMap::new();
        for effect in effects {
            if let Some(stage) = Stage::of(&effect.effect) {
                *stages.entry(stage).or_default() += effect.share.max(0.0);
            }
        }
        let largest = stages.iter().max_by(|a, b| a.1.total_cmp(b.1));
        let stage = largest.map(|(stage, _)| *stage);
        let sum: f64 = stages.values().sum();
        let stages = stages
            .into_iter()
            .map(|(stage, share)| (stage, share / sum.max(f64::MIN_POSITIVE)))
            .collect();
        let mut all = regimes("position_rad", &self.rows.position_rad, gap_nm);
        all.extend(regimes_of_motor(self, gap_nm));
        all.extend(regimes("load_nm", &self.rows.load_nm, gap_nm));
        all.extend(regimes("time_s", &self.rows.time_s, gap_nm));
        Where {
            stage: stage.or_else(|| self.stage_of_single(remaining)),
            stages,
            signals: self.signals.clone(),
            regimes: all,
            bands: bands(self.rows, gap_nm),
        }
    }

    /// Where no name is told: of the one that comes nearest, if anything is left at all.
    fn stage_of_single(&self, remaining: &[RemainsOver]) -> Option<Stage> {
        if remaining.is_empty() {
            return None;
        }
        let items = 0..self.called.items();
        let best = items
            .map(|index| self.evidence.scored(1 << index))
            .max_by(|a, b| a.score.total_cmp(&b.score))?;
        let index = best.names.trailing_zeros() as usize;
        Stage::of(self.name_in(best.names, index))
    }
}

/// Whether the first candidate is told from all others that could stand for it, by the odds that a name costs.
fn is_sure(candidates: &[Candidate], confusable: &[Confusable]) -> bool {
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

fn regimes_of_motor(found: &Found<'_>, gap_nm: &[f64]) -> Vec<Regime> {
    let ratio = found.gear_ratio;
    let velocity = found.rows.velocity_rad_s.iter();
    let motor: Vec<f64> = velocity.map(|v| ratio * v).collect();
    regimes("motor_velocity_rad_s", &motor, gap_nm)
}

/// Shares of the gap's square in five ranges of a variable, each with as many rows.
pub fn regimes(variable: &str, values: &[f64], gap_nm: &[f64]) -> Vec<Regime> {
    const RANGES: usize = 5;
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let square: f64 = gap_nm.iter().map(|x| x * x).sum();
    if order.is_empty() || square <= 0.0 {
        return Vec::new();
    }
    (0..RANGES)
        .map(|range| {
            let within = &order[range * order.len() / RANGES..(range + 1) * order.len() / RANGES];
            let ends = within.first().zip(within.last());
            Regime {
                variable: variable.to_owned(),
                from: ends.map_or(0.0, |(first, _)| values[*first]),
                to: ends.map_or(0.0, |(_, last)| values[*last]),
                share: within.iter().map(|row| gap_nm[*row].powi(2)).sum::<f64>() / square,
            }
        })
        .collect()
}

/// Shares of the gap's square by frequency, octave by octave up to the compared band's end.
fn bands(rows: &Rows, gap_nm: &[f64]) -> Vec<BandShare> {
    use crate::signal::band::{Band, COMPARED_HZ};
    let square: f64 = gap_nm.iter().map(|x| x * x).sum();
    let ends = rows.time_s.first().zip(rows.time_s.last());
    let Some((first, last)) = ends.filter(|(first, last)| last > first && square > 0.0) else {
        return Vec::new();
    };
    let rate_hz = (rows.count() - 1) as f64 / (last - first);
    let below = |hz: f64| {
        let smooth = Band::of(rate_hz, hz).limit(gap_nm).unwrap_or_default();
        smooth.iter().map(|x| x * x).sum::<f64>() / square
    };
    let mut bands = Vec::new();
    let (mut from_hz, mut known) = (0.0, 0.0);
    for octaves in [3, 2, 1, 0] {
        let to_hz = COMPARED_HZ / f64::from(1 << octaves);
        if to_hz > 0.45 * rate_hz && from_hz > 0.0 {
            break;
        }
        let all = if octaves == 0 { 1.0 } else { below(to_hz) };
        bands.push(BandShare {
            from_hz,
            to_hz,
            share: (all - known).max(0.0),
        });
        (from_hz, known) = (to_hz, all);
    }
    bands
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
