//! What is to be told apart: the confusable pairs of a report, or the effects of a file.

use std::path::Path;

use gap_diagnosis::separate::Pair;
use gap_report::{JointReport, Report};
use robot::{Effect, Robot};

use crate::cli::GapSuggestArguments;
use crate::error::CliError;
use crate::gap::apply::{at_motor, read_report, to_effect};

/// Two effects at a joint, and how large either would be, where that is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    pub joint: usize,
    pub effects: [String; 2],
    sizes: [Option<Effect>; 2],
    /// `d²` of the report.
    pub distance_now: Option<f64>,
}

impl Question {
    /// Each effect whose size is known, against the other.
    pub fn pairs(&self) -> impl Iterator<Item = Pair> {
        [(0, 1), (1, 0)].into_iter().filter_map(|(this, other)| {
            Some(Pair {
                joint: self.joint,
                effect: self.sizes[this]?,
                other: self.effects[other].clone(),
            })
        })
    }
}

/// Of the report or of the file of effects, whichever was given.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if nothing is confused.
pub fn questions(
    arguments: &GapSuggestArguments,
    robot: &Robot,
) -> Result<Vec<Question>, CliError> {
    match (&arguments.report, &arguments.effects) {
        (Some(path), _) => of_report(&read_report(path)?, &path.display().to_string(), robot),
        (None, Some(path)) => of_file(path, robot),
        (None, None) => Err(CliError::Input(
            "neither --report nor --effects: nothing says what is to be told apart".to_owned(),
        )),
    }
}

/// Of a report's confusable pairs; `name` is what errors call it.
///
/// # Errors
/// [`CliError::Input`] if it does not fit the robot, [`CliError::Negative`] if nothing is confused.
pub fn of_report(report: &Report, name: &str, robot: &Robot) -> Result<Vec<Question>, CliError> {
    let refuse = |reason: String| CliError::Input(format!("{name}: {reason}"));
    let mut found = Vec::new();
    // names that could take the place of what would take a told one's place
    let mut of_no_size = None;
    for joint in &report.joints {
        let index = robot.joint_index(&joint.joint).ok_or_else(|| {
            let name = &joint.joint;
            refuse(format!(
                "joint `{name}` is not in the robot file; give the robot file that was diagnosed"
            ))
        })?;
        for pair in &joint.confusable {
            let sizes = [
                size(report, joint, &pair.effects[0]).map_err(refuse)?,
                size(report, joint, &pair.effects[1]).map_err(refuse)?,
            ];
            if sizes.iter().all(Option::is_none) {
                let [one, other] = &pair.effects;
                of_no_size.get_or_insert_with(|| {
                    format!(
                        "{}: says neither how large {one} nor how large {other} is; give both with --effects",
                        joint.joint
                    )
                });
                continue;
            }
            found.push(Question {
                joint: index,
                effects: pair.effects.clone(),
                sizes,
                distance_now: Some(pair.distance),
            });
        }
    }
    if let Some(reason) = of_no_size.filter(|_| found.is_empty()) {
        return Err(refuse(reason));
    }
    if found.is_empty() {
        return Err(CliError::Negative(format!(
            "{name}: no two effects are confused, so there is nothing to tell apart"
        )));
    }
    Ok(found)
}

/// An effect as the report has it at a joint.
fn size(report: &Report, joint: &JointReport, effect: &str) -> Result<Option<Effect>, String> {
    let own = joint.effects.iter().find(|named| named.effect == effect);
    let of_arm = || {
        let mut shared = report.shared_effects.iter().map(|shared| &shared.effect);
        shared.find(|named| named.effect == effect)
    };
    match own {
        Some(named) => at_motor(joint, named).map(Some),
        None => of_arm().map(to_effect).transpose(),
    }
}

/// Every two effects of a joint are a pair.
fn of_file(path: &Path, robot: &Robot) -> Result<Vec<Question>, CliError> {
    let effects = robot::load_injection(path, robot).map_err(CliError::input)?;
    let mut found = Vec::new();
    for (k, one) in effects.iter().enumerate() {
        for other in &effects[k + 1..] {
            let joint = match (one.joint, other.joint) {
                (Some(a), Some(b)) if a != b => continue,
                // an effect of the whole arm is asked about where the other is, else where it weighs most
                (a, b) => a.or(b).unwrap_or(0),
            };
            found.push(Question {
                joint,
                effects: [one, other].map(|effect| effect.effect.name().to_owned()),
                sizes: [Some(one.effect), Some(other.effect)],
                distance_now: None,
            });
        }
    }
    if found.is_empty() {
        return Err(CliError::Input(format!(
            "{}: holds no two effects of one joint; give the two that are to be told apart",
            path.display()
        )));
    }
    Ok(found)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use gap_report::{JointTorque, TorqueSource};
    use robot::{RobotFile, Source};
    use serde_json::json;

    use super::*;
    use crate::gap::apply::tests::{ROBOT, found, report};

    #[test]
    fn what_is_rehearsed_is_as_large_as_at_the_motor() {
        let file = RobotFile::parse(ROBOT, "bench.toml").unwrap();
        let robot = file.build(Source::File("bench.toml".into())).unwrap();
        let recorded = Effect::CoulombFriction { coulomb_nm: 0.5 };
        let mut report = report(json!([found(&recorded)]), json!([]));
        let joint = &mut report.joints[0];
        joint.torque = Some(JointTorque {
            source: TorqueSource::Drive,
            unit: 1.0,
            motor_per_recorded: 0.8,
        });
        let pair = json!({
            "effects": ["coulomb_friction", "torque_offset"], "distance": 1.0, "reason": ""
        });
        joint.confusable = vec![serde_json::from_value(pair).unwrap()];
        let questions = of_report(&report, "report", &robot).unwrap();
        let pairs: Vec<Pair> = questions[0].pairs().collect();
        assert_eq!(pairs.len(), 1);
        assert_eq!(pairs[0].effect, Effect::CoulombFriction { coulomb_nm: 0.4 });
    }
}
