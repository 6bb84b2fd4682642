//! Gaps as they appear: samples in, alarms out, time an argument. The same in a running service and along a recording.
//!
//! Each joint learns from its first window what it is like ([`Baseline`]: known values refitted, what is already there named
//! and taken as given). Then every half second is simulated and its residual watched for growth ([`Detector`]). Only when that
//! fires, the samples since the gap appeared are diagnosed, first after 4 s ([`LOOKS_S`]) and again with more of them: if they
//! show nothing beyond noise and tolerance, or nothing that could not have been there before, it was none; that nothing explains
//! it is only said at the last look. Afterwards the joint learns anew, gap included.

mod baseline;
mod detector;

use gap_report::Candidate;
use joint_twin::on_all_cores::OnAllCores;
use joint_twin::stretch::StretchError;
use joint_twin::{END_S, START_S};
use recording::{JointCycle, Recording, Window};
use recording_checks::data::Checked;
use recording_checks::mend;
use robot::Robot;
use serde::Serialize;

use crate::diagnose::DiagnoseError;
pub use baseline::Baseline;
pub use detector::Detector;

/// Every so often the residual is looked at.
const HOP_S: f64 = 0.5;
/// After so long a gap is diagnosed, and again.
pub const LOOKS_S: [f64; 3] = [4.0, 8.0, 16.0];
/// How probable it must be that there is a gap.
const SURE: f64 = 0.99;
/// Candidates that are told.
const TOLD: usize = 5;

/// How it watches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Length of what a joint learns from.
    pub window_s: f64,
    /// Mean time between two diagnoses for nothing, of each joint.
    pub between_false_s: f64,
}

/// What is told, with times since the recording began.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// A joint has learnt what it is like.
    Watching {
        /// Its name.
        joint: String,
        /// When.
        at_s: f64,
        /// Effects that were already there.
        already: Vec<String>,
    },
    /// A joint cannot be watched for now.
    Blind {
        /// Its name.
        joint: String,
        /// When.
        at_s: f64,
        /// Why, and what to change.
        reason: String,
    },
    /// A gap appeared.
    Gap(Alarm),
    /// The residual had grown, and known values within their tolerance explain it, or what would explain it as well before.
    Dismissed {
        /// Name of the joint.
        joint: String,
        /// When.
        at_s: f64,
        /// When it seemed to appear.
        appeared_s: f64,
    },
}

/// A gap that appeared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alarm {
    /// Name of the joint.
    pub joint: String,
    /// When the residual began to grow.
    pub appeared_s: f64,
    /// When that was noticed.
    pub noticed_s: f64,
    /// Time of the newest sample that was diagnosed.
    pub at_s: f64,
    /// The most probable first.
    pub candidates: Vec<Candidate>,
    /// Whether an earlier alarm of the same gap is corrected.
    pub again: bool,
}

/// Watches a robot.
#[derive(Clone, Debug)]
pub struct Watch {
    robot: Robot,
    settings: Settings,
    window: Window,
    joints: Vec<Joint>,
    next_hop_s: Option<f64>,
}

impl Watch {
    /// A robot whose samples come at this rate.
    pub fn new(robot: Robot, sample_rate_hz: f64, settings: Settings) -> Self {
        let robot = mend::robot(&robot, &[]);
        let names: Vec<String> = robot
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .collect();
        let joints = names.iter().enumerate();
        Self {
            joints: joints
                .map(|(index, name)| Joint {
                    index,
                    name: name.clone(),
                    stage: Stage::Learning {
                        since_s: f64::NEG_INFINITY,
                        reason: None,
                    },
                })
                .collect(),
            window: Window::new(names, sample_rate_hz),
            robot,
            settings,
            next_hop_s: None,
        }
    }

    /// Takes a row of a loop that is running, and says what it found out.
    ///
    /// # Errors
    /// [`DiagnoseError`] if rate or controller do not fit the simulation.
    pub fn push(&mut self, time_s: f64, row: &[JointCycle]) -> Result<Vec<Event>, DiagnoseError> {
        if !self.window.push(time_s, row) {
            return Ok(Vec::new());
        }
        let hop_s = *self.next_hop_s.get_or_insert(time_s + HOP_S);
        if time_s < hop_s {
            return Ok(Vec::new());
        }
        self.next_hop_s = Some(time_s + HOP_S);
        let seen = Seen {
            robot: &self.robot,
            settings: &self.settings,
            window: &self.window,
            now_s: time_s,
        };
        let events: Vec<Vec<Event>> = self
            .joints
            .iter_mut()
            .on_all_cores(|joint| joint.step(&seen))
            .collect::<Result<_, _>>()?;
        let longest_s = self.settings.window_s.max(LOOKS_S[LOOKS_S.len() - 1]);
        self.window
            .forget_before(time_s - longest_s - 4.0 * HOP_S - START_S - END_S);
        Ok(events.into_iter().flatten().collect())
    }
}

/// What there is to look at.
struct Seen<'a> {
    robot: &'a Robot,
    settings: &'a Settings,
    window: &'a Window,
    now_s: f64,
}

#[derive(Clone, Debug)]
struct Joint {
    index: usize,
    name: String,
    stage: Stage,
}

#[derive(Clone, Debug)]
enum Stage {
    Learning {
        /// Samples from then on count.
        since_s: f64,
        /// Why it could not, as it was told.
        reason: Option<String>,
    },
    Watching(Box<Watching>),
    Suspecting(Box<Suspecting>),
}

#[derive(Clone, Debug)]
struct Watching {
    baseline: Baseline,
    /// Before any hop.
    calm: Detector,
    detector: Detector,
    /// Whitened residuals since the sum left zero, and a hop before.
    rows: Vec<[f64; 2]>,
}

#[derive(Clone, Debug)]
struct Suspecting {
    baseline: Baseline,
    calm: Detector,
    appeared_s: f64,
    noticed_s: f64,
    /// Of [`LOOKS_S`].
    look: usize,
    /// What was told.
    told: Option<String>,
}

impl Joint {
    fn step(&mut self, seen: &Seen<'_>) -> Result<Vec<Event>, DiagnoseError> {
        let (event, next) = match &mut self.stage {
            Stage::Learning { since_s, reason } => {
                learn(self.index, &self.name, *since_s, reason, seen)?
            }
            Stage::Watching(watching) => (None, watching.step(seen)?),
            Stage::Suspecting(suspecting) => suspecting.step(&self.name, seen)?,
        };
        if let Some(next) = next {
            self.stage = next;
        }
        Ok(event.into_iter().collect())
    }
}

type Step = (Option<Event>, Option<Stage>);

fn learn(
    joint: usize,
    name: &str,
    since_s: f64,
    told: &mut Option<String>,
    seen: &Seen<'_>,
) -> Result<Step, DiagnoseError> {
    let [oldest_s, now_s] = seen.window.span_s().unwrap_or([seen.now_s; 2]);
    let from_s = since_s.max(oldest_s).max(now_s - seen.settings.window_s);
    // a hop may end a sample early
    if now_s - from_s < seen.settings.window_s - 0.5 * HOP_S {
        return Ok((None, None));
    }
    let table = seen.window.table(from_s, now_s);
    let blind = |reason: String, told: &mut Option<String>| {
        // tried again when half of the window is new
        let again = Stage::Learning {
            since_s: from_s + 0.5 * seen.settings.window_s,
            reason: Some(reason.clone()),
        };
        // said once, whatever number is in it the next time
        let event = told.is_none().then(|| Event::Blind {
            joint: name.to_owned(),
            at_s: now_s,
            reason,
        });
        Ok((event, Some(again)))
    };
    if let Some(reason) = Checked::of(seen.robot, &[&table]).against(name) {
        return blind(reason, told);
    }
    let learnt = match Baseline::learn(seen.robot, joint, &table) {
        Err(DiagnoseError::Stretch(short @ StretchError::Short { .. })) => {
            return blind(short.to_string(), told);
        }
        other => other?,
    };
    let Some(baseline) = learnt else {
        return blind("nothing tells the joint's torque".to_owned(), told);
    };
    let mut quiet = Vec::new();
    let mut end_s = from_s + START_S + HOP_S + END_S;
    while end_s <= now_s {
        quiet.extend(hop(&baseline, seen.window, end_s)?.and_then(|rows| mean_square(&rows)));
        end_s += HOP_S;
    }
    let hops_between = seen.settings.between_false_s / HOP_S;
    let Some(detector) = Detector::new(&quiet, hops_between) else {
        return blind("too few samples without a hole".to_owned(), told);
    };
    let event = Event::Watching {
        joint: name.to_owned(),
        at_s: now_s,
        already: baseline
            .effects
            .iter()
            .map(|effect| effect.name().to_owned())
            .collect(),
    };
    let watching = Watching {
        baseline,
        calm: detector.clone(),
        detector,
        rows: Vec::new(),
    };
    Ok((Some(event), Some(Stage::Watching(Box::new(watching)))))
}

/// Whitened residuals of the hop that ends with this time; none where samples are missing.
fn hop(
    baseline: &Baseline,
    window: &Window,
    end_s: f64,
) -> Result<Option<Vec<[f64; 2]>>, DiagnoseError> {
    let table: Recording = window.table(end_s - HOP_S - START_S - END_S, end_s);
    match baseline.residual(&table) {
        Ok(rows) => Ok(Some(rows)),
        Err(DiagnoseError::Stretch(StretchError::Short { .. })) => Ok(None),
        Err(other) => Err(other),
    }
}

fn mean_square(rows: &[[f64; 2]]) -> Option<f64> {
    let count = rows.len() as f64;
    (!rows.is_empty()).then(|| rows.iter().map(|[_, w]| w * w).sum::<f64>() / count)
}

impl Watching {
    fn step(&mut self, seen: &Seen<'_>) -> Result<Option<Stage>, DiagnoseError> {
        let Some(rows) = hop(&self.baseline, seen.window, seen.now_s)? else {
            return Ok(None);
        };
        let Some(square) = mean_square(&rows) else {
            return Ok(None);
        };
        if self.detector.is_calm() {
            self.rows.clear();
        }
        self.rows.extend(rows);
        if !self.detector.add(square) {
            return Ok(None);
        }
        let suspecting = Suspecting {
            baseline: self.baseline.clone(),
            calm: self.calm.clone(),
            appeared_s: began_s(&mut self.rows).unwrap_or(seen.now_s),
            noticed_s: seen.now_s,
            look: 0,
            told: None,
        };
        Ok(Some(Stage::Suspecting(Box::new(suspecting))))
    }
}

/// When residuals of unit variance began to be larger: the likeliest instant of one change of variance.
fn began_s(rows: &mut [[f64; 2]]) -> Option<f64> {
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let squares: Vec<f64> = rows.iter().map(|[_, w]| w * w).collect();
    let total: f64 = squares.iter().sum();
    let count = squares.len() as f64;
    let mut before = 0.0;
    let mut best: Option<(f64, f64)> = None;
    for (k, square) in squares.iter().enumerate() {
        let after_count = count - k as f64;
        let after = ((total - before) / after_count).max(1e-9);
        let before_mean = ((before + 1.0) / (k as f64 + 1.0)).max(1e-9);
        let likelihood = -0.5 * (k as f64 * before_mean.ln() + after_count * after.ln());
        if best.is_none_or(|(most, _)| likelihood > most) {
            best = Some((likelihood, rows[k][0]));
        }
        before += square;
    }
    best.map(|(_, time_s)| time_s)
}

impl Suspecting {
    fn step(&mut self, name: &str, seen: &Seen<'_>) -> Result<Step, DiagnoseError> {
        if seen.now_s - self.appeared_s < LOOKS_S[self.look] {
            return Ok((None, None));
        }
        self.look += 1;
        let is_last = self.look == LOOKS_S.len();
        // rows count from half a second later on: the step itself would look like a drift
        let since = seen.window.table(self.appeared_s, seen.now_s);
        let candidates = match self.baseline.look(&since) {
            Err(DiagnoseError::Stretch(StretchError::Short { .. })) => Vec::new(),
            other => other?,
        };
        let none = none(&candidates);
        let best = candidates.iter().find(|c| c.effect != "none");
        // a push or a stall has no name either, but it passes
        let may_pass = best.is_some_and(|best| best.effect == "unknown") && !is_last;
        let sure = (none < 1.0 - SURE && !may_pass) || (is_last && none < 0.5);
        let is_new = best.is_some_and(|best| self.told.as_deref() != Some(best.effect.as_str()));
        let tell = sure && is_new && (self.told.is_some() || self.has_changed(seen, &since)?);
        let event = if tell {
            let again = self.told.is_some();
            self.told = best.map(|best| best.effect.clone());
            Some(Event::Gap(Alarm {
                joint: name.to_owned(),
                appeared_s: self.appeared_s,
                noticed_s: self.noticed_s,
                at_s: seen.now_s,
                candidates: candidates.into_iter().take(TOLD).collect(),
                again,
            }))
        } else if is_last && self.told.is_none() {
            Some(Event::Dismissed {
                joint: name.to_owned(),
                at_s: seen.now_s,
                appeared_s: self.appeared_s,
            })
        } else {
            None
        };
        let next = is_last.then_some(Stage::Learning {
            since_s: self.appeared_s,
            reason: None,
        });
        Ok((event, next))
    }

    /// Whether what the joint is like now cannot be what it was like before: that it was learnt from too little, or shows now
    /// what it had no occasion to show, is no change. What cannot be simulated as unchanged has changed.
    fn has_changed(&self, seen: &Seen<'_>, since: &Recording) -> Result<bool, DiagnoseError> {
        let mut rows = self.baseline.unchanged(seen.robot, since)?;
        rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut detector = self.calm.clone();
        let hops = rows.chunk_by(|a, b| (a[0] / HOP_S).floor() == (b[0] / HOP_S).floor());
        let mut squares = hops.filter_map(mean_square);
        let has_grown = squares.any(|square| !square.is_finite() || detector.add(square));
        Ok(rows.is_empty() || has_grown)
    }
}

/// Probability that there is no gap: where nothing could be looked at there is none.
fn none(candidates: &[Candidate]) -> f64 {
    if candidates.is_empty() {
        return 1.0;
    }
    let found = candidates.iter().find(|c| c.effect == "none");
    found.map_or(0.0, |c| c.probability)
}
