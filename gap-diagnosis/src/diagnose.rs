//! The whole diagnosis: check the data, explain every joint, look for shared causes, judge, report.

use std::collections::BTreeMap;
use std::time::Instant;

use joint_model::filter::FilterError;
use rayon::prelude::*;
use recording::Recording;
use robot::{Effect, Robot};

use crate::control;
use crate::data::Checked;
use crate::evidence::{Remains, beyond_twin};
use crate::explain::{Explanation, Step, explain};
use crate::hypothesis::{self, Scale, Stage};
use crate::judge;
use crate::known::Known;
use crate::mend;
use crate::observe::Channel;
use crate::place;
use crate::report::{
    Candidate, Confusable, Gap, JointReport, NamedEffect, Remaining, Report, SCHEMA, SharedEffect,
    TwinKind, Verdict, Where,
};
use crate::samples::{self, Found};
use crate::search::{Model, Search, Term};
use crate::shared::{self, Shared};
use crate::stretch::{StretchError, stretches};
use crate::twin::JointTwin;

/// Two explanations nearer than this cannot be told apart.
const DISTANCE_MIN: f64 = 9.0;
/// Pairs that are shown.
const PAIRS_MAX: usize = 5;
/// Nats by which an explanation must lead one that is near to it.
const LEAD_NATS: f64 = 3.0;
/// Probability of what was counted in the samples.
const COUNTED: f64 = 0.97;
/// Candidates less probable than this are not listed.
const LISTED_MIN: f64 = 1e-4;

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
}

/// A report with what its pictures need.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The report.
    pub report: Report,
    /// In the robot file's order, of joints that could be diagnosed.
    pub traces: Vec<JointTraces>,
}

type Searched<'a> = Option<(Search<'a>, Explanation)>;

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
    let first = tables.first().ok_or(DiagnoseError::Nothing)?;
    let checked = Checked::of(robot, &tables);
    let against: Vec<Option<String>> = robot
        .joints
        .iter()
        .map(|joint| checked.against(&joint.name))
        .collect();
    let mut report = Report {
        schema: SCHEMA,
        robot: robot.name.clone(),
        recordings: recordings.iter().map(|(name, _)| name.clone()).collect(),
        samples: tables.iter().map(|table| table.rows()).sum(),
        seconds: tables.iter().map(|table| seconds(table)).sum(),
        sample_rate_hz: first.sample_rate_hz,
        twin: if control::is_known(robot) {
            TwinKind::ClosedLoop
        } else {
            TwinKind::FollowsMotion
        },
        compute_seconds: 0.0,
        shared_effects: Vec::new(),
        joints: Vec::new(),
        data: checked.report(),
    };
    let mut traces = Vec::new();
    if against.iter().all(Option::is_some) {
        let blank = robot.joints.iter().zip(against);
        report.joints = blank
            .map(|(joint, why)| insufficient(&joint.name, why.unwrap_or_default()))
            .collect();
    } else {
        let counted: Vec<Vec<Found>> = robot
            .joints
            .iter()
            .enumerate()
            .map(|(index, joint)| match &against[index] {
                None => samples::find(&tables, joint, delay_cycles(robot)),
                Some(_) => Vec::new(),
            })
            .collect();
        let mended = mend::recordings(&tables, robot, &counted);
        let tables = match &mended {
            Some(mended) => mended.iter().collect(),
            None => tables,
        };
        let mended = mend::robot(robot, &counted);
        let robot = &mended;
        let stretches = stretches(&tables, robot)?;
        let twins = robot
            .joints
            .par_iter()
            .enumerate()
            .map(|(index, _)| {
                if against[index].is_some() {
                    return Ok(None);
                }
                JointTwin::new(robot, index, &stretches)
            })
            .collect::<Result<Vec<_>, FilterError>>()?;
        let (joints, shared) = searched(&twins, &counted, progress)?;
        for (index, joint) in joints.iter().enumerate() {
            let name = &robot.joints[index].name;
            let Some((search, explanation)) = joint else {
                let why = against[index].clone();
                let why = why.unwrap_or_else(|| "nothing tells the joint's torque".to_owned());
                report.joints.push(insufficient(name, why));
                continue;
            };
            let seen = shared
                .iter()
                .filter(|shared| shared.joints.contains(&index));
            let told = Told {
                name,
                search,
                explanation,
                counted: &counted[index],
                shared: seen.collect(),
                poverty: checked.poverty(name),
            };
            report.joints.push(told.report()?);
            traces.push(told.traces()?);
        }
        report.shared_effects = shared
            .iter()
            .map(|shared| shared_effect(robot, &joints, shared))
            .collect();
    }
    report.compute_seconds = begin.elapsed().as_secs_f64();
    Ok(Diagnosis { report, traces })
}

fn seconds(recording: &Recording) -> f64 {
    let ends = recording.time_s.last().zip(recording.time_s.first());
    ends.map_or(0.0, |(last, first)| last - first)
}

fn delay_cycles(robot: &Robot) -> usize {
    robot
        .control
        .as_ref()
        .map_or(1, |control| control.delay_cycles as usize)
}

/// Explains every joint; where several share a cause, explains them again beside it.
fn searched<'a>(
    twins: &'a [Option<JointTwin<'a>>],
    counted: &[Vec<Found>],
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<(Vec<Searched<'a>>, Vec<Shared>), FilterError> {
    let done = std::sync::atomic::AtomicUsize::new(0);
    let mut joints = twins
        .par_iter()
        .zip(counted)
        .map(|(twin, counted)| {
            let explained = match twin {
                Some(twin) => {
                    let search = Search::new(twin)?;
                    let explanation = explain(&search, &settled(counted, &search.scale))?;
                    Some((search, explanation))
                }
                None => None,
            };
            let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            progress(Progress {
                done,
                of: twins.len(),
            });
            Ok(explained)
        })
        .collect::<Result<Vec<_>, FilterError>>()?;
    let shared: Vec<Shared> = shared::find(&joints).into_iter().collect();
    for shared in &shared {
        joints = joints
            .into_par_iter()
            .zip(counted)
            .map(|(joint, counted)| match joint {
                Some((search, _)) => {
                    let mut terms = settled(counted, &search.scale);
                    terms.push(shared.term.clone());
                    let explanation = explain(&search, &terms)?;
                    Ok(Some((search, explanation)))
                }
                None => Ok(None),
            })
            .collect::<Result<Vec<_>, FilterError>>()?;
    }
    Ok((joints, shared))
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
    let names = shared
        .joints
        .iter()
        .map(|index| robot.joints[*index].name.clone())
        .collect();
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
            shrink_alone: 0.0,
        },
        joints: names,
    }
}

fn insufficient(joint: &str, why: String) -> JointReport {
    JointReport {
        joint: joint.to_owned(),
        verdict: Verdict::InsufficientData,
        reason: why,
        effects: Vec::new(),
        candidates: vec![Candidate {
            effect: "unknown".to_owned(),
            probability: 1.0,
        }],
        confusable: Vec::new(),
        place: Where::default(),
        gap: Gap::default(),
        remaining: Remaining::Structured,
    }
}

/// Everything known about one joint.
struct Told<'a> {
    name: &'a str,
    search: &'a Search<'a>,
    explanation: &'a Explanation,
    counted: &'a [Found],
    shared: Vec<&'a Shared>,
    poverty: Option<&'static str>,
}

impl Told<'_> {
    fn report(&self) -> Result<JointReport, FilterError> {
        let before_nm = self.search.residual_nm(&Model::default())?;
        let (after_nm, covariance) = self.search.held_out(&self.explanation.refined);
        let mut gap = judge::gap(self.search, &before_nm, &after_nm);
        let nominal = Model::default();
        gap.position_rms_rad =
            judge::position_rms_rad(self.search, &nominal, &self.explanation.refined.model);
        let effects = self.effects(&before_nm, &covariance);
        let candidates = self.candidates();
        let confusable = self.confusable();
        let verdict = self.verdict(&effects, &confusable);
        let has_gap = verdict != Verdict::NoGap;
        let remaining = match self.explanation.remains() {
            Remains::Nothing => Remaining::White,
            Remains::Something | Remains::Most => Remaining::Structured,
        };
        if !has_gap {
            (gap.shrink, gap.shrink_low, gap.shrink_high) = (0.0, 0.0, 0.0);
        }
        Ok(JointReport {
            joint: self.name.to_owned(),
            verdict,
            reason: self.reason(verdict, &effects, &gap),
            place: self.place(&before_nm, &candidates, &effects, has_gap),
            effects,
            candidates,
            confusable,
            gap,
            remaining,
        })
    }

    fn last(&self) -> &Step {
        self.explanation.last()
    }

    fn added(&self) -> impl Iterator<Item = &Step> {
        self.explanation
            .rounds
            .iter()
            .filter(|step| step.added.is_some())
    }

    fn effects(&self, before_nm: &[f64], covariance: &nalgebra::DMatrix<f64>) -> Vec<NamedEffect> {
        let refined = &self.explanation.refined;
        let settled = refined.model.terms.len() - self.added().count();
        let mut effects: Vec<NamedEffect> = self
            .added()
            .zip(settled..)
            .map(|(step, term)| {
                let name = refined.model.terms[term].hypothesis.effect;
                let (parameters, side) = judge::parameters(self.search, refined, covariance, term);
                NamedEffect {
                    effect: name.to_owned(),
                    probability: probability_of(step, name),
                    parameters,
                    side,
                    shrink_alone: judge::shrink_alone(self.search, refined, term, before_nm),
                }
            })
            .collect();
        merge_harmonics(&mut effects);
        effects.extend(self.counted.iter().map(counted_effect));
        effects.sort_by(|a, b| b.shrink_alone.total_cmp(&a.shrink_alone));
        effects
    }

    /// Probabilities of the steps that added something, or of the last one, with what was counted in the samples.
    fn candidates(&self) -> Vec<Candidate> {
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
            0.5
        };
        for step in &steps {
            let share = rest * (1.0 - unknown) / steps.len() as f64;
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
        all
    }

    /// What is too near to an effect that was added to be told from it.
    fn confusable(&self) -> Vec<Confusable> {
        let mut all: Vec<Confusable> = self
            .counted
            .iter()
            .filter_map(|found| match names(found) {
                [one, other] => Some(Confusable {
                    effects: [one, other].map(|name| (*name).to_owned()),
                    distance: 0.0,
                    reason: self.why([one, other]),
                }),
                _ => None,
            })
            .collect();
        for step in self.added() {
            let ranking = &step.round.ranking;
            let Some(&(own, own_nats)) =
                step.standings.effects.iter().find(|(index, _)| {
                    Some(ranking.scored[*index].hypothesis.effect) == step.added
                })
            else {
                continue;
            };
            for &(other, nats) in &step.standings.effects {
                if other == own || nats < own_nats - DISTANCE_MIN {
                    continue;
                }
                let distance = step
                    .round
                    .distance(&ranking.scored[own], &ranking.scored[other]);
                if distance < DISTANCE_MIN || nats > own_nats - LEAD_NATS {
                    let names = [own, other].map(|k| ranking.scored[k].hypothesis.effect);
                    all.push(Confusable {
                        effects: names.map(str::to_owned),
                        distance,
                        reason: self.why(names),
                    });
                }
            }
        }
        all.extend(self.imitated_by_known());
        all.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        all.truncate(PAIRS_MAX);
        all
    }

    /// Effects that known values could imitate if they were off by more than their tolerance.
    fn imitated_by_known(&self) -> Vec<Confusable> {
        let mut found = Vec::new();
        for step in self.added() {
            let ranking = &step.round.ranking;
            let own =
                step.standings.effects.iter().find(|(index, _)| {
                    Some(ranking.scored[*index].hypothesis.effect) == step.added
                });
            let Some((own, _)) = own else { continue };
            let (distance, known) = step
                .round
                .distance_from_known(&ranking.scored[*own], &self.search.twin.known);
            let Some(other) = known.and_then(Known::effect) else {
                continue;
            };
            if distance < DISTANCE_MIN {
                found.push(Confusable {
                    effects: [ranking.scored[*own].hypothesis.effect, other].map(str::to_owned),
                    distance,
                    reason: "known values off by more than their tolerance would look the same"
                        .to_owned(),
                });
            }
        }
        found
    }

    fn why(&self, pair: [&str; 2]) -> String {
        if let Some(poverty) = self.poverty {
            return poverty.to_owned();
        }
        let is = |a: &str, b: &str| pair == [a, b] || pair == [b, a];
        if is("command_delay", "sensor_delay") {
            "command and position show only the sum of both delays".to_owned()
        } else if is("torque_offset", "gravity_torque") || is("encoder_offset", "gravity_torque") {
            "the range of motion is too small for the torque to change with the angle".to_owned()
        } else if pair
            .iter()
            .all(|effect| Stage::of(effect) == Stage::Transmission)
        {
            "both oppose the motion in nearly the same way over the speeds and loads driven"
                .to_owned()
        } else {
            "their torques along this motion are nearly alike".to_owned()
        }
    }

    fn verdict(&self, effects: &[NamedEffect], confusable: &[Confusable]) -> Verdict {
        let remains = self.explanation.remains();
        if effects.is_empty() && self.shared.is_empty() {
            return match (remains, self.last().probabilities[0].effect) {
                (Remains::Nothing, "none") => Verdict::NoGap,
                (Remains::Nothing, _) => Verdict::Ambiguous,
                _ => Verdict::Unexplained,
            };
        }
        if remains != Remains::Nothing {
            Verdict::PartlyExplained
        } else if confusable.iter().any(|pair| pair.distance < DISTANCE_MIN)
            || effects.iter().any(|effect| effect.probability < 0.5)
        {
            Verdict::Ambiguous
        } else {
            Verdict::Explained
        }
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
        beyond_twin(&self.last().structure).map_or_else(
            || "of no shape".to_owned(),
            |(over, _)| format!("over {over}"),
        )
    }

    fn place(
        &self,
        before_nm: &[f64],
        candidates: &[Candidate],
        effects: &[NamedEffect],
        has_gap: bool,
    ) -> Where {
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
        let named = effects.first().map(|effect| Stage::of(&effect.effect));
        let likeliest = stages
            .iter()
            .max_by(|a, b| a.1.total_cmp(b.1))
            .map(|(stage, _)| *stage);
        Where {
            stage: named.or(likeliest).filter(|_| has_gap),
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

    fn traces(&self) -> Result<JointTraces, FilterError> {
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
        })
    }
}

/// A kinematic error has up to three harmonics: one effect, numbered parameters.
fn merge_harmonics(effects: &mut Vec<NamedEffect>) {
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

fn probability_of(step: &Step, effect: &str) -> f64 {
    step.probabilities
        .iter()
        .find(|p| p.effect == effect)
        .map_or(0.0, |p| p.probability)
}

/// What a finding may be called: command and position show only the sum of both delays.
fn names(found: &Found) -> &[&'static str] {
    match found.effect {
        Effect::CommandDelay { .. } => &["command_delay", "sensor_delay"],
        Effect::CurrentLoopLag { .. } => &["current_loop_lag"],
        Effect::DroppedCommands { .. } => &["dropped_commands"],
        Effect::DroppedSamples { .. } => &["dropped_samples"],
        Effect::VelocityFilterLag { .. } => &["velocity_filter_lag"],
        _ => &["encoder_quantisation"],
    }
}

fn counted_effect(found: &Found) -> NamedEffect {
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
        shrink_alone: 0.0,
    }
}
