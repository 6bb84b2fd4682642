//! Scores of predictions against labels: rates with intervals, calibration, confusion, and every miss.
//!
//! # Definitions
//!
//! The *joint in question* is the one the truth is about; without a gap it is the one most surely said to have one; for
//! causes of the whole arm it is all of them. Names are ranked by the probabilities of that joint's candidates and of
//! shared effects that the joint sees. Names that no recording of such a rig can tell apart count as one. The set
//! reported is the joint's effects and, where it is `ambiguous`, what is confusable. Rates count the levels from 1 up
//! unless they say otherwise: a gap below the noise is in the tables by level alone.

mod calibration;
mod judge;
mod parameters;
mod rate;

use std::collections::BTreeMap;

pub use calibration::{Bin, Calibration};
use gap_report::Report;
pub use judge::{Judgement, Statement, asked_joint};
pub use parameters::ParameterError;
pub use rate::Rate;
use serde::Serialize;

use crate::label::{CaseKind, Label};
use crate::random::Random;
use crate::rig::RigKind;
use rate::{mean, median};

/// Levels from here on are counted.
const COUNTED_LEVEL: f64 = 1.0;
/// Draws of cases for the interval of F1.
const RESAMPLES: usize = 1000;

/// What was predicted for a case: a report, or why there is none.
pub type Prediction = Result<Report, String>;

/// All scores of one set of predictions.
#[derive(Clone, Debug, Serialize)]
pub struct Scores {
    /// Cases with a label.
    pub cases: usize,
    /// Of those, predictions that are missing or failed.
    pub without_prediction: usize,
    /// All rigs, levels from 1 up.
    pub all: Measures,
    /// One kind of rig, levels from 1 up.
    pub by_rig: BTreeMap<RigKind, Measures>,
    /// One level, all rigs; by the level as text.
    pub by_level: BTreeMap<String, Measures>,
    /// Of all cases from level 1 up and those without a gap.
    pub calibration: Calibration,
    /// One effect, unknown and no gap, from level 1 up: how often a truth was called what.
    pub confusion: Vec<Confused>,
    /// Every case with a wrong answer, whatever its level.
    pub misses: Vec<Judgement>,
}

/// The measures over some cases.
#[derive(Clone, Debug, Serialize)]
pub struct Measures {
    /// One effect: the most probable name is right.
    pub top_1: Rate,
    /// One effect: a right name is among the first three.
    pub top_3: Rate,
    /// One effect: a right name is in the set reported.
    pub in_set: Rate,
    /// Mean size of that set.
    pub set_size: Option<f64>,
    /// One effect: right joint.
    pub joint: Rate,
    /// One effect: right stage.
    pub stage: Rate,
    /// No gap: reported as one.
    pub false_alarms: Rate,
    /// Unknown: recognised.
    pub unknown_recognised: Rate,
    /// One or two effects: called unknown.
    pub called_unknown: Rate,
    /// Two effects: F1 over all names of all cases.
    pub two_effects_f1: Option<Interval>,
    /// Pairs called not separable.
    pub not_separable: Rate,
    /// Median of relative errors of parameters of effects named rightly.
    pub parameter_error: Option<f64>,
    /// Parameters within their 95 % interval.
    pub coverage: Rate,
    /// One or two effects: mean shrink reported over mean shrink with the true names; none where no oracle was asked.
    pub shrink_over_oracle: Option<f64>,
}

/// A value with a 95 % interval by resampling cases.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// How often a truth was called by a name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Confused {
    /// What it was.
    pub truth: String,
    /// What it was called.
    pub called: String,
    /// How often.
    pub count: usize,
}

/// Scores predictions, by case name, beside the shrink that an oracle reaches where it was asked.
pub fn score(
    labels: &[Label],
    predictions: &BTreeMap<String, Prediction>,
    oracle: &BTreeMap<String, f64>,
) -> Scores {
    let judgements: Vec<Judgement> = labels
        .iter()
        .map(|label| {
            let predicted = match predictions.get(&label.case) {
                Some(Ok(report)) => Ok(report),
                Some(Err(reason)) => Err(reason.as_str()),
                None => Err("no prediction"),
            };
            judge::judge(label, predicted, oracle.get(&label.case).copied())
        })
        .collect();
    let counted = |judgement: &&Judgement| {
        judgement.kind == CaseKind::NoGap || judgement.level >= COUNTED_LEVEL
    };
    let some = |keep: &dyn Fn(&Judgement) -> bool| -> Vec<&Judgement> {
        judgements
            .iter()
            .filter(|judgement| keep(judgement))
            .collect()
    };
    let all = some(&|judgement| counted(&judgement));
    let statements = all
        .iter()
        .filter_map(|judgement| judgement.statement.as_ref());
    let mut by_level = BTreeMap::new();
    for level in judgements.iter().map(|judgement| judgement.level) {
        let name = format!("{level}");
        by_level
            .entry(name)
            .or_insert_with(|| Measures::of(&some(&|judgement| judgement.level == level)));
    }
    by_level.remove("0");
    let rigs = [RigKind::OneJoint, RigKind::SevenJoints];
    let of_rig = |rig| some(&|judgement| judgement.rig == rig && counted(&judgement));
    Scores {
        cases: labels.len(),
        without_prediction: labels
            .iter()
            .filter(|label| !matches!(predictions.get(&label.case), Some(Ok(_))))
            .count(),
        by_rig: rigs
            .into_iter()
            .map(|rig| (rig, of_rig(rig)))
            .filter(|(_, judgements)| !judgements.is_empty())
            .map(|(rig, judgements)| (rig, Measures::of(&judgements)))
            .collect(),
        by_level,
        calibration: Calibration::of(statements.clone()),
        confusion: confusion(&all),
        all: Measures::of(&all),
        misses: judgements
            .iter()
            .filter(|judgement| judgement.is_miss())
            .cloned()
            .collect(),
    }
}

impl Measures {
    fn of(judgements: &[&Judgement]) -> Self {
        let rate = |answer: fn(&Judgement) -> Option<bool>| {
            Rate::of(judgements.iter().filter_map(|judgement| answer(judgement)))
        };
        let parameters = || {
            let right = judgements
                .iter()
                .filter(|judgement| judgement.top_1 == Some(true));
            right.flat_map(|judgement| &judgement.parameters)
        };
        Self {
            top_1: rate(|judgement| judgement.top_1),
            top_3: rate(|judgement| judgement.top_3),
            in_set: rate(|judgement| judgement.in_set),
            set_size: mean(
                judgements
                    .iter()
                    .filter_map(|judgement| judgement.set_size)
                    .map(|size| size as f64),
            ),
            joint: rate(|judgement| judgement.joint),
            stage: rate(|judgement| judgement.stage),
            false_alarms: rate(|judgement| judgement.false_alarm),
            unknown_recognised: rate(|judgement| judgement.unknown_recognised),
            called_unknown: rate(|judgement| judgement.called_unknown),
            two_effects_f1: f1(judgements),
            not_separable: rate(|judgement| judgement.not_separable),
            parameter_error: median(parameters().filter_map(|error| error.relative).collect()),
            coverage: Rate::of(parameters().map(|error| error.covered)),
            shrink_over_oracle: {
                let shrinks = || judgements.iter().filter_map(|judgement| judgement.shrink);
                let reported = mean(shrinks().map(|[reported, _]| reported));
                // where the true names make a gap larger, as one near the floor may be, naming none is the better answer
                let oracle = mean(shrinks().map(|[_, oracle]| oracle.max(0.0)));
                reported
                    .zip(oracle)
                    .filter(|(_, oracle)| *oracle > 0.0)
                    .map(|(reported, oracle)| reported / oracle)
            },
        }
    }
}

/// `2·right/(2·right + wrong + left out)` over all cases, with the interval of cases drawn again and again.
fn f1(judgements: &[&Judgement]) -> Option<Interval> {
    let named: Vec<[usize; 3]> = judgements
        .iter()
        .filter_map(|judgement| judgement.named)
        .collect();
    if named.is_empty() {
        return None;
    }
    let value = |chosen: &mut dyn Iterator<Item = [usize; 3]>| {
        let sum = chosen.fold([0; 3], |sum, one| {
            [0, 1, 2].map(|part| sum[part] + one[part])
        });
        let [right, wrong, left_out] = sum.map(|count| count as f64);
        2.0 * right / (2.0 * right + wrong + left_out)
    };
    let mut random = Random::new(1, 0);
    let mut drawn: Vec<f64> = (0..RESAMPLES)
        .map(|_| value(&mut (0..named.len()).map(|_| named[random.index(named.len())])))
        .collect();
    drawn.sort_by(f64::total_cmp);
    let at = |share: f64| drawn[(share * (RESAMPLES - 1) as f64) as usize];
    Some(Interval {
        value: value(&mut named.iter().copied()),
        low: at(0.025),
        high: at(0.975),
    })
}

fn confusion(judgements: &[&Judgement]) -> Vec<Confused> {
    let kinds = [CaseKind::NoGap, CaseKind::OneEffect, CaseKind::Unknown];
    let mut counts: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for judgement in judgements {
        if let Some(statement) = &judgement.statement
            && kinds.contains(&judgement.kind)
        {
            *counts
                .entry((&statement.truth, &statement.says))
                .or_insert(0) += 1;
        }
    }
    counts
        .into_iter()
        .map(|((truth, called), count)| Confused {
            truth: truth.to_owned(),
            called: called.to_owned(),
            count,
        })
        .collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests;
