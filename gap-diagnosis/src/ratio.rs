//! A wrong gear ratio where neither a second encoder nor a reference tells how far the motor turns per joint turn: it looks like a
//! payload with friction of its own. One number that leaves as little as several effects do is the simpler cause.

use joint_model::filter::FilterError;
use recording::{Finding, FindingKind, Recording, Severity, Signal};
use robot::Robot;

use crate::beside::Searched;
use crate::diagnose::{DiagnoseError, settled};
use crate::evidence::Remains;
use crate::explain::{
    Explanation, FURTHER_MOST_NATS, FURTHER_NATS, FURTHER_PART, WELL_EXPLAINED, explain, names,
    roughly_fitted,
};
use crate::found::Found;
use crate::on_all_cores::OnAllCores;
use crate::rigid::{Moving, thinned};
use crate::search::{Model, Search};
use crate::step::is_beyond;
use crate::stretch::{measured, rigid_stretches, stretches};
use crate::twin::JointTwin;

/// Ratios over the file's that are looked at by the rigid bodies: as far, either way, and so far apart.
const FARTHEST: f64 = 4.0;
const APART: f64 = 1.04;
/// The same about the best of them.
const NEAR_APART: f64 = 1.005;
/// Apart so far, ratios are fitted by simulation, at most so many downhill from the best of the rigid bodies.
const FITTED_APART: f64 = 1.01;
const FITTED_MOST: usize = 6;
/// Nats that a wrong ratio must be worth, and each effect instead of it: one effect is likelier than a wrong ratio, two are not.
const RATIO_NATS: f64 = 3.0 * FURTHER_NATS;
const EFFECT_NATS: f64 = 2.0 * FURTHER_NATS;
/// Nearer to the file's ratio than this part, another one is within what effects and tolerances do.
const SAME: f64 = 0.03;

/// What a joint comes to with another ratio.
struct Other {
    gear_ratio: f64,
    /// Whitened squares and strain.
    left: f64,
    /// Whether that is noise and the twin's own errors.
    is_all: bool,
    names: Vec<&'static str>,
}

/// What speaks against the file's gear ratio, of joints with a gap that only their motors' encoders show.
pub(crate) fn doubted(
    robot: &Robot,
    tables: &[&Recording],
    counted: &[Vec<Found>],
    joints: &[Searched<'_>],
) -> Result<Vec<Finding>, DiagnoseError> {
    let mut findings = Vec::new();
    for (joint, told) in joints.iter().enumerate() {
        let Some((search, explanation)) = told else {
            continue;
        };
        if !explanation.is_told() || !is_alone(robot, tables, joint) {
            continue;
        }
        let Some(robot_with) = best(robot, tables, joint, &counted[joint])? else {
            continue;
        };
        if let Some(other) = explained(&robot_with, tables, joint, &counted[joint])? {
            // rows may have been weighed anew to explain it
            let refined = &explanation.refined;
            let search = Search::new(search.twin)?;
            let left = search.left(&refined.model, &refined.residual_nm).total();
            findings.extend(finding(robot, joint, &other, left, explanation));
        }
    }
    Ok(findings)
}

/// Whether nothing but the motor's encoder tells where a joint is.
fn is_alone(robot: &Robot, tables: &[&Recording], joint: usize) -> bool {
    let name = &robot.joints[joint].name;
    let has = |table: &Recording, signal| {
        table
            .joint(name)
            .is_ok_and(|columns| measured(columns, signal).is_some())
    };
    tables.iter().all(|table| {
        has(table, Signal::MotorPositionRad)
            && !has(table, Signal::LinkPositionRad)
            && !has(table, Signal::ReferencePositionRad)
    })
}

/// The robot with the ratio that explains a joint best without effects; none where that is the file's.
fn best(
    robot: &Robot,
    tables: &[&Recording],
    joint: usize,
    counted: &[Found],
) -> Result<Option<Robot>, DiagnoseError> {
    let Some(mut factor) = by_rigid_bodies(robot, tables, joint) else {
        return Ok(None);
    };
    if factor.ln().abs() < SAME {
        return Ok(None);
    }
    let left = |factor: f64| -> Result<f64, DiagnoseError> {
        let without = |search: &Search<'_>| {
            let start = Model::of_settled(search, &settled(counted, &search.scale));
            let fitted = roughly_fitted(search, &start)?;
            Ok(search.left(&fitted.model, &fitted.residual_nm).total())
        };
        let left = searched(&with(robot, joint, factor), tables, joint, without)?;
        Ok(left.unwrap_or(f64::INFINITY))
    };
    let lefts = [1.0 / FITTED_APART, 1.0, FITTED_APART]
        .into_iter()
        .on_all_cores(|step| left(factor * step))
        .collect::<Result<Vec<_>, DiagnoseError>>()?;
    let step = if lefts[0] < lefts[2] {
        1.0 / FITTED_APART
    } else {
        FITTED_APART
    };
    let (mut least, mut next) = (lefts[1], lefts[0].min(lefts[2]));
    let mut moved = 0;
    while next < least && moved < FITTED_MOST {
        factor *= step;
        least = next;
        next = left(factor * step)?;
        moved += 1;
    }
    Ok((factor.ln().abs() > SAME).then(|| with(robot, joint, factor)))
}

/// What another ratio's own explanation comes to.
fn explained(
    robot: &Robot,
    tables: &[&Recording],
    joint: usize,
    counted: &[Found],
) -> Result<Option<Other>, DiagnoseError> {
    searched(robot, tables, joint, |search| {
        let explanation = explain(search, &settled(counted, &search.scale))?;
        let refined = &explanation.refined;
        Ok(Other {
            gear_ratio: robot.joints[joint].gear_ratio,
            left: search.left(&refined.model, &refined.residual_nm).total(),
            is_all: explanation.remains() == Remains::Nothing
                && !is_beyond(search, &refined.residual_nm, WELL_EXPLAINED),
            names: names(&refined.model),
        })
    })
}

/// Something of a joint's recordings beside its twin; none where nothing tells its torque.
fn searched<T>(
    robot: &Robot,
    tables: &[&Recording],
    joint: usize,
    something: impl FnOnce(&Search<'_>) -> Result<T, FilterError>,
) -> Result<Option<T>, DiagnoseError> {
    let stretches = stretches(tables, robot)?;
    let twin = JointTwin::new(robot, joint, &stretches)?;
    let search = twin.as_ref().map(Search::new).transpose()?;
    Ok(search.as_ref().map(something).transpose()?)
}

/// Over the file's, the ratio with which the rigid bodies leave least of the torque beyond friction.
fn by_rigid_bodies(robot: &Robot, tables: &[&Recording], joint: usize) -> Option<f64> {
    let thinned: Vec<Recording> = tables.iter().map(|table| thinned(table)).collect();
    let thinned: Vec<&Recording> = thinned.iter().collect();
    let left = |factor: f64| {
        let robot = with(robot, joint, factor);
        let stretches = rigid_stretches(&thinned, &robot).ok()?;
        Some((factor, Moving::of(&robot, joint, joint, &stretches)?.left()))
    };
    let least = |about: f64, apart: f64, farthest: f64| {
        let steps = (farthest.ln() / apart.ln()) as i32;
        let all: Vec<(f64, f64)> = (-steps..=steps)
            .on_all_cores(|step| left(about * apart.powi(step)))
            .flatten()
            .collect();
        let best = all.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
        best.map(|(factor, _)| factor)
    };
    let about = least(1.0, APART, FARTHEST)?;
    least(about, NEAR_APART, APART)
}

fn with(robot: &Robot, joint: usize, factor: f64) -> Robot {
    let mut with = robot.clone();
    with.joints[joint].gear_ratio *= factor;
    with
}

/// What is told of another ratio: an error where it is the simpler cause of what was told effects or nothing, a warning where it is as
/// good a one or makes the same effects fit better.
fn finding(
    robot: &Robot,
    joint: usize,
    other: &Other,
    left_by_effects: f64,
    explanation: &Explanation,
) -> Option<Finding> {
    let more_nats = 0.5 * (other.left - left_by_effects);
    let names = names(&explanation.refined.model);
    let fewer = names.len() as f64 - other.names.len() as f64;
    // no law is exact: several effects follow a large gap more closely than one number, whatever its cause
    let inexact_nats = if fewer > 1.0 {
        (FURTHER_PART * explanation.named_gain()).min(FURTHER_MOST_NATS)
    } else {
        0.0
    };
    let is_better = more_nats < EFFECT_NATS * fewer - RATIO_NATS + inexact_nats;
    let is_as_good = more_nats < FURTHER_NATS && fewer > 0.0;
    let severity = match (is_better, is_as_good) {
        // where nothing is told another ratio must tell all
        _ if names.is_empty() && !other.is_all => return None,
        (true, _) if fewer > 0.0 || names.is_empty() => Severity::Error,
        (true, _) | (_, true) => Severity::Warning,
        (false, false) => return None,
    };
    let of = &robot.joints[joint];
    let list = |names: &[&str], none: &str| match names {
        [] => none.to_owned(),
        _ => names.join(", "),
    };
    let with = list(&other.names, "no effect");
    let without = list(&names, "something on no list");
    Some(Finding {
        severity,
        kind: FindingKind::WrongGearRatio,
        joint: Some(of.name.clone()),
        signal: Some(Signal::MotorPositionRad),
        what: format!(
            "the motor seems to turn {:.4} times per joint turn, the gear_ratio told is {:.4}: with that it takes {with} to explain \
             the joint, as told {without}",
            other.gear_ratio, of.gear_ratio
        ),
        value: Some(other.gear_ratio),
        remedy: "correct gear_ratio in the robot file, or record a reference or a second encoder that confirm it".to_owned(),
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use crate::diagnose::diagnose;
    use crate::made_up::{MadeUp, robot};
    use crate::report::Verdict;

    #[test]
    fn a_wrong_ratio_is_told_and_a_payload_is_none() {
        for (factor, payload_kg) in [(1.25, 0.0), (1.0, 0.6)] {
            let recorded = MadeUp {
                payload_kg,
                ..MadeUp::KNOWN
            };
            let mut robot = robot();
            let right = robot.joints[0].gear_ratio;
            robot.joints[0].gear_ratio *= factor;
            let recordings = [("made up".to_owned(), recorded.recorded())];
            let report = diagnose(&robot, &recordings, &|_| ()).unwrap().report;
            let joint = &report.joints[0];
            let told = report.data.iter();
            let told = told.filter(|finding| finding.what.contains("per joint turn"));
            if payload_kg > 0.0 {
                assert_eq!(joint.effects[0].effect, "payload");
                assert_eq!(told.count(), 0);
                continue;
            }
            assert_eq!(joint.verdict, Verdict::InsufficientData, "{factor}");
            let rest = joint.reason.strip_prefix("the motor seems to turn ");
            let found: f64 = rest.unwrap().split(' ').next().unwrap().parse().unwrap();
            assert!((found / right - 1.0).abs() < 0.03, "{}", joint.reason);
        }
    }
}
