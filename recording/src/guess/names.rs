//! Joints, signals and units by the names of columns and the size of their values.

use super::numbers::Families;
use super::{Guess, GuessJoint, GuessedColumn, Sure};
use crate::Signal;
use crate::clock::{only_time_column, time_column};
use crate::columns::{Known, TIME, joint_and_signal};
use crate::frame::{Column, Frame, Values};
use crate::misread;
use crate::names::{
    Meaning, PROCESS_VALUE, Quantity, is_numbered_joint, meaning, meaning_of_slide, remoteness,
    without_joint, words, words_unknown,
};
use std::cmp::Reverse;
use std::f64::consts::PI;

/// What is known while the columns are looked at.
pub(super) struct Guesser<'a> {
    pub(super) frame: &'a Frame,
    pub(super) joints: &'a [GuessJoint],
    pub(super) families: Families<'a>,
    mostly_degrees: bool,
    /// Whether positions beyond a turn may still be radians.
    may_turn: bool,
}

impl<'a> Guesser<'a> {
    pub(super) fn new(frame: &'a Frame, joints: &'a [GuessJoint]) -> Self {
        Self {
            frame,
            joints,
            families: Families::new(frame, joints),
            mostly_degrees: mostly_degrees(frame, joints),
            may_turn: joints.iter().any(|joint| !joint.is_limited)
                && farthest_angles(frame, joints).all(|farthest| farthest < TURNING_RAD),
        }
    }

    pub(super) fn guess(&self) -> Guess {
        let columns = || self.frame.columns.iter();
        let time = only_time_column(columns().map(|column| &*column.name));
        let mut guess = Guess {
            has_time: columns().any(|column| column.name == TIME) || time.is_some(),
            ..Guess::default()
        };
        let mut columns: Vec<(usize, GuessedColumn)> = Vec::new();
        for (index, column) in self.frame.columns.iter().enumerate() {
            if column.name == TIME || time_column(&column.name).is_some() {
                continue;
            }
            match self.column(index, column) {
                Ok(found) => columns.push((index, found)),
                Err(why) => guess.left_out.push((column.name.clone(), why)),
            }
        }
        let rows = self.frame.rows();
        let other_lengths = self.frame.other_lengths.iter().map(|(name, length)| {
            let why = format!("it has {length} values where the times have {rows}");
            (name.clone(), why)
        });
        guess.left_out.extend(other_lengths);
        let (left_out, time) = self.weigh_velocities(&mut columns);
        guess.time = time;
        guess.left_out.extend(left_out);
        // The surest of several for one signal; of these one that has the joint's name or is of the family that most likely are the
        // joints; of these one that was measured, and of these the plainest name.
        columns.sort_by_key(|(index, found)| {
            let joint = self
                .joints
                .iter()
                .position(|joint| joint.name == found.joint);
            let best_first = (
                Reverse(found.sure),
                self.families.rank(*index),
                remoteness(&found.column),
            );
            let unknown = words_unknown(&found.column);
            (joint, found.signal, best_first, unknown, *index)
        });
        for (_, found) in columns {
            let same =
                |known: &&GuessedColumn| known.joint == found.joint && known.signal == found.signal;
            match guess.columns.iter().find(same) {
                Some(known) => {
                    let why = format!(
                        "`{}` is the {} of {}",
                        known.column, known.signal, known.joint
                    );
                    guess.left_out.push((found.column, why));
                }
                None => guess.columns.push(found),
            }
        }
        guess
    }

    /// What a column is by its name and its values, or why it is left out.
    fn column(&self, index: usize, column: &Column) -> Result<GuessedColumn, String> {
        let found = |joint: &GuessJoint, signal, scale, sure, why| GuessedColumn {
            column: column.name.clone(),
            joint: joint.name.clone(),
            signal,
            scale,
            sure,
            why,
        };
        if let Some(Known { joint, signal, .. }) =
            self.frame.known.iter().find(|known| known.column == index)
        {
            let joint = self
                .joint_named(joint)
                .ok_or("the robot has no such joint")?;
            let (signal, scale, sure, why) =
                of_the_motor(*signal, joint, Sure::Certain, "the message says it");
            return Ok(found(joint, signal, scale, sure, why));
        }
        if let Some((joint, signal)) = joint_and_signal(&column.name) {
            let joint = self
                .joint_named(joint)
                .ok_or("the robot has no such joint")?;
            return Ok(found(
                joint,
                signal,
                1.0,
                Sure::Certain,
                "its name is a signal's".to_owned(),
            ));
        }
        if let Some((joint, signal)) = self.frame.named_by_format(index) {
            let joint = self
                .joint_named(joint)
                .ok_or("the robot has no such joint")?;
            let (scale, unit) = self.unit(column, joint);
            let (sure, why) = match unit {
                None => (Sure::Likely, "the dataset says it".to_owned()),
                // What LeRobot does unless it is told to use degrees.
                Some((_, unit)) => (
                    Sure::Doubtful,
                    format!("the dataset says it; {unit}, or hundredths of a calibrated range"),
                ),
            };
            let (signal, to_motor, sure, why) = of_the_motor(signal, joint, sure, &why);
            return Ok(found(joint, signal, scale * to_motor, sure, why));
        }
        let (joint, meaning, mut sure, mut why) = self.by_name(index, &column.name)?;
        let (signal, side_is_supposed) = meaning.signal();
        let (scale, unit) = self.unit(column, joint);
        if let Some((unit_is, unit)) = unit {
            sure = sure.min(unit_is);
            why.push(unit);
        }
        if side_is_supposed {
            sure = sure.min(Sure::Likely);
            why.push("behind the gear, as its name tells no side".to_owned());
        }
        let (signal, to_motor, sure, why) = of_the_motor(signal, joint, sure, &why.join("; "));
        Ok(found(joint, signal, scale * to_motor, sure, why))
    }

    /// The joint that a column's name is of and what it says, how sure that is and why.
    fn by_name(
        &self,
        index: usize,
        name: &str,
    ) -> Result<(&GuessJoint, Meaning, Sure, Vec<String>), String> {
        let mut why = vec!["by its name".to_owned()];
        let said = said(name, self.joints).ok_or("its name says nothing that is known")?;
        let mut sure = Sure::Certain;
        if let Some(custom) = said.custom.or_else(|| self.doubt_of_words(name, &said)) {
            why.push(custom.to_owned());
            sure = Sure::Doubtful;
        }
        if let Some(joint) = said.joint {
            if !said.more.is_empty() {
                why.push(format!("which says `{}` too", said.more.join("_")));
                sure = Sure::Doubtful;
            }
            if let Some(doubt) = self.families.doubt(index) {
                why.push(doubt);
                sure = Sure::Doubtful;
            }
            return Ok((joint, said.meaning, sure, why));
        }
        let (joint, by_number) = self
            .families
            .joint(index)
            .ok_or("its name is of no joint of the robot")?;
        if by_number {
            sure = sure.min(Sure::Likely);
            why.push("joints by their number".to_owned());
            if let Some(doubt) = self.families.doubt(index) {
                sure = Sure::Doubtful;
                why.push(doubt);
            }
            let columns = self.frame.width_of(index);
            if columns.is_some_and(|columns| columns != self.joints.len()) {
                sure = Sure::Doubtful;
                why.push("of which it has others than the robot".to_owned());
            }
        }
        Ok((joint, said.meaning, sure, why))
    }

    /// What other columns must say for a name to be what it is taken for.
    fn doubt_of_words(&self, name: &str, said: &Said<'_>) -> Option<&'static str> {
        let some_says = |known: &[&str]| {
            let mut columns = self.frame.columns.iter();
            columns.any(|column| {
                words(&column.name)
                    .iter()
                    .any(|word| known.contains(&&**word))
            })
        };
        if said.is_makers && (!some_says(&["base"]) || some_says(&["pan"])) {
            return Some(
                "as the robot's maker calls its joints, though other columns are called otherwise",
            );
        }
        let is_feedback = words(name)
            .iter()
            .any(|word| ["feedback", "fb", "fbk"].contains(&&**word));
        if is_feedback && some_says(&["feedforward", "ff"]) {
            return Some("or what a controller adds to its feedforward, which is there too");
        }
        let says_x = || words(name).iter().any(|word| word == "x");
        let is_place = said.joint.is_none() && meaning(name).is_none() && says_x();
        (is_place && some_says(&["y", "z"])).then_some("or a place in space, as others are")
    }

    /// Signal over column; how sure that is, and why, where its name does not tell the unit.
    fn unit(&self, column: &Column, joint: &GuessJoint) -> (f64, Option<(Sure, String)>) {
        let told = said(&column.name, self.joints).and_then(|said| said.meaning.scale);
        if joint.slides {
            let farthest = unnamed_angle(column, self.joints);
            let far = farthest.filter(|farthest| *farthest > FARTHEST_RAD);
            let why = |far| format!("metres, though it goes to {far:.1}");
            return (
                told.unwrap_or(1.0),
                far.map(|far| (Sure::Doubtful, why(far))),
            );
        }
        let (sure, or) = if are_counts(column) {
            (
                Sure::Doubtful,
                ", or an encoder's counts, which are whole numbers too: 2π over those of a turn is their scale",
            )
        } else if self.may_turn {
            (Sure::Doubtful, ", or a joint that turns round in radians")
        } else {
            (Sure::Likely, "")
        };
        let why = match unnamed_angle(column, self.joints) {
            Some(farthest) if farthest > FARTHEST_RAD => {
                format!("degrees, as it goes to {farthest:.1}{or}")
            }
            Some(_) if self.mostly_degrees => format!("degrees, as most positions are{or}"),
            _ => return (told.unwrap_or(1.0), None),
        };
        (PI / 180.0, Some((sure, why)))
    }

    pub(super) fn joint_named(&self, name: &str) -> Option<&GuessJoint> {
        self.joints.iter().find(|joint| joint.name == name)
    }
}

/// A torque that is told at the joint is, of a geared joint, most likely the motor's times the ratio: sensors are rare. Where a rotor is
/// stated that no gear parts from the joint, it is what turns that.
fn of_the_motor(
    signal: Signal,
    joint: &GuessJoint,
    sure: Sure,
    why: &str,
) -> (Signal, f64, Sure, String) {
    if signal != Signal::JointTorqueNm {
        return (signal, 1.0, sure, why.to_owned());
    }
    if joint.gear_ratio == 1.0 {
        return if joint.has_rotor {
            let why = format!("{why}; the motor's, as the robot states a rotor (armature)");
            (Signal::MotorTorqueNm, 1.0, sure, why)
        } else {
            (signal, 1.0, sure, why.to_owned())
        };
    }
    let why = format!(
        "{why}; the motor's seen at the joint, over the gear ratio; for a torque sensor write joint_torque_nm"
    );
    (
        Signal::MotorTorqueNm,
        1.0 / joint.gear_ratio,
        Sure::Doubtful,
        why,
    )
}

/// What a column's name says in view of the robot's joints.
pub(super) struct Said<'a> {
    /// Whose name is in it.
    pub(super) joint: Option<&'a GuessJoint>,
    pub(super) meaning: Meaning,
    /// Words beside the joint's name that say nothing known.
    more: Vec<String>,
    /// Why it is a position, where nothing but custom says it.
    custom: Option<&'static str>,
    /// Whether the joint is called as the robot's maker does, and not its description.
    is_makers: bool,
}

/// The joints of Universal Robots in their descriptions, and on their pendants.
const MAKERS: [(&str, &str); 6] = [
    ("shoulder_pan", "base"),
    ("shoulder_lift", "shoulder"),
    ("elbow", "elbow"),
    ("wrist_1", "wrist_1"),
    ("wrist_2", "wrist_2"),
    ("wrist_3", "wrist_3"),
];

/// A joint's name without the word `joint`, if the rest says nothing else.
fn short_name(joint: &GuessJoint) -> Option<String> {
    const LETTERS_MIN: usize = 3;
    let own = words(&joint.name);
    let short: Vec<String> = own
        .iter()
        .filter(|word| *word != "joint")
        .cloned()
        .collect();
    let letters = short.concat().chars().filter(|c| c.is_alphabetic()).count();
    let rest = meaning(&format!("position {}", short.join(" ")))?.rest;
    (short.len() < own.len() && letters >= LETTERS_MIN && rest == short).then(|| short.join("_"))
}

/// What the one arm of a maker calls that joint, in its description and elsewhere.
fn makers_names(joint: &GuessJoint, joints: &[GuessJoint]) -> Option<(&'static str, &'static str)> {
    let has = |joint: &GuessJoint, part: &str| joint.name.contains(part);
    let of_one =
        |(part, _): &(&str, &str)| joints.iter().filter(|joint| has(joint, part)).count() == 1;
    let of_joint = MAKERS.into_iter().find(|(part, _)| has(joint, part))?;
    MAKERS.iter().all(of_one).then_some(of_joint)
}

/// What a name says of a quantity, by the words that the robot's joints have.
fn meaning_for(name: &str, joints: &[GuessJoint]) -> Option<Meaning> {
    if joints.iter().all(|joint| joint.slides) {
        meaning_of_slide(name)
    } else {
        meaning(name)
    }
}

/// Names of joints have words in them that would say something else: the `q3` of `q3_tau` is no position, and `shoulder_joint` no
/// side of the gear. So the joint's name is taken out before the rest is read. Of several the longest that fits counts.
pub(super) fn said<'a>(name: &str, joints: &'a [GuessJoint]) -> Option<Said<'a>> {
    let longest = |called: &dyn Fn(&GuessJoint) -> Option<String>| {
        let named = joints.iter().filter_map(|joint| {
            let rest = without_joint(name, &called(joint)?)?;
            Some((joint, rest))
        });
        named.max_by_key(|(joint, _)| joint.name.len())
    };
    let makers = |joint: &GuessJoint| makers_names(joint, joints);
    let own = longest(&|joint| Some(joint.name.clone()))
        .or_else(|| longest(&short_name))
        .or_else(|| longest(&|joint| Some(makers(joint)?.0.to_owned())));
    let is_makers = own.is_none();
    let named = own.or_else(|| longest(&|joint| Some(makers(joint)?.1.to_owned())));
    let process_value = "a position, as most controllers' process value is";
    let has_number = |word: &String| word.bytes().any(|byte| byte.is_ascii_digit());
    if let Some((joint, rest)) = &named
        && let Some(meaning) =
            meaning_for(rest, joints).filter(|found| !found.rest.iter().any(has_number))
    {
        return Some(Said {
            joint: Some(joint),
            more: meaning.rest.clone(),
            custom: is_process_value(name, &meaning).then_some(process_value),
            meaning,
            is_makers,
        });
    }
    let alone = named.filter(|(_, rest)| rest.is_empty());
    let meaning = meaning_of(name, joints)?;
    let by_joint = meaning_for(name, joints).is_none();
    let custom = by_joint.then_some("a position, as it has a joint's name alone");
    let process_value = is_process_value(name, &meaning).then_some(process_value);
    Some(Said {
        is_makers: is_makers && alone.is_some(),
        joint: alone.map(|(joint, _)| joint),
        meaning,
        more: Vec::new(),
        custom: custom.or(process_value),
    })
}

fn is_process_value(name: &str, meaning: &Meaning) -> bool {
    meaning.quantity == Quantity::Position && name.contains(PROCESS_VALUE)
}

/// What a column's name says; a joint's name alone is its position, by custom.
pub(super) fn meaning_of(name: &str, joints: &[GuessJoint]) -> Option<Meaning> {
    let is_joint = |joint: &GuessJoint| without_joint(name, &joint.name).as_deref() == Some("");
    meaning_for(name, joints).or_else(|| {
        let alone = is_numbered_joint(name) || joints.iter().any(is_joint);
        alone
            .then(|| meaning(&format!("position {name}")))
            .flatten()
    })
}

/// How far a column goes that holds positions of joints and whose name does not tell their unit.
fn unnamed_angle(column: &Column, joints: &[GuessJoint]) -> Option<f64> {
    let meaning = said(&column.name, joints)?.meaning;
    let is_angle = meaning.quantity == Quantity::Position && meaning.is_motor != Some(true);
    let Values::Numbers(values) = &column.values else {
        return None;
    };
    (is_angle && meaning.scale.is_none()).then(|| {
        // a row that was misread tells nothing of the unit
        let misread = misread::rows(values);
        let read = values.iter().enumerate();
        let read = read.filter(|(row, _)| misread.binary_search(row).is_err());
        read.fold(0.0, |farthest: f64, (_, value)| farthest.max(value.abs()))
    })
}

/// Whether values are whole numbers that go beyond a turn in degrees, as those of encoders of 12 bits do.
fn are_counts(column: &Column) -> bool {
    let Values::Numbers(values) = &column.values else {
        return false;
    };
    let read = || values.iter().filter(|value| value.is_finite());
    read().all(|value| value.fract() == 0.0) && read().any(|value| value.abs() > 360.0)
}

/// A joint turns once each way at most, but for a motor.
const FARTHEST_RAD: f64 = 2.5 * PI;
/// A pendulum that is swung up turns round a few times; in degrees some joint of a log goes farther than this.
const TURNING_RAD: f64 = 10.0 * PI;

fn farthest_angles<'a>(
    frame: &'a Frame,
    joints: &'a [GuessJoint],
) -> impl Iterator<Item = f64> + 'a {
    let angles = frame.columns.iter();
    angles.filter_map(|column| unnamed_angle(column, joints))
}

/// Whether most positions go farther than joints do in radians: logs have one unit for all.
fn mostly_degrees(frame: &Frame, joints: &[GuessJoint]) -> bool {
    let farthest: Vec<f64> = farthest_angles(frame, joints).collect();
    let beyond = farthest.iter().filter(|farthest| **farthest > FARTHEST_RAD);
    2 * beyond.count() > farthest.len()
}
