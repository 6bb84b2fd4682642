//! Joints, their torques or their positions, recorded under each other's names: the file's masses carry less of what they are said
//! to carry than of what the other is.
//!
//! Friction and the gap that is looked for are no reason to think so: only what the rigid bodies do along the whole arm's motion
//! tells one joint from another, and an exchange must make that right for both at once.

use nalgebra::{Matrix2, Vector2};
use recording::{Finding, FindingKind, Recording, Severity};
use robot::Robot;

use crate::stretch::{Stretch, rigid_stretches};

/// Rate at which this is looked at: what rigid bodies do is slow.
const RATE_HZ: f64 = 50.0;
/// A joint slower than this part of its root mean square velocity may stick.
const MOVES: f64 = 0.5;
/// Fewer rows than this tell nothing.
const ROWS_MIN: usize = 100;
/// The rigid bodies leave this part of a joint's torque, as squares, where it may be another's.
const OWN: f64 = 0.4;
/// Below this part left no twin of a tolerance is told from a better one.
const RIGHT: f64 = 0.01;
/// Natural logarithm of the factor by which an exchange must let the rigid bodies leave less, over all joints.
const GAIN: f64 = 2.0;
/// Part of that by which any one joint may be worse.
const WORSE: f64 = 0.1;

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
    let thinned = thinned(recording);
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
            // with a part exchanged an arm whose torques nothing carries may fit less badly by chance
            let is_right = pair.iter().all(|joint| after[*joint] < OWN);
            let is_believed = columns == Columns::All || is_right;
            is_believed.then_some(Exchange {
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

/// By how much an exchange lets the rigid bodies leave less, if it is believed.
fn gain(before: &[f64], after: &[f64]) -> Option<f64> {
    let each: Vec<f64> = before
        .iter()
        .zip(after)
        .map(|(b, a)| (b / a).ln())
        .collect();
    let gain: f64 = each.iter().sum();
    (gain > GAIN && each.iter().all(|own| *own > -WORSE * gain)).then_some(gain)
}

/// Rows at about [`RATE_HZ`].
fn thinned(recording: &Recording) -> Recording {
    let every = ((recording.sample_rate_hz / RATE_HZ) as usize).max(1);
    let mut thinned = recording.clone();
    thinned.time_s = recording.time_s.iter().copied().step_by(every).collect();
    thinned.segment = recording
        .segment
        .as_ref()
        .map(|segment| segment.iter().copied().step_by(every).collect());
    thinned.sample_rate_hz = recording.sample_rate_hz / every as f64;
    for joint in &mut thinned.joints {
        for values in joint.signals.values_mut() {
            *values = values.iter().copied().step_by(every).collect();
        }
    }
    thinned
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

/// Of each joint, what the rigid bodies leave of the squares of its torque beyond friction; all of it where that is not known. Two
/// joints may have each other's torques.
fn parts(robot: &Robot, stretches: &[Stretch], exchanged: Option<[usize; 2]>) -> Vec<f64> {
    let torque_of = |joint: usize| match exchanged {
        Some([a, b]) if joint == a => b,
        Some([a, b]) if joint == b => a,
        _ => joint,
    };
    let joints = 0..robot.joints.len();
    joints
        .map(|joint| part(robot, joint, torque_of(joint), stretches))
        .collect()
}

/// One joint's row: direction and velocity, torque, and what the rigid bodies make of it.
struct Row {
    friction: Vector2<f64>,
    torque_nm: f64,
    rigid_nm: f64,
}

fn part(robot: &Robot, joint: usize, torque_of: usize, stretches: &[Stretch]) -> f64 {
    let rows: Vec<Row> = stretches
        .iter()
        .flat_map(|stretch| rows(robot, joint, torque_of, stretch))
        .collect();
    let square = rows.iter().map(|row| row.friction.y.powi(2)).sum::<f64>();
    let moves_rad_s = MOVES * (square / rows.len().max(1) as f64).sqrt();
    let moving: Vec<&Row> = rows
        .iter()
        .filter(|row| row.friction.y.abs() > moves_rad_s)
        .collect();
    if moving.len() < ROWS_MIN {
        return 1.0;
    }
    let all = beyond_friction(&moving, |row| row.torque_nm);
    let left = beyond_friction(&moving, |row| row.torque_nm - row.rigid_nm);
    match (all, left) {
        (Some(all), Some(left)) if all > 0.0 => (left / all).max(RIGHT),
        _ => 1.0,
    }
}

/// Of a joint's motion, with the torque that is recorded as another's or its own.
fn rows(robot: &Robot, joint: usize, torque_of: usize, stretch: &Stretch) -> Vec<Row> {
    let (Some(of_joint), Some(of_torque)) = (&stretch.joints[joint], &stretch.joints[torque_of])
    else {
        return Vec::new();
    };
    let [file, other] = [joint, torque_of].map(|joint| &robot.joints[joint]);
    let rotor_kg_m2 = file.rotor_inertia_kg_m2 * file.gear_ratio.powi(2);
    let load = &of_joint.load;
    let acceleration_rad_s2 = stretch.motion.acceleration_rad_s2(joint);
    let whole = (0..of_joint.samples().min(of_torque.samples()))
        .filter(|k| of_joint.is_whole[*k] && of_torque.is_whole[*k]);
    whole
        .map(|k| {
            let velocity_rad_s = load.velocity_rad_s[k];
            let inertia_kg_m2 = rotor_kg_m2 + load.inertia_kg_m2[k];
            Row {
                friction: Vector2::new(velocity_rad_s.signum(), velocity_rad_s),
                // what is recorded is of the motor, whose ratio the file tells
                torque_nm: of_torque.torque_nm[k] * file.gear_ratio / other.gear_ratio,
                rigid_nm: load.torque_nm[k] + inertia_kg_m2 * acceleration_rad_s2[k],
            }
        })
        .collect()
}

/// Squares that friction of any level and slope leaves.
fn beyond_friction(rows: &[&Row], torque_nm: impl Fn(&Row) -> f64) -> Option<f64> {
    let mut information = Matrix2::zeros();
    let mut vector = Vector2::zeros();
    for row in rows {
        information += row.friction * row.friction.transpose();
        vector += row.friction * torque_nm(row);
    }
    let law = information.try_inverse()? * vector;
    let left = rows
        .iter()
        .map(|row| (torque_nm(row) - row.friction.dot(&law)).powi(2));
    let left: f64 = left.sum();
    left.is_finite().then_some(left)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;
    use recording::{JointColumns, Signal};

    /// Every joint of an arm swings at its own frequencies; joint `heavier` carries more than its file says.
    fn swinging(robot: &Robot, heavier: Option<usize>) -> Recording {
        let count = robot.joints.len();
        let rows = 600;
        let mut columns = vec![[vec![0.0; rows], vec![0.0; rows]]; count];
        let mut rigid_nm = vec![0.0; count];
        let time_s: Vec<f64> = (0..rows).map(|k| k as f64 / 50.0).collect();
        for (k, time_s) in time_s.iter().enumerate() {
            let [mut position, mut velocity, mut acceleration] = [0; 3].map(|_| vec![0.0; count]);
            for joint in 0..count {
                for (part, rate_rad_s) in [0.9, 2.3].iter().enumerate() {
                    let rate_rad_s = rate_rad_s * (1.0 + 0.13 * joint as f64);
                    let size_rad = 0.5 / (1.0 + 2.0 * part as f64);
                    let (sin, cos) = (rate_rad_s * time_s + joint as f64).sin_cos();
                    position[joint] += size_rad * sin;
                    velocity[joint] += size_rad * rate_rad_s * cos;
                    acceleration[joint] -= size_rad * rate_rad_s * rate_rad_s * sin;
                }
            }
            let chain = &robot.chain;
            chain.inverse_dynamics(&position, &velocity, &acceleration, &mut rigid_nm);
            for (joint, file) in robot.joints.iter().enumerate() {
                let rotor_kg_m2 = file.rotor_inertia_kg_m2 * file.gear_ratio.powi(2);
                let friction_nm = 4.0 * velocity[joint].signum() + 3.0 * velocity[joint];
                let more = if heavier == Some(joint) { 1.6 } else { 1.0 };
                let torque_nm =
                    more * rigid_nm[joint] + rotor_kg_m2 * acceleration[joint] + friction_nm;
                columns[joint][0][k] = file.gear_ratio * position[joint];
                columns[joint][1][k] = torque_nm / file.gear_ratio;
            }
        }
        let of_joint = |([angle_rad, torque_nm], file): ([Vec<f64>; 2], &robot::RobotJoint)| {
            let signals = [
                (Signal::MotorPositionRad, angle_rad),
                (Signal::MotorTorqueNm, torque_nm),
            ];
            JointColumns {
                name: file.name.clone(),
                signals: signals.into(),
            }
        };
        Recording {
            time_s,
            segment: None,
            joints: columns
                .into_iter()
                .zip(&robot.joints)
                .map(of_joint)
                .collect(),
            sample_rate_hz: 50.0,
            metadata: Default::default(),
            truncated: false,
        }
    }

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
    fn a_gap_is_no_exchange() {
        let robot = robot::load("pa10").unwrap();
        for heavier in [1, 3] {
            assert_eq!(check(&robot, &swinging(&robot, Some(heavier))), None);
        }
    }
}
