//! `gap apply --remaining`: what the named effects leave, as a table in the robot file, so that the gap shrinks where no law has a
//! name.
//!
//! One rest may show over several variables, and two tables of it would take it off twice. So each joint gets one table, over the
//! variable that holds most; what another diagnosis with the new file still finds is the next one's. A rest that would be too small
//! for a name is too small for a table: on another motion it took off nothing and, beyond the angles that were seen, added to the gap.

use gap_diagnosis::Options;
use gap_report::{JointReport, Remains, RemainsOver, Report};
use robot::{TableOver, TorqueTable};
use toml_edit::{Array, DocumentMut, Table};

use super::{Change, joint_table, push, rounded};
use crate::gap::page::words::{percent, variable};
use report::number;

/// A robot file's text with tables in it.
pub struct WithRemaining {
    /// The new text.
    pub text: String,
    /// What was added.
    pub changes: Vec<Change>,
    /// What no table holds, in sentences.
    pub left_out: Vec<String>,
}

/// Adds each joint's table.
///
/// # Errors
/// Why a table does not fit the file.
pub fn with_remaining(text: &str, report: &Report) -> Result<WithRemaining, String> {
    let mut document: DocumentMut = text
        .parse()
        .map_err(|error| format!("robot file: {error}"))?;
    let (mut changes, mut left_out) = (Vec::new(), Vec::new());
    for joint in &report.joints {
        let written = joint
            .remaining_over
            .iter()
            .find_map(|rest| table(rest, joint));
        if let Some((_, table)) = &written {
            changes.push(add(&mut document, joint, table)?);
        }
        left_out.extend(told(joint, written.map(|(over, _)| over)));
    }
    Ok(WithRemaining {
        text: document.to_string(),
        changes,
        left_out,
    })
}

/// The rest as a table; none where it is no function of one number that a joint has by itself. The largest stands first.
fn table(rest: &RemainsOver, joint: &JointReport) -> Option<(Remains, TorqueTable)> {
    let over = match rest.over {
        Remains::Position => TableOver::Position,
        Remains::Velocity => TableOver::Velocity,
        Remains::Load => TableOver::Load,
        Remains::Time | Remains::SinceReversal | Remains::MotorPhase | Remains::OtherJoints => {
            return None;
        }
    };
    let mut table = TorqueTable {
        over,
        at: Vec::new(),
        torque_nm: Vec::new(),
    };
    for (at, torque_nm) in rest.at.iter().zip(&rest.torque_nm) {
        let at = rounded(*at);
        // corners that are one within the digits that are written
        if table.at.last().is_none_or(|last| *last < at) {
            table.at.push(at);
            let own_nm = joint.motor_per_recorded() * torque_nm;
            table.torque_nm.push(rounded(own_nm));
        }
    }
    (table.at.len() > 1 && is_material(rest)).then_some((rest.over, table))
}

fn is_material(rest: &RemainsOver) -> bool {
    rest.share >= Options::default().materiality
}

fn add(
    document: &mut DocumentMut,
    joint: &JointReport,
    table: &TorqueTable,
) -> Result<Change, String> {
    let name = &joint.joint;
    let (over, unit) = match table.over {
        TableOver::Position => ("position", "rad"),
        TableOver::Velocity => ("velocity", "rad/s"),
        TableOver::Load => ("load", "Nm"),
    };
    let numbers = |values: &[f64]| toml_edit::value(values.iter().copied().collect::<Array>());
    let mut entry = Table::new();
    entry.insert("over", toml_edit::value(over));
    entry.insert("at", numbers(&table.at));
    entry.insert("torque_nm", numbers(&table.torque_nm));
    let list = joint_table(document, name)?
        .entry("torque_tables")
        .or_insert_with(|| toml_edit::value(Array::new()));
    push(list, entry)
        .ok_or_else(|| "torque_tables of the robot file is no list; write it as one".to_owned())?;
    let ends = |values: &[f64]| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        format!("{} to {}", number(low, 3), number(high, 3))
    };
    Ok(Change {
        joint: Some(name.clone()),
        effect: "torque_table",
        done: format!(
            "added, over {over} {} {unit}, {} Nm",
            ends(&table.at),
            ends(&table.torque_nm)
        ),
    })
}

/// What of a joint's rest stands in no table, and why.
fn told(joint: &JointReport, written: Option<Remains>) -> Vec<String> {
    let others = joint.remaining_over.iter();
    let others = others.filter(|rest| Some(rest.over) != written);
    let told = others.map(|rest| {
        let why = match (table(rest, joint), written) {
            (Some(_), Some(written)) => format!(
                "it may be what the table over {} holds; diagnose again with the new file",
                variable(written)
            ),
            _ if !is_material(rest) => "it is too small to be worth a table".to_owned(),
            _ => "no table over one number of the joint can hold it".to_owned(),
        };
        format!(
            "{}: the {} % of the gap over {} are left out: {why}",
            joint.joint,
            percent(rest.share),
            variable(rest.over)
        )
    });
    let mut told: Vec<String> = told.collect();
    if joint.remaining_over.is_empty() && joint.remaining_share >= WORTH_A_WORD {
        told.push(format!(
            "{}: {} % of the gap remain, and over what is not known",
            joint.joint,
            percent(joint.remaining_share)
        ));
    }
    told
}

/// Half of the last per cent that is shown.
const WORTH_A_WORD: f64 = 0.005;

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    fn rest(over: Remains, share: f64, at: &[f64]) -> RemainsOver {
        RemainsOver {
            over,
            share,
            at: at.to_vec(),
            torque_nm: at.iter().map(|x| 0.1 * x).collect(),
        }
    }

    fn applied(rests: Vec<RemainsOver>) -> WithRemaining {
        let empty = serde_json::json!([]);
        let mut report = crate::gap::apply::tests::report(empty.clone(), empty);
        report.joints[0].remaining_share = 0.3;
        report.joints[0].remaining_over = rests;
        with_remaining(crate::gap::apply::tests::ROBOT, &report).unwrap()
    }

    #[test]
    fn the_largest_rest_that_a_table_holds_is_written_and_the_others_are_told() {
        let all = applied(vec![
            rest(Remains::SinceReversal, 0.2, &[]),
            rest(Remains::Velocity, 0.1, &[-1.0, 0.0, 0.5]),
            rest(Remains::Position, 0.05, &[0.0, 1.0]),
        ]);
        let file = robot::RobotFile::parse(&all.text, "new.toml").unwrap();
        let robot = file.build(robot::Source::File("new.toml".into())).unwrap();
        let [table] = robot.joints[0].torque_tables.as_slice() else {
            panic!("{}", all.text);
        };
        assert_eq!(table.over, TableOver::Velocity);
        assert_eq!(table.at, [-1.0, 0.0, 0.5]);
        assert_eq!(table.torque_nm, [-0.1, 0.0, 0.05]);
        assert!(all.text.contains("# slow sliding"), "comments stay");
        assert_eq!(all.changes.len(), 1);
        let told = all.left_out.join("\n");
        assert!(told.contains("20 % of the gap over the time since the last reversal"));
        assert!(told.contains("5.0 % of the gap over position are left out: it may be what"));
    }

    #[test]
    fn corners_that_are_one_within_the_digits_written_are_one() {
        let near = applied(vec![rest(
            Remains::Position,
            0.2,
            &[0.1, 0.100_000_01, 0.2],
        )]);
        assert!(near.text.contains("at = [0.1, 0.2]"), "{}", near.text);
    }

    #[test]
    fn a_rest_too_small_for_a_name_is_too_small_for_a_table() {
        let small = applied(vec![rest(Remains::Load, 0.01, &[0.0, 1.0])]);
        assert!(small.changes.is_empty());
        assert!(
            small.left_out[0].contains("1.0 % of the gap over load are left out: it is too small")
        );
    }

    #[test]
    fn a_rest_that_depends_on_nothing_is_told() {
        let nothing = applied(Vec::new());
        assert_eq!(nothing.text, crate::gap::apply::tests::ROBOT);
        assert!(nothing.left_out[0].contains("30 % of the gap remain"));
    }
}
