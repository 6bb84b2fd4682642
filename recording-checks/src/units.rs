//! Torques and positions in another unit, or of the other side of the gear, where no other signal of the recording shows it: the
//! file's masses do, which need another torque on another motion.

use std::f64::consts::{PI, TAU};

use joint_twin::scale::ROWS_MIN;
use joint_twin::stretch::{Stretch, rigid_stretches};
use recording::{Finding, FindingKind, JointColumns, Recording, Severity, Signal};
use robot::{Robot, RobotJoint};

use crate::rigid::{MadeOf, Moving, OWN, gain, thinned, torque_signal};

const DEGREES: f64 = 180.0 / PI;
/// Which torque it may be.
const JOINT_SIDE: &str = "at the joint's side";
const MOTOR_SIDE: &str = "at the motor's side";
/// True over nominal torque within this is an effect: what is off by more is another unit, side or sign.
pub const GAIN: [f64; 2] = [0.5, 2.0];
/// No effect makes what the rigid bodies need so many times larger or smaller while friction agrees.
const BY_EFFECTS: f64 = 8.0;
/// Friction agrees if it is off by that factor, but for this one: with more, a KUKA KR300's axis whose masses carry a tenth is refused.
const ALIKE: f64 = 3.0;
/// What tells where a joint is.
const POSITIONS: [Signal; 3] = [
    Signal::MotorPositionRad,
    Signal::LinkPositionRad,
    Signal::ReferencePositionRad,
];

/// Errors, of one joint each or of all.
pub(crate) fn check(robot: &Robot, recording: &Recording) -> Vec<Finding> {
    let thinned = thinned(robot, recording);
    let Ok(stretches) = rigid_stretches(&[&thinned], robot) else {
        return Vec::new();
    };
    let moving = moving(robot, &stretches);
    let each = robot.joints.iter().zip(&moving);
    let each = each
        .map(|(joint, moving)| torque(joint, recording.joint(&joint.name).ok()?, moving.as_ref()?));
    let mut torques: Vec<Option<Told>> = each.collect();
    add_untold(robot, recording, &moving, &mut torques);
    let torques: Vec<Told> = torques.into_iter().flatten().collect();
    let least_off = torques.iter().map(|told| told.friction_off);
    let least_off = least_off.fold(f64::INFINITY, f64::min);
    // on a small swing a torque that is too small is like an angle that is too large, but for friction
    match positions(robot, &thinned, &moving) {
        Some(told) if told.friction_off < least_off => vec![told.finding],
        _ => torques.into_iter().map(|told| told.finding).collect(),
    }
}

/// What is told of a unit.
struct Told {
    finding: Finding,
    /// Logarithm of the factor by which friction is off the file's in that unit, whichever way; a mean over joints.
    friction_off: f64,
    /// The unit that it is of all torques, if it is one.
    of_all: Option<(f64, &'static str)>,
}

/// Torques of joints whose masses do not tell their unit, where all that do tell one: who writes one torque in it writes all.
fn add_untold(
    robot: &Robot,
    recording: &Recording,
    moving: &[Option<Moving>],
    torques: &mut [Option<Told>],
) {
    let is_right = |moving: &Moving| {
        let made_of = moving.made_of();
        made_of.is_some_and(|of| of.left < OWN && off(of.rigid) < BY_EFFECTS.ln())
    };
    let mut units = torques.iter().flatten().map(|told| told.of_all);
    let Some(Some((unit, name))) = units.next() else {
        return;
    };
    if units.any(|other| other != Some((unit, name))) || moving.iter().flatten().any(is_right) {
        return;
    }
    for (joint, told) in robot.joints.iter().zip(torques) {
        let columns = recording.joint(&joint.name).ok();
        let Some(signal) = columns.and_then(torque_signal).filter(|_| told.is_none()) else {
            continue;
        };
        let finding = Finding {
            severity: Severity::Error,
            kind: FindingKind::WrongUnit,
            joint: Some(joint.name.clone()),
            signal: Some(signal),
            what: format!(
                "its torque may be {name}: its masses do not tell, and wherever they do the torque is"
            ),
            value: Some(unit),
            remedy: remedy(&joint.name, unit),
        };
        *told = Some(Told {
            finding,
            // its friction does not speak for the unit
            friction_off: f64::INFINITY,
            of_all: Some((unit, name)),
        });
    }
}

/// What puts a torque right that is so many times what it should be.
fn remedy(joint: &str, times: f64) -> String {
    format!(
        "in the mapping file, [joint.{joint}], multiply the scale of the torques by {:.4e}, or correct masses and friction of the \
         robot file",
        1.0 / times
    )
}

/// Over the file's friction, the one that a joint's torque shows; none where the file has none.
fn friction(joint: &RobotJoint, made_of: &MadeOf) -> Option<f64> {
    let friction = joint.steady_friction();
    let told_nm = friction.drag_nm(made_of.velocity_rad_s, 0.0, 0.0, 0.0);
    (told_nm > 0.0).then_some(made_of.friction_nm / told_nm)
}

/// How far a factor is off one; as far as can be where it has the wrong sign.
fn off(factor: f64) -> f64 {
    if factor > 0.0 {
        factor.ln().abs()
    } else {
        f64::INFINITY
    }
}

fn moving(robot: &Robot, stretches: &[Stretch]) -> Vec<Option<Moving>> {
    let joints = 0..robot.joints.len();
    joints
        .map(|joint| Moving::of(robot, joint, joint, stretches))
        .collect()
}

fn left(moving: &[Option<Moving>]) -> Vec<f64> {
    let left = |moving: &Option<Moving>| moving.as_ref().map_or(1.0, Moving::left);
    moving.iter().map(left).collect()
}

/// What is left in another unit; all of a joint that stood: what moves there is its encoder's noise, many times as large.
fn left_of(stood: &[Option<Moving>], moving: &[Option<Moving>]) -> Vec<f64> {
    let both = stood.iter().zip(left(moving));
    both.map(|(before, left)| if before.is_some() { left } else { 1.0 })
        .collect()
}

/// A torque that is many times what the rigid bodies and the file's friction need, a small part of it, or against it.
fn torque(joint: &RobotJoint, columns: &JointColumns, moving: &Moving) -> Option<Told> {
    let made_of = moving.made_of()?;
    let rigid = made_of.rigid;
    let friction = friction(joint, &made_of);
    if made_of.left > OWN || rigid == 0.0 {
        return None;
    }
    if let Some(friction) = friction.filter(|friction| *friction < 0.0)
        && let Some(told) = driven(joint, columns, &made_of, friction)
    {
        return Some(told);
    }
    let friction_off = friction.map_or(0.0, |friction| off(friction / rigid));
    if rigid < 0.0 || friction_off > ALIKE.ln() {
        return None;
    }
    if off(rigid) < BY_EFFECTS.ln() {
        return None;
    }
    let ratio = joint.gear_ratio.abs();
    let current = joint.torque_constant_nm_a.map(|constant| 1.0 / constant);
    let signal = torque_signal(columns)?;
    let (side, current) = match signal {
        Signal::JointTorqueNm => ((1.0 / ratio, MOTOR_SIDE), None),
        _ => ((ratio, JOINT_SIDE), current),
    };
    let units = [
        (Some(side.0), side.1),
        (current, "the motor's current"),
        (Some(1000.0), "in mN m"),
        (Some(100.0), "in N cm"),
    ];
    let distance = |unit: f64| (rigid / unit).ln().abs();
    let known = units
        .iter()
        .filter_map(|(unit, name)| Some(((*unit)?, *name)));
    let nearest = known
        .filter(|(unit, _)| distance(*unit) < GAIN[1].ln())
        .min_by(|a, b| distance(a.0).total_cmp(&distance(b.0)));
    // masses that are missing, or too many, may be any factor off
    if nearest.is_none() && friction.is_none() {
        return None;
    }
    let (kind, it_may_be, unit) = match nearest {
        Some((unit, name)) => {
            let kind = if name == side.1 {
                FindingKind::WrongSide
            } else {
                FindingKind::WrongUnit
            };
            (kind, format!(": it may be {name}"), unit)
        }
        None => (FindingKind::WrongScale, String::new(), rigid),
    };
    let friction = friction.map_or_else(String::new, |friction| {
        format!(", and its friction {friction:.3} times the file's")
    });
    let name = &joint.name;
    let finding = Finding {
        severity: Severity::Error,
        kind,
        joint: Some(name.clone()),
        signal: Some(signal),
        what: format!(
            "its torque is {rigid:.4} times what the robot file's masses need on this motion{friction}{it_may_be}"
        ),
        value: Some(rigid),
        remedy: remedy(name, unit),
    };
    Some(Told {
        finding,
        friction_off,
        // a side's factor and a current's are each joint's own
        of_all: nearest.filter(|(_, name)| name.starts_with("in ")),
    })
}

/// A torque in which friction drives the joint, as strongly as the file's would brake it: so many times that. It is reversed if what
/// the masses need is against them too, else time is. Where there is no friction, an arm that hangs where it was thought to stand would
/// look reversed.
fn driven(
    joint: &RobotJoint,
    columns: &JointColumns,
    made_of: &MadeOf,
    friction: f64,
) -> Option<Told> {
    let rigid = made_of.rigid;
    let friction_off = off(-friction / rigid.abs());
    let stands_out = made_of.friction_nm < -made_of.left_nm;
    if friction_off > ALIKE.ln() || !stands_out || made_of.other_way < ROWS_MIN {
        return None;
    }
    let name = &joint.name;
    let (what, remedy) = if rigid < 0.0 {
        let factor = if off(-rigid) < BY_EFFECTS.ln() {
            -1.0
        } else {
            1.0 / rigid
        };
        (
            format!(
                "its torque or its position is reversed: {rigid:.4} times what the robot file's masses need on this motion, and its \
                 friction {friction:.3} times the file's"
            ),
            format!(
                "in the mapping file, [joint.{name}], multiply the scale of the torques by {factor:.4e}, or that of its positions by -1"
            ),
        )
    } else {
        (
            format!(
                "its rows run backwards: friction drives it, {friction:.3} times the file's, while its torque is {rigid:.4} times what \
                 the robot file's masses need"
            ),
            "order the rows as they were recorded".to_owned(),
        )
    };
    let finding = Finding {
        severity: Severity::Error,
        kind: FindingKind::ReversedSign,
        joint: Some(name.clone()),
        signal: Some(torque_signal(columns)?),
        what,
        value: Some(rigid),
        remedy,
    };
    Some(Told {
        finding,
        friction_off,
        of_all: None,
    })
}

/// A factor of all positions of some joints.
struct Tried {
    /// None for all joints.
    joint: Option<usize>,
    factor: f64,
    unit: &'static str,
    gain: f64,
    left: [f64; 2],
    friction_off: f64,
}

/// Positions in a unit in which the rigid bodies need another torque: of a joint of which one encoder alone tells, or of all.
fn positions(robot: &Robot, thinned: &Recording, moving: &[Option<Moving>]) -> Option<Told> {
    let (stood, before) = (moving, left(moving));
    let is_alone = |joint: usize| {
        let columns = thinned.joint(&robot.joints[joint].name);
        columns.is_ok_and(|columns| {
            let there = POSITIONS.iter();
            there.filter(|of| columns.measured(**of).is_some()).count() == 1
        })
    };
    let is_off = |joint: &usize| before[*joint] > OWN && stood[*joint].is_some();
    let joints = 0..before.len();
    let each = joints
        .clone()
        .filter(|joint| is_off(joint) && is_alone(*joint));
    let all = (before.len() > 1 && joints.clone().any(|joint| is_off(&joint))).then_some(None);
    let which: Vec<Option<usize>> = all.into_iter().chain(each.map(Some)).collect();
    let tried = which.into_iter().flat_map(|joint| {
        let before = &before;
        let units = [
            (DEGREES, "in degrees"),
            (1.0 / DEGREES, "in radians taken for degrees"),
            (1.0 / TAU, "in turns"),
        ];
        units.into_iter().filter_map(move |(factor, unit)| {
            let divided = divided(robot, thinned, joint, factor);
            let stretches = rigid_stretches(&[&divided], robot).ok()?;
            let moving = self::moving(robot, &stretches);
            let after = left_of(stood, &moving);
            gain(before, &after)?;
            // of joints that it makes right, and not of those that it makes less wrong
            let right = before.iter().zip(&after).filter(|(_, after)| **after < OWN);
            let (before_right, after_right): (Vec<f64>, Vec<f64>) = right.unzip();
            let gain = gain(&before_right, &after_right)?;
            let worst = |of: &[f64]| match joint {
                Some(joint) => of[joint],
                None => of.iter().copied().fold(0.0, f64::max),
            };
            let left = [worst(before), worst(&after)];
            let of = |(file, moving): (&RobotJoint, &Option<Moving>)| {
                friction(file, &moving.as_ref()?.made_of()?).map(off)
            };
            let each = robot.joints.iter().zip(&moving).enumerate();
            let each = each.filter(|(k, _)| joint.is_none_or(|joint| joint == *k));
            let off: Vec<f64> = each.filter_map(|(_, of_joint)| of(of_joint)).collect();
            let friction_off = off.iter().sum::<f64>() / off.len().max(1) as f64;
            joint
                .is_none_or(|joint| after[joint] < OWN)
                .then_some(Tried {
                    joint,
                    factor,
                    unit,
                    gain,
                    left,
                    friction_off,
                })
        })
    });
    let best = tried.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
    Some(Told {
        finding: finding(robot, thinned, &best),
        friction_off: best.friction_off,
        of_all: None,
    })
}

fn finding(robot: &Robot, thinned: &Recording, tried: &Tried) -> Finding {
    let joint = tried.joint.map(|joint| robot.joints[joint].name.clone());
    let columns = joint.as_ref().and_then(|name| thinned.joint(name).ok());
    let signal = columns.and_then(|columns| {
        let mut there = POSITIONS.into_iter();
        there.find(|of| columns.measured(*of).is_some())
    });
    let (of, whose) = match &joint {
        Some(name) => ("its", format!("[joint.{name}]")),
        None => ("all", "of all joints".to_owned()),
    };
    let [before, after] = tried.left;
    Finding {
        severity: Severity::Error,
        kind: FindingKind::WrongUnit,
        what: format!(
            "{of} positions are {}: the file's masses leave {before:.2} of the squares of the torque beyond friction, but {after:.2} with positions \
             divided by {:.4}",
            tried.unit, tried.factor
        ),
        joint,
        signal,
        value: Some(tried.gain),
        remedy: format!(
            "in the mapping file, {whose}, multiply the scale of positions by {:.8}",
            1.0 / tried.factor
        ),
    }
}

/// The recording with all positions of a joint, or of all, divided by a factor.
fn divided(robot: &Robot, recording: &Recording, joint: Option<usize>, factor: f64) -> Recording {
    let mut divided = recording.clone();
    let name = joint.map(|joint| &robot.joints[joint].name);
    for columns in &mut divided.joints {
        if name.is_none_or(|name| columns.name == *name) {
            for signal in POSITIONS {
                for value in columns.signals.get_mut(&signal).into_iter().flatten() {
                    *value /= factor;
                }
            }
        }
    }
    divided
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use joint_twin::signal::random::uniform;
    use made_up::{self, MadeUp, swinging};

    use super::*;

    fn scaled(recording: &Recording, joint: usize, signal: Signal, factor: f64) -> Recording {
        let mut scaled = recording.clone();
        let values = scaled.joints[joint].signals.get_mut(&signal).unwrap();
        values.iter_mut().for_each(|value| *value *= factor);
        scaled
    }

    #[test]
    fn one_encoder_and_one_torque_are_held_against_the_masses() {
        let robot = made_up::robot();
        let right = MadeUp::KNOWN.recorded(uniform(3));
        assert_eq!(check(&robot, &right), []);
        let heavier = MadeUp {
            payload_kg: 2.0,
            ..MadeUp::KNOWN
        };
        assert_eq!(check(&robot, &heavier.recorded(uniform(3))), []);
        for (signal, factor, kind, text) in [
            (
                Signal::MotorPositionRad,
                DEGREES,
                FindingKind::WrongUnit,
                "in degrees",
            ),
            (
                Signal::MotorPositionRad,
                1.0 / TAU,
                FindingKind::WrongUnit,
                "in turns",
            ),
            (
                Signal::MotorTorqueNm,
                1000.0,
                FindingKind::WrongUnit,
                "in mN m",
            ),
            (
                Signal::MotorTorqueNm,
                100.0,
                FindingKind::WrongSide,
                "at the joint's side",
            ),
            (
                Signal::MotorTorqueNm,
                1.0 / DEGREES,
                FindingKind::WrongScale,
                "0.017",
            ),
            (
                Signal::MotorTorqueNm,
                -1.0,
                FindingKind::ReversedSign,
                "reversed",
            ),
            (
                Signal::MotorTorqueNm,
                -DEGREES,
                FindingKind::ReversedSign,
                "reversed: -57",
            ),
        ] {
            let found = check(&robot, &scaled(&right, 0, signal, factor));
            assert_eq!(found.len(), 1, "{signal} {factor}");
            assert_eq!((found[0].kind, found[0].signal), (kind, Some(signal)));
            assert!(found[0].what.contains(text), "{}", found[0]);
        }
    }

    #[test]
    fn a_torque_behind_the_gear_has_a_unit_too() {
        let robot = made_up::robot();
        let ratio = robot.joints[0].gear_ratio;
        let mut sensed = MadeUp::KNOWN.recorded(uniform(3));
        let signals = &mut sensed.joints[0].signals;
        let motor_nm = signals.remove(&Signal::MotorTorqueNm).unwrap();
        let joint_nm = motor_nm.iter().map(|nm| ratio * nm).collect();
        signals.insert(Signal::JointTorqueNm, joint_nm);
        assert_eq!(check(&robot, &sensed), []);
        for (factor, text) in [(1000.0, "in mN m"), (1.0 / ratio, "at the motor's side")] {
            let found = check(&robot, &scaled(&sensed, 0, Signal::JointTorqueNm, factor));
            assert_eq!(found.len(), 1, "{factor}");
            assert_eq!(found[0].signal, Some(Signal::JointTorqueNm));
            assert!(found[0].what.contains(text), "{}", found[0]);
        }
    }

    #[test]
    fn what_all_torques_that_tell_are_in_the_others_are_too() {
        let mut robot = robot::load("pa10").unwrap();
        for joint in &mut robot.joints {
            joint.effects.clear();
        }
        let right = swinging(&robot, None);
        assert_eq!(check(&robot, &right), []);
        let joints = robot.joints.len();
        let all = (0..joints).fold(right.clone(), |all, joint| {
            scaled(&all, joint, Signal::MotorTorqueNm, 1000.0)
        });
        let found = check(&robot, &all);
        assert_eq!(found.len(), joints, "{found:?}");
        // one that is right says that the others are not all in it
        let tells = found.iter().position(|found| found.what.contains("times"));
        let one = scaled(&right, tells.unwrap(), Signal::MotorTorqueNm, 1000.0);
        assert_eq!(check(&robot, &one).len(), 1);
    }

    #[test]
    fn a_joint_that_stands_is_in_no_other_unit_whatever_it_carries() {
        let mut robot = robot::load("pa10").unwrap();
        for joint in &mut robot.joints {
            joint.effects.clear();
        }
        let right = swinging(&robot, None);
        // the shoulder swings, and the elbow carries its forearm as that turns; encoders show some steps of noise
        let (shoulder, elbow) = (1, 3);
        let mut standing = right.clone();
        let count = robot.joints.len();
        let mut noise = uniform(5);
        for row in 0..standing.rows() {
            let moving = |signal| right.joints[shoulder].signals[&signal][row];
            let ratio = robot.joints[shoulder].gear_ratio;
            let [mut position, velocity, acceleration, mut torque_nm] =
                [(); 4].map(|()| vec![0.0; count]);
            position[shoulder] = moving(Signal::MotorPositionRad) / ratio;
            robot
                .chain
                .inverse_dynamics(&position, &velocity, &acceleration, &mut torque_nm);
            for joint in [shoulder, elbow] {
                let ratio = robot.joints[joint].gear_ratio;
                let signals = &mut standing.joints[joint].signals;
                signals.get_mut(&Signal::MotorTorqueNm).unwrap()[row] = torque_nm[joint] / ratio;
            }
            for joint in (0..count).filter(|joint| *joint != shoulder) {
                let ratio = robot.joints[joint].gear_ratio;
                let signals = &mut standing.joints[joint].signals;
                signals.get_mut(&Signal::MotorPositionRad).unwrap()[row] = 5e-5 * ratio * noise();
            }
        }
        for (joint, columns) in standing.joints.iter_mut().enumerate() {
            columns.signals.retain(|signal, _| {
                let is_torque =
                    *signal == Signal::MotorTorqueNm && [shoulder, elbow].contains(&joint);
                is_torque || *signal == Signal::MotorPositionRad
            });
        }
        assert_eq!(check(&robot, &standing), []);
    }

    #[test]
    fn rows_in_the_wrong_order_are_told_from_a_wrong_sign() {
        let robot = made_up::robot();
        let mut backwards = MadeUp::KNOWN.recorded(uniform(3));
        for values in backwards.joints[0].signals.values_mut() {
            values.reverse();
        }
        let found = check(&robot, &backwards);
        assert_eq!(found.len(), 1);
        assert!(found[0].what.contains("backwards"), "{}", found[0]);
    }

    #[test]
    fn who_stands_still_has_no_unit() {
        let robot = robot::load("pa10").unwrap();
        let mut still = swinging(&robot, None);
        for joint in &mut still.joints {
            for values in joint.signals.values_mut() {
                let first = values[0];
                values.fill(first);
            }
        }
        assert_eq!(check(&robot, &still), []);
    }

    #[test]
    fn degrees_of_one_joint_of_an_arm_are_told_from_those_of_all() {
        let robot = robot::load("pa10").unwrap();
        let right = swinging(&robot, None);
        assert_eq!(check(&robot, &right), []);
        assert_eq!(check(&robot, &swinging(&robot, Some(3))), []);
        let one = scaled(&right, 1, Signal::MotorPositionRad, DEGREES);
        let found = check(&robot, &one);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].joint.as_deref(), Some("joint2"));
        let joints = 0..robot.joints.len();
        let all = joints.fold(right, |all, joint| {
            scaled(&all, joint, Signal::MotorPositionRad, DEGREES)
        });
        let found = check(&robot, &all);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].joint, None);
        assert!(found[0].what.starts_with("all positions are in degrees"));
    }
}
