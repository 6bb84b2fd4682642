//! Joints, their torques or their positions, recorded under each other's names: the file's masses carry less of what they are said
//! to carry than of what the other is.
//!
//! Friction and the gap that is looked for are no reason to think so: only what the rigid bodies do along the whole arm's motion
//! tells one joint from another, and an exchange must make that right for both at once.

use joint_twin::stretch::{Stretch, rigid_stretches};
use recording::{Finding, FindingKind, Recording, Severity};
use robot::Robot;

use crate::rigid::{Moving, OWN, gain, thinned};

/// What of two joints is recorded under each other's names.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Columns {
    All,
    Torques,
    Positions,
}

/// An exchange that was tried, and what the rigid bodies leave of each joint's torque after it.
struct Exchange {
    pair: [usize; 2],
    columns: Columns,
    gain: f64,
    after: Vec<f64>,
}

/// The two joints that fit the file's masses better under each other's names, if any do.
pub(crate) fn check(robot: &Robot, recording: &Recording) -> Option<Finding> {
    let thinned = thinned(robot, recording);
    let stretches = rigid_stretches(&[&thinned], robot).ok()?;
    let before = parts(robot, &stretches, None);
    let joints = 0..robot.joints.len();
    let pairs = joints.flat_map(|a| (0..a).map(move |b| [b, a]));
    let doubtful = pairs.filter(|pair| pair.iter().any(|joint| before[*joint] > OWN));
    let tried = doubtful.flat_map(|pair| {
        let with_torques = Some(parts(robot, &stretches, Some(pair)));
        let others = exchanged(robot, &thinned, pair);
        let others = others.and_then(|others| rigid_stretches(&[&others], robot).ok());
        let with_all = others.as_ref().map(|of| parts(robot, of, None));
        let with_positions = others.as_ref().map(|of| parts(robot, of, Some(pair)));
        let each = [
            (Columns::All, with_all),
            (Columns::Torques, with_torques),
            (Columns::Positions, with_positions),
        ];
        let before = &before;
        each.into_iter().filter_map(move |(columns, after)| {
            let after = after?;
            let gain = gain(before, &after)?;
            // an arm whose torques the file's masses do not carry, on its side for one, may fit less badly by chance
            let is_right = pair.iter().all(|joint| after[*joint] < OWN);
            is_right.then_some(Exchange {
                pair,
                columns,
                gain,
                after,
            })
        })
    });
    let best = tried.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
    Some(finding(robot, &before, &best))
}

fn finding(robot: &Robot, before: &[f64], exchange: &Exchange) -> Finding {
    let [a, b] = exchange.pair;
    let [first, second] = [a, b].map(|joint| &robot.joints[joint].name);
    let (of, columns) = match exchange.columns {
        Columns::All => ("", "all columns"),
        Columns::Torques => ("the torques of ", "the torque columns"),
        Columns::Positions => ("the positions of ", "all columns but those of torques"),
    };
    let what = format!(
        "{of}{first} and {second} are recorded under each other's names: the file's masses leave {:.2} and {:.2} of the squares of \
         their torques beyond friction, but {:.2} and {:.2} with the two exchanged",
        before[a], before[b], exchange.after[a], exchange.after[b],
    );
    Finding {
        severity: Severity::Error,
        kind: FindingKind::SwappedJoints,
        joint: None,
        signal: None,
        what,
        value: Some(exchange.gain),
        remedy: format!("exchange {columns} of {first} with those of {second}"),
    }
}

/// The recording with the signals of two joints under each other's names.
fn exchanged(robot: &Robot, recording: &Recording, pair: [usize; 2]) -> Option<Recording> {
    let place = |joint: usize| {
        let name = &robot.joints[joint].name;
        recording.joints.iter().position(|of| of.name == *name)
    };
    let (a, b) = (place(pair[0])?, place(pair[1])?);
    let mut exchanged = recording.clone();
    exchanged.joints[a].signals = recording.joints[b].signals.clone();
    exchanged.joints[b].signals = recording.joints[a].signals.clone();
    Some(exchanged)
}

/// Of each joint, what the rigid bodies leave of the squares of its torque beyond friction. Two joints may have each other's torques.
fn parts(robot: &Robot, stretches: &[Stretch], exchanged: Option<[usize; 2]>) -> Vec<f64> {
    let torque_of = |joint: usize| match exchanged {
        Some([a, b]) if joint == a => b,
        Some([a, b]) if joint == b => a,
        _ => joint,
    };
    let joints = 0..robot.joints.len();
    let part = |joint| Moving::of(robot, joint, torque_of(joint), stretches);
    joints
        .map(|joint| part(joint).map_or(1.0, |moving| moving.left()))
        .collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use made_up::swinging;

    use super::*;
    use recording::Signal;

    #[test]
    fn joints_that_carry_something_are_told_by_it() {
        let robot = robot::load("pa10").unwrap();
        let honest = swinging(&robot, None);
        assert_eq!(check(&robot, &honest), None);
        for pair in [[1, 3], [0, 5]] {
            let recording = exchanged(&robot, &honest, pair).unwrap();
            let finding = check(&robot, &recording).unwrap();
            assert_eq!(finding.kind, FindingKind::SwappedJoints);
            let names = pair.map(|joint| robot.joints[joint].name.as_str());
            let both = format!("{} and {} are", names[0], names[1]);
            assert!(finding.what.starts_with(&both), "{finding}");
        }
    }

    #[test]
    fn torques_or_positions_that_are_another_joints_are_told_from_whole_joints() {
        let robot = robot::load("pa10").unwrap();
        let honest = swinging(&robot, None);
        for (signal, of) in [
            (Signal::MotorTorqueNm, "the torques of"),
            (Signal::MotorPositionRad, "the positions of"),
        ] {
            let mut recording = honest.clone();
            for [to, from] in [[1, 3], [3, 1]] {
                let values = honest.joints[from].signals[&signal].clone();
                recording.joints[to].signals.insert(signal, values);
            }
            let finding = check(&robot, &recording).unwrap();
            let both = format!("{of} joint2 and joint4 are");
            assert!(finding.what.starts_with(&both), "{finding}");
        }
    }

    #[test]
    fn an_exchange_that_makes_joints_less_wrong_is_none() {
        let robot = robot::load("pa10").unwrap();
        let mut recording = swinging(&robot, None);
        // masses that carry nothing: the file's are too large, and springs do the rest
        for (columns, joint) in recording.joints.iter_mut().zip(&robot.joints) {
            let angle_rad = columns.signals[&Signal::MotorPositionRad].clone();
            let torque_nm = columns.signals.get_mut(&Signal::MotorTorqueNm).unwrap();
            let spring_nm_rad = 50.0 / joint.gear_ratio.powi(2);
            for (torque_nm, angle_rad) in torque_nm.iter_mut().zip(angle_rad) {
                *torque_nm = 0.7 * *torque_nm + spring_nm_rad * angle_rad;
            }
        }
        assert_eq!(check(&robot, &recording), None);
    }

    #[test]
    fn a_gap_is_no_exchange() {
        let robot = robot::load("pa10").unwrap();
        for heavier in [1, 3] {
            assert_eq!(check(&robot, &swinging(&robot, Some(heavier))), None);
        }
    }
}
