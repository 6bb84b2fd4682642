//! The whole diagnosis: check the data, explain every joint, look for shared causes, judge, report.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use joint_model::filter::FilterError;
use recording::Recording;
use robot::{Effect, Robot};

use crate::beside::{self, Beside, Searched};
use crate::control;
use crate::data::{self, Checked};
use crate::explain::{Beginning, Explanation};
use crate::found::Found;
use crate::hypothesis;
use crate::judge;
use crate::mend;
use crate::on_all_cores::OnAllCores;
use crate::ratio;
use crate::repeats::floor::Repeated;
use crate::report::{
    Candidate, DataFinding, Gap, JointReport, NamedEffect, Remaining, Report, SCHEMA, SharedEffect,
    TwinKind, Verdict, Where,
};
use crate::reversals;
use crate::samples;
use crate::scale::Scale;
use crate::search::{Search, Term};
use crate::shared::{self, Seen, Shared};
use crate::stretch::{StretchError, stretches};
use crate::tell::{Told, counted_effect};
use crate::timing::Timing;
use crate::twin::JointTwin;

/// Why a diagnosis cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// The recordings cannot be cut into stretches.
    #[error(transparent)]
    Stretch(#[from] StretchError),
    /// A filter cannot be designed.
    #[error("the recording's rate or the controller's filter does not fit: {0}")]
    Filter(#[from] FilterError),
    /// Nothing was given.
    #[error("no recording was given")]
    Nothing,
}

/// How far a diagnosis is.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Joints that are done.
    pub done: usize,
    /// Joints in all.
    pub of: usize,
}

/// Torque of one joint over time: disturbance torque measured, by the robot file, and by the file with the effects.
#[derive(Clone, Debug, PartialEq)]
pub struct JointTraces {
    /// Name.
    pub joint: String,
    /// Since the recording began, of its first stretch.
    pub time_s: Vec<f64>,
    /// From the recording.
    pub measured_nm: Vec<f64>,
    /// From the twin as the robot file has it.
    pub nominal_nm: Vec<f64>,
    /// From the twin with the effects.
    pub augmented_nm: Vec<f64>,
    /// Joint angle in the same rows; empty where they are not told.
    pub position_rad: Vec<f64>,
    /// Its rate.
    pub velocity_rad_s: Vec<f64>,
}

/// A report with what its pictures need.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The report.
    pub report: Report,
    /// In the robot file's order, of joints that could be diagnosed.
    pub traces: Vec<JointTraces>,
}

/// Diagnoses a robot from recordings with their names.
///
/// # Errors
/// [`DiagnoseError`].
pub fn diagnose(
    robot: &Robot,
    recordings: &[(String, Recording)],
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Diagnosis, DiagnoseError> {
    let begin = Instant::now();
    let tables: Vec<&Recording> = recordings.iter().map(|(_, recording)| recording).collect();
    if tables.is_empty() {
        return Err(DiagnoseError::Nothing);
    }
    let mut checked = Checked::of(robot, &tables);
    let against: Vec<Option<String>> = robot
        .joints
        .iter()
        .map(|joint| checked.against(&joint.name))
        .collect();
    let mut report = blank_report(robot, recordings)?;
    let mut traces = Vec::new();
    if against.iter().all(Option::is_some) {
        let blank = robot.joints.iter().zip(against);
        report.joints = blank
            .map(|(joint, why)| insufficient(&joint.name, why.unwrap_or_default()))
            .collect();
    } else {
        let prepared = prepared(robot, &tables, |index| against[index].is_none());
        report.data.extend(prepared.findings.iter().cloned());
        let tables = prepared.tables(&tables);
        let (robot, counted) = (&prepared.robot, &prepared.counted);
        let stretches = stretches(&tables, robot)?;
        let twins = robot
            .joints
            .iter()
            .enumerate()
            .on_all_cores(|(index, _)| {
                if against[index].is_some() {
                    return Ok(None);
                }
                JointTwin::new(robot, index, &stretches)
            })
            .collect::<Result<Vec<_>, FilterError>>()?;
        let repeated = Repeated::among(recordings);
        let (joints, shared) = searched(robot, &twins, counted, &repeated, progress)?;
        let (joints, notes) = reversals::looked_at(robot, joints)?;
        report.data.extend(notes);
        let tried = Beside::among(robot, &joints);
        let stretches = tried
            .iter()
            .on_all_cores(|beside| self::stretches(&tables, &beside.robot))
            .collect::<Result<Vec<_>, StretchError>>()?;
        let twins = tried
            .iter()
            .zip(&stretches)
            .on_all_cores(|(beside, stretches)| beside.twins(stretches))
            .collect::<Result<Vec<_>, FilterError>>()?;
        let (joints, notes) = beside::explained_again(&tried, &twins, joints, &repeated)?;
        report.data.extend(notes);
        report.data.extend(repeated.that_differ());
        checked.add(ratio::doubted(robot, &tables, counted, &joints)?);
        let common = shared::common_delay(counted);
        let told = joints
            .iter()
            .enumerate()
            .on_all_cores(|(index, joint)| {
                let name = &robot.joints[index].name;
                if let Some(why) = checked.against(name) {
                    return Ok((insufficient(name, why), Vec::new(), None));
                }
                let Some((search, explanation)) = joint else {
                    let why = "nothing tells the joint's torque".to_owned();
                    return Ok((insufficient(name, why), Vec::new(), None));
                };
                let seen = shared
                    .iter()
                    .filter(|shared| shared.joints.contains(&index));
                let told = Told {
                    name,
                    search,
                    explanation,
                    joint: index,
                    counted: &counted[index],
                    shared: seen.collect(),
                    common: common.as_ref(),
                    poverty: checked.poverty(name),
                };
                let mut findings: Vec<DataFinding> =
                    repeated.floor(name, search).into_iter().collect();
                findings.extend(data::vibration(name, search));
                if told.poverty.is_none() {
                    // at one speed a delay and a zero are the same, and neither would be known to be off
                    findings.extend(data::encoders(name, search, &explanation.refined));
                }
                Ok((told.report()?, findings, Some(told.traces()?)))
            })
            .collect::<Result<Vec<_>, FilterError>>()?;
        for (joint, findings, of_joint) in told {
            report.joints.push(joint);
            report.data.extend(findings);
            traces.extend(of_joint);
        }
        let fitted = shared.iter();
        report.shared_effects = fitted
            .map(|shared| shared_effect(robot, &joints, shared))
            .chain(common.iter().map(|common| SharedEffect {
                effect: counted_effect(&common.found),
                joints: names_of(robot, &common.joints),
                joint_shares: BTreeMap::new(),
            }))
            .collect();
    }
    for joint in &mut report.joints {
        share_out(joint);
    }
    report.data.splice(..0, checked.report());
    report.data.sort_by_key(DataFinding::rank);
    report.compute_seconds = begin.elapsed().as_secs_f64();
    Ok(Diagnosis { report, traces })
}

/// Shares from what each effect takes off alone, in proportion, of what all take off together.
fn share_out(joint: &mut JointReport) {
    let sum: f64 = joint.effects.iter().map(|e| e.shrink_alone.max(0.0)).sum();
    let gap = joint.gap;
    for effect in &mut joint.effects {
        let part = if sum > 0.0 {
            effect.shrink_alone.max(0.0) / sum
        } else {
            0.0
        };
        effect.share = part * gap.shrink;
        effect.share_low = part * gap.shrink_low;
        effect.share_high = part * gap.shrink_high;
    }
    let taken: f64 = joint.effects.iter().map(|effect| effect.share).sum();
    joint.remaining_share = 1.0 - taken;
}

/// Data and robot file with what the samples show taken out.
pub(crate) struct Prepared {
    pub robot: Robot,
    /// Of each joint.
    pub counted: Vec<Vec<Found>>,
    /// What a reader of the report should know.
    pub findings: Vec<DataFinding>,
    mended: Option<Vec<Recording>>,
}

impl Prepared {
    /// Mended recordings, or the ones given where nothing had to be mended.
    pub fn tables<'a>(&'a self, given: &[&'a Recording]) -> Vec<&'a Recording> {
        match &self.mended {
            Some(mended) => mended.iter().collect(),
            None => given.to_vec(),
        }
    }
}

/// Looks at the samples of the joints that can be diagnosed.
pub(crate) fn prepared(
    robot: &Robot,
    tables: &[&Recording],
    looks_at: impl Fn(usize) -> bool + Sync,
) -> Prepared {
    let timing = Timing::of(robot, tables);
    let counted: Vec<Vec<Found>> = robot
        .joints
        .iter()
        .enumerate()
        .on_all_cores(|(index, joint)| {
            if looks_at(index) {
                samples::find(tables, joint, &timing)
            } else {
                Vec::new()
            }
        })
        .collect();
    Prepared {
        robot: Robot {
            control: timing.control.clone(),
            ..mend::robot(robot, &counted)
        },
        mended: mend::recordings(tables, robot, &counted, &timing),
        counted,
        findings: timing.findings,
    }
}

/// A report that says nothing of any joint yet.
pub(crate) fn blank_report(
    robot: &Robot,
    recordings: &[(String, Recording)],
) -> Result<Report, DiagnoseError> {
    let (_, first) = recordings.first().ok_or(DiagnoseError::Nothing)?;
    Ok(Report {
        schema: SCHEMA,
        robot: robot.name.clone(),
        recordings: recordings.iter().map(|(name, _)| name.clone()).collect(),
        samples: recordings.iter().map(|(_, table)| table.rows()).sum(),
        seconds: recordings.iter().map(|(_, table)| seconds(table)).sum(),
        sample_rate_hz: first.sample_rate_hz,
        twin: if control::is_known(robot) {
            TwinKind::ClosedLoop
        } else {
            TwinKind::FollowsMotion
        },
        compute_seconds: 0.0,
        shared_effects: Vec::new(),
        joints: Vec::new(),
        data: Vec::new(),
    })
}

fn seconds(recording: &Recording) -> f64 {
    let ends = recording.time_s.last().zip(recording.time_s.first());
    ends.map_or(0.0, |(last, first)| last - first)
}

/// Explains every joint, beside a cause that several share.
fn searched<'a>(
    robot: &Robot,
    twins: &'a [Option<JointTwin<'a>>],
    counted: &[Vec<Found>],
    repeated: &Repeated,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<(Vec<Searched<'a>>, Option<Shared>), FilterError> {
    let beginnings = twins
        .iter()
        .zip(counted)
        .zip(&robot.joints)
        .on_all_cores(|((twin, counted), joint)| {
            let Some(twin) = twin else {
                return Ok(None);
            };
            let mut search = Search::new(twin)?;
            search.repeats_nm = repeated.scatter_nm(&joint.name, &search)?;
            let beginning = Beginning::of(&search, &settled(counted, &search.scale))?;
            Ok(Some((search, beginning)))
        })
        .collect::<Result<Vec<_>, FilterError>>()?;
    let firsts: Vec<Option<Seen<'_, '_>>> = beginnings
        .iter()
        .map(|joint| joint.as_ref().map(|(search, begun)| (search, &begun.first)))
        .collect();
    let mut shared = shared::find(&firsts)?;
    let done = AtomicUsize::new(0);
    let tell = || {
        progress(Progress {
            done: done.fetch_add(1, Ordering::Relaxed) + 1,
            of: twins.len(),
        });
    };
    let mut explanations = explained(&beginnings, shared.as_ref(), &tell)?;
    let is_changed =
        |(begun, explanation): (&Option<(Search<'_>, Beginning)>, &Option<Explanation>)| {
            let pair = begun.as_ref().zip(explanation.as_ref());
            pair.is_some_and(|((_, begun), explanation)| {
                let first = explanation.rounds.first();
                first.is_some_and(|first| first.base.model != begun.first.base.model)
            })
        };
    if shared.is_none() && beginnings.iter().zip(&explanations).any(is_changed) {
        // what a joint has of its own may have hidden what it shares
        let firsts: Vec<Option<Seen<'_, '_>>> = beginnings
            .iter()
            .zip(&explanations)
            .map(|(joint, explanation)| {
                let (search, _) = joint.as_ref()?;
                Some((search, explanation.as_ref()?.rounds.first()?))
            })
            .collect();
        shared = shared::find(&firsts)?;
        if shared.is_some() {
            explanations = explained(&beginnings, shared.as_ref(), &|| ())?;
        }
    }
    let joints = beginnings
        .into_iter()
        .zip(explanations)
        .map(|(joint, explanation)| Some((joint?.0, explanation?)))
        .collect();
    Ok((joints, shared))
}

/// Explains every joint from its beginning on, beside what it shares.
fn explained(
    beginnings: &[Option<(Search<'_>, Beginning)>],
    shared: Option<&Shared>,
    tell: &(dyn Fn() + Sync),
) -> Result<Vec<Option<Explanation>>, FilterError> {
    beginnings
        .iter()
        .on_all_cores(|joint| {
            let explained = match (joint, shared) {
                (Some((search, begun)), Some(shared)) => {
                    Some(begun.beside(search, &shared.term)?.explain(search)?)
                }
                (Some((search, begun)), None) => Some(begun.explain(search)?),
                (None, _) => None,
            };
            tell();
            Ok(explained)
        })
        .collect()
}

/// What the samples settle already, for the twin.
pub fn settled(counted: &[Found], scale: &Scale) -> Vec<Term> {
    counted
        .iter()
        .filter_map(|found| {
            let (hypothesis, amplitude) = match found.effect {
                Effect::CurrentLoopLag { time_constant_s } => hypothesis::lag(time_constant_s),
                Effect::CommandDelay { delay_s } => hypothesis::delay(delay_s, scale),
                _ => return None,
            };
            Some(Term {
                hypothesis,
                amplitudes: vec![amplitude],
            })
        })
        .collect()
}

fn shared_effect(robot: &Robot, joints: &[Searched<'_>], shared: &Shared) -> SharedEffect {
    let own = shared
        .joints
        .first()
        .and_then(|index| joints[*index].as_ref());
    let parameters = own.map_or_else(BTreeMap::new, |(search, _)| {
        judge::term_parameters(search, &shared.term, &shared.covariance).0
    });
    SharedEffect {
        effect: NamedEffect {
            effect: shared.term.hypothesis.effect.to_owned(),
            probability: shared.probability,
            parameters,
            side: None,
            share: 0.0,
            share_low: 0.0,
            share_high: 0.0,
            shrink_alone: 0.0,
        },
        joints: names_of(robot, &shared.joints),
        joint_shares: BTreeMap::new(),
    }
}

fn names_of(robot: &Robot, joints: &[usize]) -> Vec<String> {
    let joints = joints.iter();
    joints
        .map(|index| robot.joints[*index].name.clone())
        .collect()
}

pub(crate) fn insufficient(joint: &str, why: String) -> JointReport {
    JointReport {
        joint: joint.to_owned(),
        verdict: Verdict::InsufficientData,
        reason: why,
        effects: Vec::new(),
        minor_effects: Vec::new(),
        candidates: vec![Candidate {
            effect: "unknown".to_owned(),
            probability: 1.0,
        }],
        confusable: Vec::new(),
        place: Where::default(),
        gap: Gap::default(),
        remaining: Remaining::Structured,
        remaining_share: 1.0,
        remaining_over: Vec::new(),
    }
}
