//! One case: its truth held against what was predicted.

use std::collections::BTreeMap;

use gap_report::{JointReport, Report, Verdict};
use robot::Stage;
use serde::Serialize;

use crate::label::{CaseKind, Label, TrueEffect};
use crate::rig::RigKind;
use crate::score::parameters::{ParameterError, parameter_errors};

/// The candidate that stands for no gap.
const NONE: &str = "none";
/// The candidate that stands for an effect on no list.
const UNKNOWN: &str = "unknown";
/// Part of a gap that a name may take of a law on no list beyond what that has in common with it: shares are known to a tenth.
const BEYOND: f64 = 0.1;
/// Part of a law on no list that makes a name right for the largest part of it.
const MOST: f64 = 0.5;

/// What is right and wrong about the prediction for one case. None where the question is not asked of its kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judgement {
    /// Name of the case.
    pub case: String,
    /// What kind of answer it has.
    pub kind: CaseKind,
    /// What kind of robot it is about.
    pub rig: RigKind,
    /// Gap over noise that was asked for.
    pub level: f64,
    /// The truth in words.
    pub truth: String,
    /// The prediction in words: verdict and most probable names, or why there is none.
    pub predicted: String,
    /// No gap: something was reported nevertheless.
    pub false_alarm: Option<bool>,
    /// One effect: the most probable name is right.
    pub top_1: Option<bool>,
    /// One effect: a right name is among the three most probable.
    pub top_3: Option<bool>,
    /// One effect: a right name is in the set reported.
    pub in_set: Option<bool>,
    /// One effect: names in that set, equivalent ones counted once.
    pub set_size: Option<usize>,
    /// One effect: the joint with the largest gap over noise is the right one.
    pub joint: Option<bool>,
    /// One effect: the stage is right.
    pub stage: Option<bool>,
    /// Unknown: a gap was told, and no effect of the list took more of it than it has in common with the law, and a tenth.
    pub unknown_recognised: Option<bool>,
    /// One or two effects: called unknown.
    pub called_unknown: Option<bool>,
    /// Pair: the true effect and one that looks alike were called not separable.
    pub not_separable: Option<bool>,
    /// Effects named rightly, named wrongly, and not named.
    pub named: Option<[usize; 3]>,
    /// The most probable statement: what it says, its probability, and whether it is right.
    pub statement: Option<Statement>,
    /// Of the effect named rightly.
    pub parameters: Vec<ParameterError>,
    /// One or two effects: held-out shrink that was reported, and that with the true names.
    pub shrink: Option<[f64; 2]>,
}

/// A statement about the joint in question.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statement {
    /// Identifier of an effect, `none` or `unknown`.
    pub says: String,
    /// What it should say.
    pub truth: String,
    /// Together with equivalent names.
    pub probability: f64,
    /// Whether it is right.
    pub right: bool,
    /// Squared distance between the probabilities and what is true: Brier's score, 0 to 2.
    pub brier: f64,
}

impl Judgement {
    /// Whether anything that was asked was answered wrongly.
    pub fn is_miss(&self) -> bool {
        let wrong = [
            self.false_alarm.map(|alarm| !alarm),
            self.top_1,
            self.in_set,
            self.joint,
            self.stage,
            self.unknown_recognised,
            self.called_unknown.map(|called| !called),
            self.not_separable,
        ];
        wrong.contains(&Some(false))
            || self
                .named
                .is_some_and(|[_, wrong, left_out]| wrong + left_out > 0)
    }
}

/// Holds a prediction against the truth. `Err` says why there is none: then every answer asked for is wrong.
pub(super) fn judge(
    label: &Label,
    predicted: Result<&Report, &str>,
    oracle: Option<f64>,
) -> Judgement {
    let kind = label.kind;
    let asked = |kinds: &[CaseKind]| kinds.contains(&kind);
    let view = predicted.ok().map(|report| View::new(label, report));
    let answer = |kinds: &[CaseKind], of: &dyn Fn(&View<'_>) -> bool, without: bool| {
        asked(kinds).then(|| view.as_ref().map_or(without, of))
    };
    let one = &[CaseKind::OneEffect];
    let statement = view.as_ref().and_then(View::statement);
    let reported = view.as_ref().and_then(|view| view.joint);
    let reported = reported.map_or(0.0, |joint| joint.gap.shrink);
    Judgement {
        shrink: oracle.map(|oracle| [reported, oracle]),
        case: label.case.clone(),
        kind,
        rig: label.rig,
        level: label.level,
        truth: truth_in_words(label),
        predicted: match (&view, predicted) {
            (Some(view), _) => view.in_words(),
            (None, Err(reason)) => reason.to_owned(),
            (None, Ok(_)) => String::new(),
        },
        false_alarm: answer(&[CaseKind::NoGap], &|view| view.is_alarm(), false),
        top_1: answer(one, &|view| view.within_first(1), false),
        top_3: answer(one, &|view| view.within_first(3), false),
        in_set: answer(
            one,
            &|view| view.set().iter().any(|name| view.is_right(name)),
            false,
        ),
        set_size: asked(one).then(|| view.as_ref().map_or(0, View::set_size)),
        joint: answer(one, &|view| view.joint_is_right(), false),
        stage: answer(one, &|view| view.stage_is_right(), false),
        unknown_recognised: answer(&[CaseKind::Unknown], &|view| view.takes_no_more(), false),
        called_unknown: answer(
            &[CaseKind::OneEffect, CaseKind::TwoEffects],
            &|view| view.says_unknown(),
            false,
        ),
        not_separable: answer(&[CaseKind::Pair], &|view| view.says_not_separable(), false),
        named: asked(&[CaseKind::TwoEffects]).then(|| {
            view.as_ref()
                .map_or([0, 0, label.effects.len()], View::named)
        }),
        parameters: match &view {
            Some(view) if asked(one) => parameter_errors(&label.effects[0], view.report),
            _ => Vec::new(),
        },
        statement,
    }
}

/// A report as seen from the joint in question.
struct View<'a> {
    label: &'a Label,
    report: &'a Report,
    /// Joint in question; none where the truth is about the whole arm, or there is none.
    joint: Option<&'a JointReport>,
    /// Names by probability, most probable first, as they are said of the joint in question or of the whole arm.
    pool: Vec<(String, f64)>,
}

impl<'a> View<'a> {
    fn new(label: &'a Label, report: &'a Report) -> Self {
        let joint = asked_joint(label)
            .and_then(|name| report.joints.iter().find(|joint| joint.joint == name));
        let joint = joint.or_else(|| (label.kind == CaseKind::NoGap).then(|| loudest(report))?);
        let mut pool: BTreeMap<&str, f64> = BTreeMap::new();
        let mut add = |name: &'a str, probability: f64| {
            let most = pool.entry(name).or_insert(0.0);
            *most = most.max(probability);
        };
        for seen in &report.joints {
            if joint.is_none_or(|joint| joint.joint == seen.joint) {
                for candidate in &seen.candidates {
                    add(&candidate.effect, candidate.probability);
                }
            }
        }
        for shared in &report.shared_effects {
            if joint.is_none_or(|joint| shared.joints.contains(&joint.joint)) {
                add(&shared.effect.effect, shared.effect.probability);
            }
        }
        let mut pool: Vec<(String, f64)> = pool
            .into_iter()
            .map(|(name, probability)| (name.to_owned(), probability))
            .collect();
        if joint.is_none() {
            // joints that do not see a cause of the whole arm say so
            pool.retain(|(name, _)| name != NONE);
        }
        pool.sort_by(|a, b| b.1.total_cmp(&a.1));
        Self {
            label,
            report,
            joint,
            pool,
        }
    }

    /// Whether a name is one of the right ones.
    fn is_right(&self, name: &str) -> bool {
        match self.label.kind {
            CaseKind::NoGap => name == NONE,
            CaseKind::Unknown => {
                let law = self.label.unlisted.as_ref();
                name == UNKNOWN || law.is_some_and(|law| law.in_common(name) >= MOST)
            }
            CaseKind::Pair => self.label.pair.iter().any(|right| right == name),
            _ => self
                .label
                .effects
                .iter()
                .any(|effect| is_name_of(effect, name)),
        }
    }

    fn within_first(&self, count: usize) -> bool {
        self.pool[..count.min(self.pool.len())]
            .iter()
            .any(|(name, _)| self.is_right(name))
    }

    /// Joints that speak of the truth: the one in question, or all.
    fn joints(&self) -> impl Iterator<Item = &'a JointReport> {
        let joint = self.joint;
        self.report
            .joints
            .iter()
            .filter(move |seen| joint.is_none_or(|joint| joint.joint == seen.joint))
    }

    /// Names reported: effects, and what cannot be told from them.
    fn set(&self) -> Vec<&'a str> {
        let mut names: Vec<&str> = Vec::new();
        for joint in self.joints() {
            names.extend(joint.effects.iter().map(|found| found.effect.as_str()));
            if joint.verdict == Verdict::Ambiguous {
                let alike = joint.confusable.iter().flat_map(|group| &group.effects);
                names.extend(alike.map(String::as_str));
            }
        }
        let shared = self.report.shared_effects.iter().filter(|shared| {
            self.joint
                .is_none_or(|joint| shared.joints.contains(&joint.joint))
        });
        names.extend(shared.map(|shared| shared.effect.effect.as_str()));
        names.sort_unstable();
        names.dedup();
        names
    }

    fn set_size(&self) -> usize {
        let set = self.set();
        let right = set.iter().filter(|name| self.is_right(name)).count();
        set.len() - right.saturating_sub(1)
    }

    fn is_alarm(&self) -> bool {
        let alarmed = |joint: &JointReport| is_flagged(joint.verdict);
        !self.report.shared_effects.is_empty() || self.report.joints.iter().any(alarmed)
    }

    fn joint_is_right(&self) -> bool {
        if self.joint.is_none() {
            return self.is_alarm();
        }
        let flagged = self
            .report
            .joints
            .iter()
            .filter(|joint| is_flagged(joint.verdict));
        let loudest = flagged.max_by(|a, b| gap_to_noise(a).total_cmp(&gap_to_noise(b)));
        loudest.map(|joint| &joint.joint) == self.joint.map(|joint| &joint.joint)
    }

    fn stage_is_right(&self) -> bool {
        let Some(truth) = self.label.effects.first() else {
            return false;
        };
        let said = match self.joint {
            Some(joint) => joint.place.stage,
            None => {
                let shared = self.report.shared_effects.first();
                shared
                    .and_then(|shared| Stage::of(&shared.effect.effect))
                    .or_else(|| loudest(self.report).and_then(|joint| joint.place.stage))
            }
        };
        let equivalent = truth.equivalents.iter().filter_map(|name| Stage::of(name));
        said.is_some_and(|said| said == truth.stage || equivalent.into_iter().any(|s| s == said))
    }

    fn says_unknown(&self) -> bool {
        let top = self.pool.first().is_some_and(|(name, _)| name == UNKNOWN);
        top || self
            .joint
            .is_some_and(|joint| joint.verdict == Verdict::Unexplained)
    }

    /// Whether a gap is told of the joint with the law on no list, and names take no more of it than is theirs.
    fn takes_no_more(&self) -> bool {
        let (Some(law), Some(joint)) = (&self.label.unlisted, self.joint) else {
            return false;
        };
        let is_theirs = |name: &str, share: f64| share <= law.in_common(name) + BEYOND;
        let mut own = joint.effects.iter();
        let mut shared = self.report.shared_effects.iter();
        is_flagged(joint.verdict)
            && own.all(|found| is_theirs(&found.effect, found.share))
            && shared.all(|shared| {
                let share = shared.joint_shares.get(&joint.joint);
                share.is_none_or(|share| is_theirs(&shared.effect.effect, share.share))
            })
    }

    fn says_not_separable(&self) -> bool {
        let Some((truth, alike)) = self.label.pair.split_first() else {
            return false;
        };
        let groups = self.joints().flat_map(|joint| &joint.confusable);
        groups.into_iter().any(|group| {
            group.effects.contains(truth) && alike.iter().any(|name| group.effects.contains(name))
        })
    }

    /// Effects of all joints: named rightly, named wrongly, not named.
    fn named(&self) -> [usize; 3] {
        let mut open: Vec<&TrueEffect> = self.label.effects.iter().collect();
        let (mut right, mut wrong) = (0, 0);
        let own = self.report.joints.iter().flat_map(|joint| {
            let found = joint.effects.iter();
            found.map(|found| (Some(joint.joint.as_str()), found.effect.as_str()))
        });
        let shared = self.report.shared_effects.iter();
        let shared = shared.map(|shared| (None, shared.effect.effect.as_str()));
        for (joint, name) in shared.chain(own) {
            let matching = open.iter().position(|truth| {
                let here = match (joint, truth.joint.as_deref()) {
                    (Some(joint), Some(truth)) => joint == truth,
                    _ => true,
                };
                here && is_name_of(truth, name)
            });
            match matching {
                Some(index) => {
                    open.swap_remove(index);
                    right += 1;
                }
                None => wrong += 1,
            }
        }
        // what a report tells as minor it has found, and it is no error
        for joint in &self.report.joints {
            for found in &joint.minor_effects {
                let matching = open.iter().position(|truth| {
                    let here = truth.joint.as_ref().is_none_or(|on| *on == joint.joint);
                    here && is_name_of(truth, &found.effect)
                });
                if let Some(index) = matching {
                    open.swap_remove(index);
                    right += 1;
                }
            }
        }
        [right, wrong, open.len()]
    }

    /// The most probable statement, equivalent names taken together.
    fn statement(&self) -> Option<Statement> {
        let right: f64 = self
            .pool
            .iter()
            .filter(|(name, _)| self.is_right(name))
            .map(|(_, probability)| probability)
            .sum();
        let wrong = || self.pool.iter().filter(|(name, _)| !self.is_right(name));
        let brier = (1.0 - right).powi(2) + wrong().map(|(_, p)| p * p).sum::<f64>();
        let truth = truth_name(self.label);
        let (says, top) = self.pool.first()?;
        let is_right = self.is_right(says);
        Some(Statement {
            says: if is_right {
                truth.clone()
            } else {
                says.clone()
            },
            truth,
            probability: if is_right { right.min(1.0) } else { *top },
            right: is_right,
            brier,
        })
    }

    fn in_words(&self) -> String {
        let verdict = self
            .joint
            .or_else(|| loudest(self.report))
            .map_or(String::new(), |joint| {
                format!("{}: {:?}; ", joint.joint, joint.verdict)
            });
        let first: Vec<String> = self
            .pool
            .iter()
            .take(3)
            .map(|(name, probability)| format!("{name} {probability:.2}"))
            .collect();
        verdict + &first.join(", ")
    }
}

fn is_name_of(truth: &TrueEffect, name: &str) -> bool {
    truth.effect.name() == name || truth.equivalents.iter().any(|other| other == name)
}

fn is_flagged(verdict: Verdict) -> bool {
    !matches!(verdict, Verdict::NoGap | Verdict::InsufficientData)
}

fn gap_to_noise(joint: &JointReport) -> f64 {
    let torque = &joint.gap.torque_rms_nm;
    torque.before / torque.noise_floor.max(f64::MIN_POSITIVE)
}

/// The joint that is most surely said to have a gap.
fn loudest(report: &Report) -> Option<&JointReport> {
    let sure = |joint: &JointReport| {
        let none = joint.candidates.iter().find(|c| c.effect == NONE);
        1.0 - none.map_or(0.0, |none| none.probability)
    };
    report
        .joints
        .iter()
        .max_by(|a, b| sure(a).total_cmp(&sure(b)))
}

/// The joint that the truth is about, if it is about one.
pub fn asked_joint(label: &Label) -> Option<&str> {
    let effect = label.effects.first().map(|effect| &effect.joint);
    let unlisted = label.unlisted.as_ref().map(|unlisted| &unlisted.joint);
    effect
        .and_then(Option::as_deref)
        .or(unlisted.map(String::as_str))
}

/// The truth as confusion matrix and statements name it.
fn truth_name(label: &Label) -> String {
    match label.kind {
        CaseKind::NoGap => NONE.to_owned(),
        CaseKind::Unknown => UNKNOWN.to_owned(),
        _ => label
            .effects
            .first()
            .map_or(String::new(), |effect| effect.effect.name().to_owned()),
    }
}

fn truth_in_words(label: &Label) -> String {
    let effects = label.effects.iter().map(|truth| {
        let on = truth.joint.as_deref().unwrap_or("arm");
        format!("{on}: {} at {:.2}", truth.effect.name(), truth.gap_to_noise)
    });
    let unlisted = label.unlisted.iter().map(|truth| {
        format!(
            "{}: {} at {:.2}",
            truth.joint,
            truth.law.name(),
            truth.gap_to_noise
        )
    });
    let all: Vec<String> = effects.chain(unlisted).collect();
    if all.is_empty() {
        "no gap".to_owned()
    } else {
        all.join(", ")
    }
}
