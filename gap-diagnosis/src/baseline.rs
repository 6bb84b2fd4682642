//! What simpler methods say of the same twin and the same responses, to stand beside the diagnosis: the effect with the
//! largest marginal R², and plain BIC, which takes samples for independent.

use std::collections::BTreeMap;

use gap_report::{
    BeforeAfter, Candidate, Gap, JointReport, NamedEffect, Remaining, Report, Verdict, Where,
};
use joint_twin::JointTwin;
use joint_twin::TwinError;
use joint_twin::observe::Channel;
use joint_twin::on_all_cores::OnAllCores;
use joint_twin::stretch::stretches;
use nalgebra::{DMatrix, DVector};
use recording::Recording;
use recording_checks::mend;
use robot::Robot;

use crate::closed_loop::search::{Search, Term};
use crate::closed_loop::values;
use crate::closed_loop::{self, About};
use crate::diagnose::{DiagnoseError, blank_report, insufficient};
use crate::evidence::told::MATERIALITY;

/// A method that people use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Baseline {
    /// The effect whose response alone explains most of the residual.
    LargestR2,
    /// The effect with the smallest Bayesian information criterion, known values refitted, samples independent.
    Bic,
}

/// One choice and what it leaves.
struct Choice {
    effect: &'static str,
    term: Option<Term>,
    /// Ranks and weighs: the larger the better.
    score: f64,
}

/// Diagnoses by a baseline: names and values only.
///
/// # Errors
/// [`DiagnoseError`].
pub fn baseline(
    robot: &Robot,
    recordings: &[(String, Recording)],
    method: Baseline,
) -> Result<Report, DiagnoseError> {
    let tables: Vec<&Recording> = recordings.iter().map(|(_, recording)| recording).collect();
    let mut report = blank_report(robot, recordings)?;
    let robot = &mend::robot(robot, &[]);
    let stretches = stretches(&tables, robot)?;
    report.joints = (0..robot.joints.len())
        .on_all_cores(|index| {
            let name = &robot.joints[index].name;
            let Some(twin) = JointTwin::new(robot, index, &stretches)? else {
                let why = "nothing tells the joint's torque".to_owned();
                return Ok(insufficient(name, why));
            };
            let search = Search::new(&twin)?;
            let about = closed_loop::about_the_file(&search)?;
            Ok(told(name, &search, choices(&about, method)))
        })
        .collect::<Result<Vec<_>, TwinError>>()?;
    Ok(report)
}

fn choices(about: &About, method: Baseline) -> Vec<Choice> {
    let target = DVector::from_column_slice(&about.gap_nm);
    let beside: &[Vec<f64>] = match method {
        Baseline::LargestR2 => &[],
        Baseline::Bic => &about.known,
    };
    let rows = target.len() as f64;
    let (without, _) = least_squares(beside, &[], &target);
    let bic = |square: f64, values: usize| {
        -0.5 * (rows * (square / rows).max(1e-300).ln() + values as f64 * rows.ln())
    };
    let mut all: Vec<Choice> = about
        .responses
        .iter()
        .on_all_cores(|response| {
            let (hypothesis, own) = (&response.term.hypothesis, &response.columns);
            let (left, amplitudes) = least_squares(beside, own, &target);
            Choice {
                effect: hypothesis.name(),
                score: match method {
                    Baseline::LargestR2 => 1.0 - left / without.max(1e-300),
                    Baseline::Bic => bic(left, beside.len() + own.len() + hypothesis.shape.len()),
                },
                term: Some(Term {
                    hypothesis: hypothesis.clone(),
                    amplitudes,
                }),
            }
        })
        .collect();
    all.push(Choice {
        effect: "none",
        term: None,
        score: match method {
            Baseline::LargestR2 => MATERIALITY,
            Baseline::Bic => bic(without, beside.len()),
        },
    });
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut seen: Vec<&str> = Vec::new();
    all.retain(|choice| {
        let is_new = !seen.contains(&choice.effect);
        seen.push(choice.effect);
        is_new
    });
    all
}

/// Squares left, and the coefficients of the own columns.
fn least_squares(beside: &[Vec<f64>], own: &[Vec<f64>], target: &DVector<f64>) -> (f64, Vec<f64>) {
    let columns: Vec<&Vec<f64>> = beside.iter().chain(own).collect();
    if columns.is_empty() {
        return (target.norm_squared(), Vec::new());
    }
    let matrix = DMatrix::from_fn(target.len(), columns.len(), |row, k| columns[k][row]);
    let mut normal = matrix.tr_mul(&matrix);
    for k in 0..normal.nrows() {
        normal[(k, k)] += 1e-9 * normal[(k, k)] + 1e-12;
    }
    let Some(normal) = normal.cholesky() else {
        return (target.norm_squared(), vec![0.0; own.len()]);
    };
    let found = normal.solve(&matrix.tr_mul(target));
    let left = (target - &matrix * &found).norm_squared();
    (left, found.iter().skip(beside.len()).copied().collect())
}

fn told(name: &str, search: &Search<'_>, choices: Vec<Choice>) -> JointReport {
    let best = choices[0].score;
    let weight = |choice: &Choice| (choice.score - best).exp();
    let sum: f64 = choices.iter().map(weight).sum();
    let mut candidates: Vec<Candidate> = choices
        .iter()
        .map(|choice| Candidate {
            effect: choice.effect.to_owned(),
            probability: weight(choice) / sum,
        })
        .collect();
    candidates.push(Candidate {
        effect: "unknown".to_owned(),
        probability: 0.0,
    });
    let effects: Vec<NamedEffect> = choices[0]
        .term
        .iter()
        .map(|term| NamedEffect {
            effect: choices[0].effect.to_owned(),
            probability: candidates[0].probability,
            parameters: values::term_parameters(search, term, &DMatrix::zeros(0, 0)).0,
            ..NamedEffect::default()
        })
        .collect();
    let stage = choices[0].term.as_ref().map(|term| term.hypothesis.stage());
    let before_nm = values::mean_square(search, &search.measured_nm, Channel::Motor);
    JointReport {
        joint: name.to_owned(),
        verdict: if effects.is_empty() {
            Verdict::NoGap
        } else {
            Verdict::Explained
        },
        reason: "a baseline: names only".to_owned(),
        effects,
        candidates,
        confusable: Vec::new(),
        place: Where {
            stage,
            stages: stage
                .map(|stage| BTreeMap::from([(stage, 1.0)]))
                .unwrap_or_default(),
            ..Where::default()
        },
        gap: Gap {
            torque_rms_nm: BeforeAfter {
                before: before_nm.sqrt(),
                after: before_nm.sqrt(),
                noise_floor: search.twin_floor_nm(Channel::Motor),
                held_out: false,
            },
            ..Gap::default()
        },
        remaining: Remaining::Structured,
        minor_effects: Vec::new(),
        remaining_share: 1.0,
        remaining_over: Vec::new(),
        torque: None,
        plain_friction: None,
    }
}
