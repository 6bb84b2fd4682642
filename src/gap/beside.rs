//! The user's own simulator beside the robot: both were diagnosed against the same file, and what they differ in is told.

use std::fmt::Write;

use gap_report::{JointReport, NamedEffect, Report};
use report::{Cell, Column, Section, Table};
use serde::Serialize;

use super::page::words::{percent, with_value};

/// Two-sided 95 % of the normal distribution.
const Z95: f64 = 1.96;

/// What of the robot the simulator has. Shares are of the gap between robot and robot file.
#[derive(Debug, PartialEq, Serialize)]
pub struct Beside {
    /// Recordings of the simulator.
    recordings: Vec<String>,
    /// Of the whole arm.
    shared_effects: Parts,
    joints: Vec<JointBeside>,
}

/// One joint.
#[derive(Debug, PartialEq, Serialize)]
struct JointBeside {
    joint: String,
    #[serde(flatten)]
    parts: Parts,
}

/// Who has which effect.
#[derive(Debug, Default, PartialEq, Serialize)]
struct Parts {
    /// The robot has it and the simulator has not.
    only_robot: Vec<NamedEffect>,
    both: Vec<Both>,
    /// The simulator has it and the robot has not.
    only_simulator: Vec<NamedEffect>,
}

/// An effect that was found in both.
#[derive(Debug, PartialEq, Serialize)]
struct Both {
    robot: NamedEffect,
    simulator: NamedEffect,
    /// Whether every parameter is the same within the standard errors of both.
    is_same: bool,
    /// What the simulator lacks of it, of an effect with one parameter that is not the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    missing: Option<Missing>,
}

/// The difference of an effect's only parameter, and the share of the gap that it is.
#[derive(Debug, PartialEq, Serialize)]
struct Missing {
    parameter: String,
    value: f64,
    std: f64,
    share: f64,
    share_low: f64,
    share_high: f64,
}

/// Both reports beside each other.
pub fn beside(robot: &Report, simulator: &Report) -> Beside {
    let of_joint = |joint: &JointReport| {
        let same = |other: &&JointReport| other.joint == joint.joint;
        let other = simulator.joints.iter().find(same);
        let theirs = |named: fn(&JointReport) -> Vec<&NamedEffect>| other.map_or(Vec::new(), named);
        JointBeside {
            joint: joint.joint.clone(),
            parts: parts([&all(joint), &large(joint)], [&theirs(all), &theirs(large)]),
        }
    };
    let [ours, theirs] = [robot, simulator].map(|report| {
        let effects = report.shared_effects.iter();
        effects.map(|shared| &shared.effect).collect::<Vec<_>>()
    });
    Beside {
        recordings: simulator.recordings.clone(),
        shared_effects: parts([&ours, &ours], [&theirs, &theirs]),
        joints: robot.joints.iter().map(of_joint).collect(),
    }
}

fn all(joint: &JointReport) -> Vec<&NamedEffect> {
    joint.named().collect()
}

fn large(joint: &JointReport) -> Vec<&NamedEffect> {
    joint.effects.iter().collect()
}

/// Each side's effects, all of them and those that are not minor: what one has that matters is looked for among all of the other.
fn parts(robot: [&[&NamedEffect]; 2], simulator: [&[&NamedEffect]; 2]) -> Parts {
    let mut parts = Parts::default();
    for ours in robot[1] {
        match same_name(simulator[0], ours) {
            None => parts.only_robot.push((*ours).clone()),
            Some(theirs) => parts.both.push(both(ours, theirs)),
        }
    }
    for theirs in simulator[1] {
        match same_name(robot[0], theirs) {
            None => parts.only_simulator.push((*theirs).clone()),
            Some(ours) if same_name(robot[1], ours).is_none() => {
                parts.both.push(both(ours, theirs));
            }
            Some(_) => {}
        }
    }
    parts
}

fn same_name<'a>(among: &[&'a NamedEffect], found: &NamedEffect) -> Option<&'a NamedEffect> {
    let same = |other: &&&NamedEffect| other.effect == found.effect && other.side == found.side;
    among.iter().find(same).copied()
}

fn both(robot: &NamedEffect, simulator: &NamedEffect) -> Both {
    let differences: Vec<(&String, f64, f64)> = robot
        .parameters
        .iter()
        .map(|(name, ours)| {
            let theirs = simulator.parameters.get(name);
            let (value, std) = theirs.map_or((0.0, 0.0), |theirs| (theirs.value, theirs.std));
            (name, ours.value - value, ours.std.hypot(std))
        })
        .collect();
    let is_same = differences
        .iter()
        .all(|(_, difference, std)| difference.abs() <= Z95 * std);
    let missing = match differences.as_slice() {
        [(name, difference, std)] if !is_same => {
            // of a torque in proportion to the parameter the energy goes with its square
            let whole = robot.parameters[*name].value - nothing(&robot.effect);
            let part = (difference / whole).powi(2);
            Some(Missing {
                parameter: (*name).clone(),
                value: *difference,
                std: *std,
                share: part * robot.share,
                share_low: part * robot.share_low,
                share_high: part * robot.share_high,
            })
        }
        _ => None,
    };
    Both {
        robot: robot.clone(),
        simulator: simulator.clone(),
        is_same,
        missing: missing.filter(|missing| missing.share.is_finite()),
    }
}

/// The parameter of an effect that is not there: a gain is then 1.
fn nothing(effect: &str) -> f64 {
    if effect == "torque_constant_error" {
        1.0
    } else {
        0.0
    }
}

impl Beside {
    fn parts(&self) -> impl Iterator<Item = (&str, &Parts)> {
        let joints = self.joints.iter();
        let joints = joints.map(|joint| (joint.joint.as_str(), &joint.parts));
        std::iter::once(("arm", &self.shared_effects)).chain(joints)
    }

    /// In lines, for the terminal.
    pub fn lines(&self) -> String {
        let mut text = String::new();
        for (on, parts) in self.parts() {
            for line in parts.rows() {
                let _ = writeln!(text, "{on}: {}: {}{}", line.who, line.what, line.share());
            }
        }
        if text.is_empty() {
            text += "robot and simulator: nothing is named in either\n";
        }
        text
    }

    /// For the page.
    pub fn section(&self) -> Section {
        let mut table = Table::new(
            format!(
                "Robot and simulator, shares of the gap between robot and robot file; the simulator is {}",
                self.recordings.join(", ")
            ),
            [
                Column::text("joint"),
                Column::text("who"),
                Column::text("effect"),
                Column::number("share, %"),
                Column::text("95 %"),
            ],
        );
        for (on, parts) in self.parts() {
            for line in parts.rows() {
                let [share, interval] =
                    line.share.map_or([String::new(), String::new()], |share| {
                        [
                            percent(share[0]),
                            format!("{} to {}", percent(share[1]), percent(share[2])),
                        ]
                    });
                table.row([
                    on.into(),
                    Cell::strong(line.who),
                    line.what.into(),
                    share.into(),
                    interval.into(),
                ]);
            }
        }
        Section::new("simulator", "The simulator beside the robot").table(table)
    }
}

/// One effect, as it is told.
struct Row {
    who: &'static str,
    what: String,
    /// With its interval.
    share: Option<[f64; 3]>,
}

impl Row {
    fn share(&self) -> String {
        self.share.map_or(String::new(), |[share, low, high]| {
            format!(
                " ({} % of the gap, {} to {})",
                percent(share),
                percent(low),
                percent(high)
            )
        })
    }
}

impl Parts {
    fn rows(&self) -> Vec<Row> {
        let share = |found: &NamedEffect| Some([found.share, found.share_low, found.share_high]);
        let only = self.only_robot.iter().map(|found| Row {
            who: "only the robot has",
            what: with_value(found),
            share: share(found),
        });
        let both = self.both.iter().map(|both| {
            if both.is_same {
                return Row {
                    who: "both have",
                    what: with_value(&both.robot),
                    share: share(&both.robot),
                };
            }
            let missing = both.missing.as_ref();
            Row {
                who: "both have, not the same",
                what: format!(
                    "{} on the robot, {} in the simulator",
                    with_value(&both.robot),
                    with_value(&both.simulator)
                ),
                share: missing
                    .map(|missing| [missing.share, missing.share_low, missing.share_high]),
            }
        });
        let theirs = self.only_simulator.iter().map(|found| Row {
            who: "only the simulator has",
            what: with_value(found),
            share: None,
        });
        only.chain(both).chain(theirs).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn effect(name: &str, parameter: &str, value: f64, share: f64) -> Value {
        json!({
            "effect": name, "probability": 0.9, "share": share, "share_low": share - 0.05, "share_high": share + 0.05,
            "parameters": { parameter: { "value": value, "std": 0.03 * value, "at_bound": false } }, "shrink_alone": 0.5
        })
    }

    fn report(effects: Value, minor: Value) -> Report {
        let mut report = crate::gap::apply::tests::report(effects, json!([]));
        report.joints[0].minor_effects = serde_json::from_value(minor).unwrap();
        report
    }

    #[test]
    fn what_only_one_has_and_what_both_have_is_told() {
        let robot = report(
            json!([
                effect("coulomb_friction", "coulomb_nm", 3.0, 0.6),
                effect("viscous_friction", "viscous_nm_s_rad", 2.0, 0.3),
                effect("joint_spring", "stiffness_nm_rad", 1.0, 0.08),
            ]),
            json!([effect("torque_offset", "offset_nm", 0.1, 0.01)]),
        );
        let simulator = report(
            json!([
                effect("coulomb_friction", "coulomb_nm", 1.5, 0.9),
                effect("torque_offset", "offset_nm", 0.1, 0.05),
                effect("quadratic_friction", "quadratic_nm_s2_rad2", 1.0, 0.05),
            ]),
            json!([effect("viscous_friction", "viscous_nm_s_rad", 2.05, 0.01)]),
        );
        let beside = beside(&robot, &simulator);
        let parts = &beside.joints[0].parts;
        assert_eq!(parts.only_robot[0].effect, "joint_spring");
        assert_eq!(parts.only_simulator[0].effect, "quadratic_friction");
        let told: Vec<_> = parts
            .both
            .iter()
            .map(|both| (both.robot.effect.as_str(), both.is_same))
            .collect();
        assert_eq!(
            told,
            [
                ("coulomb_friction", false),
                ("viscous_friction", true),
                ("torque_offset", true)
            ]
        );
        // half of the torque is missing: a quarter of its energy
        let missing = parts.both[0].missing.as_ref().unwrap();
        assert_eq!(missing.value, 1.5);
        assert!((missing.share - 0.15).abs() < 1e-12, "{}", missing.share);
        let lines = beside.lines();
        assert!(
            lines.contains("shoulder: only the robot has: joint spring"),
            "{lines}"
        );
        assert!(lines.contains("(15 % of the gap"), "{lines}");
    }

    #[test]
    fn nothing_named_is_said() {
        let none = report(json!([]), json!([]));
        assert!(
            beside(&none, &none)
                .lines()
                .contains("nothing is named in either")
        );
    }
}
