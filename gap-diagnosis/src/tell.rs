//! What is told of one joint: verdict, effects with their values, candidates, where the gap lies.

use std::collections::BTreeMap;

use joint_model::filter::FilterError;
use robot::Effect;

use crate::confuse;
use crate::diagnose::JointTraces;
use crate::evidence::{Remains, SAME_TORQUE, most_left};
use crate::explain::Explanation;
use crate::found::Found;
use crate::judge;
use crate::observe::Channel;
use crate::place;
use crate::report::{
    Candidate, Confusable, Gap, JointReport, NamedEffect, Remaining, Verdict, Where,
};
use crate::search::{Model, Search};
use crate::shared::{CommonDelay, Shared};
use crate::stage::Stage;
use crate::step::Step;

/// Names explain a gap that shrinks this far, or to this many times its floor: away from reversals the floor is noise and twin,
/// and near them the twin is off by more.
const SHRINK_MIN: f64 = 0.9;
const ABOVE_FLOOR: f64 = 3.0;
/// Names that shrink it by less than half explain it only within its floor, or not far above.
const SHRINK_HALF: f64 = 0.5;
const NEAR_FLOOR: f64 = 1.5;
/// Probability of what was counted in the samples.
const COUNTED: f64 = 0.97;
/// How often a sure diagnosis was wrong on development cases.
const RISK: f64 = 0.06;
/// Part of it that is the risk of something on no list: of the wrong answers to development cases that had one most were another
/// name of the list, or none.
const RISK_OF_UNKNOWN: f64 = 0.25;
/// Nats over which the rest of it falls from what comes nearest to what comes next.
const RISK_NATS: f64 = 10.0;
/// Probability below which an effect that was tried is no answer.
const RULED_OUT: f64 = 1e-3;
/// Share of the candidates that are beside the first cause.
const BESIDE: f64 = 0.15;
/// Candidates less probable than this are not listed.
const LISTED_MIN: f64 = 1e-4;

/// Everything known about one joint.
pub(crate) struct Told<'a> {
    pub name: &'a str,
    pub search: &'a Search<'a>,
    pub explanation: &'a Explanation,
    /// Index in the robot file.
    pub joint: usize,
    pub counted: &'a [Found],
    pub shared: Vec<&'a Shared>,
    /// A delay that this joint may share with others.
    pub common: Option<&'a CommonDelay>,
    pub poverty: Option<&'static str>,
}

impl Told<'_> {
    pub fn report(&self) -> Result<JointReport, FilterError> {
        let before_nm = self.search.residual_nm(&Model::default())?;
        let (after_nm, covariance) = self.search.held_out(&self.explanation.refined);
        let mut gap = judge::gap(self.search, &before_nm, &after_nm);
        let nominal = Model::default();
        gap.position_rms_rad =
            judge::position_rms_rad(self.search, &nominal, &self.explanation.refined.model);
        let effects = self.effects(&before_nm, &covariance);
        let candidates = self.candidates();
        let confusable = confuse::pairs(self);
        let verdict = self.verdict(&effects, &confusable, &gap);
        let has_gap = verdict != Verdict::NoGap;
        let remaining = match (self.explanation.remains(), verdict) {
            (Remains::Nothing, Verdict::PartlyExplained) => Remaining::Structured,
            (Remains::Nothing, _) => Remaining::White,
            (Remains::Something | Remains::Most, _) => Remaining::Structured,
        };
        if !has_gap {
            (gap.shrink, gap.shrink_low, gap.shrink_high) = (0.0, 0.0, 0.0);
        }
        Ok(JointReport {
            joint: self.name.to_owned(),
            verdict,
            reason: self.reason(verdict, &effects, &gap),
            place: self.place(&before_nm, &candidates, has_gap),
            effects,
            candidates,
            confusable,
            minor_effects: Vec::new(),
            remaining_share: 1.0 - gap.shrink,
            remaining_over: Vec::new(),
            gap,
            remaining,
        })
    }

    pub fn last(&self) -> &Step {
        self.explanation.last()
    }

    pub fn added(&self) -> impl Iterator<Item = &Step> {
        self.explanation
            .rounds
            .iter()
            .filter(|step| step.added.is_some())
    }

    fn effects(&self, before_nm: &[f64], covariance: &nalgebra::DMatrix<f64>) -> Vec<NamedEffect> {
        let refined = &self.explanation.refined;
        let mut effects: Vec<NamedEffect> = self
            .added()
            .enumerate()
            .map(|(term, step)| {
                let name = refined.model.terms[term].hypothesis.effect;
                let (parameters, side) = judge::parameters(self.search, refined, covariance, term);
                NamedEffect {
                    effect: name.to_owned(),
                    probability: (1.0 - RISK) * step.probability_of(name),
                    parameters,
                    side,
                    share: 0.0,
                    share_low: 0.0,
                    share_high: 0.0,
                    shrink_alone: judge::shrink_alone(self.search, refined, &[], term, before_nm),
                }
            })
            .collect();
        merge_harmonics(&mut effects);
        let own = self.counted.iter().filter(|found| !self.is_common(found));
        effects.extend(own.map(counted_effect));
        effects.sort_by(|a, b| b.shrink_alone.total_cmp(&a.shrink_alone));
        effects
    }

    fn is_common(&self, found: &Found) -> bool {
        self.common
            .is_some_and(|common| common.is_seen_as(found, self.joint))
    }

    /// Names of the shared effects that this joint sees.
    fn shared_names(&self) -> impl Iterator<Item = &str> {
        let fitted = self.shared.iter();
        let fitted = fitted.map(|shared| shared.term.hypothesis.effect);
        let common = self.counted.iter().filter(|found| self.is_common(found));
        fitted.chain(common.map(|found| found.effect.name()))
    }

    /// Probabilities of the steps that added something, or of the last one, with what was counted in the samples.
    pub fn candidates(&self) -> Vec<Candidate> {
        let steps: Vec<&Step> = self.added().collect();
        let steps = if steps.is_empty() {
            vec![self.last()]
        } else {
            steps
        };
        let unknown = self.explanation.unknown_probability();
        let mut sums: BTreeMap<&str, f64> = BTreeMap::from([("unknown", unknown)]);
        let rest = if self.counted.is_empty() && self.shared.is_empty() {
            1.0
        } else if steps.len() == 1 && steps[0].probabilities[0].effect == "none" {
            1.0 - COUNTED
        } else {
            BESIDE
        };
        for (step, part) in steps.iter().zip(parts(&steps)) {
            let share = rest * (1.0 - unknown) * part;
            for p in &step.probabilities {
                *sums.entry(p.effect).or_default() += share * p.probability;
            }
        }
        let beside = self.counted.len() + self.shared.len();
        for found in self.counted {
            let share = (1.0 - rest) / beside as f64;
            for name in names(found) {
                *sums.entry(name).or_default() += share / names(found).len() as f64;
            }
        }
        for shared in &self.shared {
            *sums.entry(shared.term.hypothesis.effect).or_default() += (1.0 - rest) / beside as f64;
        }
        let mut all: Vec<Candidate> = sums
            .into_iter()
            .filter(|(name, p)| *p >= LISTED_MIN || *name == "none" || *name == "unknown")
            .map(|(name, probability)| Candidate {
                effect: name.to_owned(),
                probability,
            })
            .collect();
        let total: f64 = all.iter().map(|candidate| candidate.probability).sum();
        for candidate in &mut all {
            candidate.probability /= total;
        }
        all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        let asked = steps
            .iter()
            .max_by(|a, b| a.best_nats.total_cmp(&b.best_nats));
        with_risk(
            &mut all,
            &asked.map_or_else(Vec::new, |step| step.nats_by_name()),
        );
        all
    }

    fn verdict(&self, effects: &[NamedEffect], confusable: &[Confusable], gap: &Gap) -> Verdict {
        let remains = self.explanation.remains();
        if effects.is_empty() && self.shared_names().next().is_none() {
            return match remains {
                Remains::Nothing if self.last().outweighs_none() => Verdict::Ambiguous,
                Remains::Nothing => Verdict::NoGap,
                _ => Verdict::Unexplained,
            };
        }
        let is_named = |name: &String| effects.iter().any(|effect| effect.effect == *name);
        let concerns_named =
            |pair: &&Confusable| effects.is_empty() || pair.effects.iter().any(is_named);
        // on poor motion laws that are nearly the same differ by less than any law is off, whatever the evidence says
        let is_tenable = |pair: &&Confusable| {
            self.poverty.is_some() || !pair.effects.iter().any(|name| self.is_ruled_out(name))
        };
        if remains != Remains::Nothing {
            Verdict::PartlyExplained
        } else if confusable
            .iter()
            .filter(concerns_named)
            .filter(is_tenable)
            .any(|pair| pair.distance < confuse::DISTANCE_MIN || self.poverty.is_some())
            || effects.iter().any(|effect| effect.probability < 0.5)
        {
            Verdict::Ambiguous
        } else if falls_short(gap) {
            Verdict::PartlyExplained
        } else {
            Verdict::Explained
        }
    }

    /// Whether an effect was tried and is no answer, however near its response is to one's.
    fn is_ruled_out(&self, effect: &str) -> bool {
        let of_steps = self.added().filter_map(|step| {
            let mut all = step.probabilities.iter();
            all.find(|p| p.effect == effect).map(|p| p.probability)
        });
        is_ruled_out(effect, of_steps)
    }

    fn reason(&self, verdict: Verdict, effects: &[NamedEffect], gap: &Gap) -> String {
        let torque = &gap.torque_rms_nm;
        let sizes = format!(
            "{:.3} Nm before, {:.3} Nm after, noise and twin {:.3} Nm",
            torque.before, torque.after, torque.noise_floor
        );
        let counted: Vec<&str> = self
            .counted
            .iter()
            .map(|found| found.because.as_str())
            .collect();
        let names: Vec<&str> = effects
            .iter()
            .map(|effect| effect.effect.as_str())
            .chain(self.shared_names())
            .collect();
        let mut reason = match verdict {
            Verdict::NoGap => format!(
                "nothing beyond noise and the tolerance of the known values ({:.3} Nm)",
                torque.before
            ),
            Verdict::Unexplained => {
                format!(
                    "a gap that no candidate accounts for: {sizes}; a torque {}",
                    self.left_over()
                )
            }
            Verdict::Ambiguous => format!(
                "{} or what it is confused with: {sizes}",
                names.join(" and ")
            ),
            Verdict::PartlyExplained => {
                let named = names.join(" and ");
                format!(
                    "{named} and something else: {sizes}; a torque {} is left",
                    self.left_over()
                )
            }
            Verdict::Explained | Verdict::InsufficientData => {
                format!("{}: {sizes}", names.join(" and "))
            }
        };
        for because in counted {
            reason.push_str("; ");
            reason.push_str(because);
        }
        reason
    }

    /// Over what a torque of no named law lies.
    fn left_over(&self) -> String {
        most_left(&self.last().structure).map_or_else(
            || "of no shape".to_owned(),
            |(over, _)| format!("over {over}"),
        )
    }

    fn place(&self, before_nm: &[f64], candidates: &[Candidate], has_gap: bool) -> Where {
        let mut stages: BTreeMap<Stage, f64> = BTreeMap::new();
        for candidate in candidates {
            if candidate.effect != "none" && candidate.effect != "unknown" {
                *stages.entry(Stage::of(&candidate.effect)).or_default() += candidate.probability;
            }
        }
        if stages.values().sum::<f64>() < 0.1 {
            // nothing is named: what comes nearest says where to look
            stages = self.nearest_stages();
        }
        let total: f64 = stages.values().sum();
        for share in stages.values_mut() {
            *share /= f64::max(total, 1e-300);
        }
        let likeliest = stages
            .iter()
            .max_by(|a, b| a.1.total_cmp(b.1))
            .map(|(stage, _)| *stage);
        Where {
            stage: likeliest.filter(|_| has_gap),
            stages,
            signals: place::signals(self.search, before_nm),
            regimes: place::regimes(self.search, before_nm),
            bands: place::bands(self.search, before_nm),
        }
    }

    fn nearest_stages(&self) -> BTreeMap<Stage, f64> {
        let step = self.last();
        let best = step
            .standings
            .effects
            .first()
            .map_or(0.0, |(_, nats)| *nats);
        let mut stages = BTreeMap::new();
        for (index, nats) in &step.standings.effects {
            let stage = step.round.ranking.scored[*index].hypothesis.stage();
            *stages.entry(stage).or_default() += (0.1 * (nats - best)).exp();
        }
        stages
    }

    pub fn traces(&self) -> Result<JointTraces, FilterError> {
        let before_nm = self.search.residual_nm(&Model::default())?;
        let after_nm = &self.explanation.refined.residual_nm;
        let rows: Vec<usize> = (0..self.search.twin.rows.len())
            .filter(|k| {
                let row = &self.search.twin.rows[*k];
                row.channel == Channel::Motor && row.stretch == 0
            })
            .collect();
        let pick = |of: &dyn Fn(usize) -> f64| rows.iter().map(|k| of(*k)).collect::<Vec<f64>>();
        let measured = &self.search.measured_nm;
        Ok(JointTraces {
            joint: self.name.to_owned(),
            time_s: pick(&|k| self.search.twin.rows[k].time_s),
            measured_nm: pick(&|k| measured[k]),
            nominal_nm: pick(&|k| measured[k] - before_nm[k]),
            augmented_nm: pick(&|k| measured[k] - after_nm[k]),
            position_rad: Vec::new(),
            velocity_rad_s: Vec::new(),
        })
    }
}

/// Whether an effect of these probabilities, in the steps that tried it, is no answer. A response that known values off by more than
/// their tolerances imitate is no other answer as long as the effect they are called after is none.
fn is_ruled_out(effect: &str, of_steps: impl Iterator<Item = f64>) -> bool {
    let most = of_steps.reduce(f64::max);
    !SAME_TORQUE.contains(&effect) && most.is_some_and(|most| most < RULED_OUT)
}

/// Whether names leave a gap that is larger than the floor and no small part of what it was.
fn falls_short(gap: &Gap) -> bool {
    let torque = &gap.torque_rms_nm;
    let is_above = |floors: f64| torque.after > floors * torque.noise_floor;
    gap.shrink < SHRINK_MIN && is_above(ABOVE_FLOOR)
        || gap.shrink < SHRINK_HALF && is_above(NEAR_FLOOR)
}

/// A kinematic error has up to three harmonics: one effect, parameters numbered by rising cycles.
fn merge_harmonics(effects: &mut Vec<NamedEffect>) {
    let cycles = |effect: &NamedEffect| {
        let of = (effect.effect == "kinematic_error").then_some("cycles_per_motor_rev");
        of.and_then(|name| effect.parameters.get(name))
            .map_or(0.0, |cycles| cycles.value)
    };
    effects.sort_by(|a, b| cycles(a).total_cmp(&cycles(b)));
    let mut merged: Vec<NamedEffect> = Vec::with_capacity(effects.len());
    let mut harmonic = 1;
    for effect in effects.drain(..) {
        let first = merged
            .iter_mut()
            .find(|first| first.effect == "kinematic_error" && effect.effect == first.effect);
        let Some(first) = first else {
            merged.push(effect);
            continue;
        };
        harmonic += 1;
        let numbered = effect
            .parameters
            .into_iter()
            .map(|(name, parameter)| (format!("{name}_{harmonic}"), parameter));
        first.parameters.extend(numbered);
        first.shrink_alone = first.shrink_alone.max(effect.shrink_alone);
    }
    *effects = merged;
}

/// The diagnosis itself may be wrong: what development cases showed goes to the other names by what would remain of their evidence if it
/// were worth less than was thought, and a part to `unknown`, or to `none` where that leads. Effects are given with their nats.
fn with_risk(all: &mut Vec<Candidate>, effects: &[(&str, f64)]) {
    let leading = all
        .first()
        .map_or_else(String::new, |first| first.effect.clone());
    let rest_to = if leading == "unknown" {
        "none"
    } else {
        "unknown"
    };
    for candidate in all.iter_mut() {
        candidate.probability *= 1.0 - RISK;
    }
    // what is as probable as the leading answer gets none of it, and so does not overtake that
    let most = all.first().map_or(1.0, |first| first.probability.max(1e-9));
    let missing = |effect: &str| {
        let mut own = all.iter().filter(|candidate| candidate.effect == effect);
        1.0 - own.next().map_or(0.0, |own| own.probability / most)
    };
    let others = effects.iter().filter(|(effect, _)| *effect != leading);
    let best = others.clone().map(|(_, nats)| *nats);
    let best = best.fold(f64::NEG_INFINITY, f64::max);
    let near = |nats: f64| ((nats - best) / RISK_NATS).exp();
    let sum: f64 = others.clone().map(|(_, nats)| near(*nats)).sum();
    let shares: Vec<(&str, f64)> = others
        .map(|(effect, nats)| (*effect, near(*nats) / sum * missing(effect)))
        .map(|(effect, part)| (effect, (1.0 - RISK_OF_UNKNOWN) * RISK * part))
        .filter(|(_, share)| *share >= LISTED_MIN)
        .collect();
    let rest = RISK - shares.iter().map(|(_, share)| share).sum::<f64>();
    let mut add = |effect: &str, probability: f64| match all
        .iter_mut()
        .find(|candidate| candidate.effect == effect)
    {
        Some(candidate) => candidate.probability += probability,
        None => all.push(Candidate {
            effect: effect.to_owned(),
            probability,
        }),
    };
    add(rest_to, rest);
    for (effect, share) in shares {
        add(effect, share);
    }
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
}

/// How the candidates of several steps share: they answer what most of the gap is.
fn parts(steps: &[&Step]) -> Vec<f64> {
    let most = steps.iter().enumerate();
    let most = most.max_by(|a, b| a.1.best_nats.total_cmp(&b.1.best_nats));
    let further = steps.len().saturating_sub(1).max(1) as f64;
    (0..steps.len())
        .map(|index| match most {
            Some((main, _)) if main != index => BESIDE / further,
            _ if steps.len() > 1 => 1.0 - BESIDE,
            _ => 1.0,
        })
        .collect()
}

/// What a finding may be called: command and position show only the sum of both delays.
pub(crate) fn names(found: &Found) -> &[&'static str] {
    match found.effect {
        Effect::CommandDelay { .. } => &["command_delay", "sensor_delay"],
        Effect::CurrentLoopLag { .. } => &["current_loop_lag"],
        Effect::DroppedCommands { .. } => &["dropped_commands"],
        Effect::DroppedSamples { .. } => &["dropped_samples"],
        Effect::VelocityFilterLag { .. } => &["velocity_filter_lag"],
        _ => &["encoder_quantisation"],
    }
}

pub(crate) fn counted_effect(found: &Found) -> NamedEffect {
    let std = found.std;
    let parameters = judge::numbers(&found.effect)
        .into_iter()
        .map(|(name, value)| {
            let parameter = crate::report::Parameter {
                value,
                std,
                at_bound: false,
            };
            (name, parameter)
        })
        .collect();
    let side = match found.effect {
        Effect::EncoderQuantisation { side, .. } => Some(format!("{side:?}").to_lowercase()),
        _ => None,
    };
    NamedEffect {
        effect: found.effect.name().to_owned(),
        probability: COUNTED / names(found).len() as f64,
        parameters,
        side,
        share: 0.0,
        share_low: 0.0,
        share_high: 0.0,
        shrink_alone: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Parameter;

    fn named(effect: &str, cycles: f64) -> NamedEffect {
        let parameter = |value: f64| Parameter {
            value,
            std: 0.0,
            at_bound: false,
        };
        NamedEffect {
            effect: effect.to_owned(),
            probability: 0.9,
            parameters: [
                ("cycles_per_motor_rev".to_owned(), parameter(cycles)),
                ("amplitude_rad".to_owned(), parameter(1e-4 * cycles)),
            ]
            .into(),
            side: None,
            share: 0.0,
            share_low: 0.0,
            share_high: 0.0,
            shrink_alone: 0.1 * cycles,
        }
    }

    fn candidates(of: &[(&str, f64)]) -> Vec<Candidate> {
        let of = of.iter().map(|(effect, probability)| Candidate {
            effect: (*effect).to_owned(),
            probability: *probability,
        });
        of.collect()
    }

    #[test]
    fn the_risk_goes_to_what_comes_nearest_and_changes_no_order() {
        let near = [("viscous_friction", -4.0), ("stribeck_friction", -8.0)];
        let mut all = candidates(&[("none", 0.99), ("viscous_friction", 0.01), ("unknown", 0.0)]);
        with_risk(&mut all, &near);
        let names: Vec<&str> = all.iter().map(|one| one.effect.as_str()).collect();
        assert_eq!(
            names,
            ["none", "viscous_friction", "stribeck_friction", "unknown"]
        );
        let sum: f64 = all.iter().map(|one| one.probability).sum();
        assert!((sum - 1.0).abs() < 1e-12);
        // as probable as the leading one, or nearly
        let near = [("a", 50.0), ("b", 50.0), ("c", 49.9)];
        let mut all = candidates(&[("a", 0.34), ("b", 0.34), ("c", 0.32), ("unknown", 0.0)]);
        with_risk(&mut all, &near);
        assert_eq!(all[0].effect, "a");
        assert_eq!(all[0].probability, all[1].probability);
        assert_eq!(all[2].effect, "c");
        // nothing comes near what is on no list
        let mut all = candidates(&[("unknown", 1.0), ("none", 0.0)]);
        with_risk(&mut all, &[]);
        assert!((all[1].probability - RISK).abs() < 1e-12);
    }

    #[test]
    fn what_was_tried_and_is_improbable_is_no_other_answer() {
        assert!(is_ruled_out("payload", [1e-6, 1e-4].into_iter()));
        assert!(!is_ruled_out("payload", [1e-6, 0.2].into_iter()));
        // what was not tried is not ruled out, nor what nothing tells from another
        assert!(!is_ruled_out("payload", std::iter::empty()));
        assert!(!is_ruled_out("torque_offset", [1e-6].into_iter()));
    }

    #[test]
    fn harmonics_are_one_effect_numbered_by_rising_cycles() {
        let mut effects = vec![
            named("kinematic_error", 2.0),
            named("torque_ripple", 6.0),
            named("kinematic_error", 1.0),
        ];
        merge_harmonics(&mut effects);
        assert_eq!(effects.len(), 2);
        let error = effects
            .iter()
            .find(|effect| effect.effect == "kinematic_error");
        let parameters = &error.map(|error| &error.parameters);
        let value = |name: &str| parameters.map(|all| all[name].value);
        assert_eq!(value("cycles_per_motor_rev"), Some(1.0));
        assert_eq!(value("cycles_per_motor_rev_2"), Some(2.0));
        assert_eq!(value("amplitude_rad_2"), Some(2e-4));
    }
}
