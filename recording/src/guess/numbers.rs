//! Joints by their number: when `q1`, `q2` and so on may be taken for a robot's joints.
//!
//! A number tells a joint by custom only, so everything about it has to fit: the names are of one family, they count all of the
//! robot's joints and no more, or are its joints' own numbers, and no joint goes by its name instead. An arm's log has fingers, forces and wheels beside its joints,
//! and these are counted too.

use super::GuessJoint;
use super::names::{meaning_of, said};
use crate::Signal;
use crate::clock::time_column;
use crate::columns::TIME;
use crate::frame::Frame;
use crate::names::family;
use std::collections::{BTreeMap, BTreeSet};

/// The columns of a log by their families: what their names say beside the quantity and the number.
pub(super) struct Families<'a> {
    joints: &'a [GuessJoint],
    /// Of each column of the log, if its name says anything that is known.
    members: Vec<Option<Member>>,
    /// Members of one family and signal.
    groups: BTreeMap<(String, Signal), Group>,
    /// The family that the robot's joints are most likely of.
    main: Option<String>,
}

struct Member {
    column: String,
    /// `hand` of `q_hand1`, nothing of `q1` and `joint1_pos`.
    family: String,
    number: Option<usize>,
    signal: Signal,
    /// Its place among the robot's joints.
    joint: Option<usize>,
    by: By,
}

/// What tells a member's joint.
#[derive(Clone, Copy, PartialEq, Eq)]
enum By {
    Name,
    /// One that the robot's joints are called by.
    OwnNumber,
    Count,
}

#[derive(Default)]
struct Group {
    /// One whose number is beyond the robot's joints.
    beyond: Option<String>,
    /// One that has a joint's name and a number.
    named: Option<String>,
    /// One whose joint was counted.
    counted: Option<String>,
    joints: BTreeSet<usize>,
}

impl<'a> Families<'a> {
    pub(super) fn new(frame: &Frame, joints: &'a [GuessJoint]) -> Self {
        let is_time = |name: &str| name == TIME || time_column(name).is_some();
        let names = frame.columns.iter().map(|column| &*column.name);
        let members =
            names.map(|name| (!is_time(name)).then(|| Member::of(name, joints)).flatten());
        let mut families = Self {
            joints,
            members: members.collect(),
            groups: BTreeMap::new(),
            main: None,
        };
        families.count();
        families.main = families.likeliest();
        families
    }

    /// Finds the joints of numbers, and what each group has of them.
    fn count(&mut self) {
        let members = || self.members.iter().flatten();
        let from_zero = members().filter(|member| member.number == Some(0));
        let from_zero: BTreeSet<String> = from_zero.map(|member| member.family.clone()).collect();
        for member in self.members.iter_mut().flatten() {
            if member.joint.is_none()
                && let Some(number) = member.number
            {
                let from_zero = from_zero.contains(&member.family);
                (member.joint, member.by) = by_number(number, from_zero, self.joints);
            }
            let group = (member.family.clone(), member.signal);
            let group = self.groups.entry(group).or_default();
            group.joints.extend(member.joint);
            if member.number.is_some() {
                let example = match (member.by, member.joint) {
                    (_, None) => &mut group.beyond,
                    (By::Name, _) => &mut group.named,
                    (By::Count, _) => &mut group.counted,
                    (By::OwnNumber, _) => continue,
                };
                example.get_or_insert_with(|| member.column.clone());
            }
        }
    }

    /// The joint that a column is of, and whether only by its number.
    pub(super) fn joint(&self, column: usize) -> Option<(&'a GuessJoint, bool)> {
        let member = self.member(column)?;
        Some((self.joints.get(member.joint?)?, member.by != By::Name))
    }

    /// Where a column stands among several for one signal: by name, of the likeliest family, of another.
    pub(super) fn rank(&self, column: usize) -> u8 {
        match self.member(column) {
            Some(member) if member.by == By::Name => 0,
            Some(member) if Some(&member.family) == self.main.as_ref() => 1,
            Some(_) => 2,
            // The format says what it is.
            None => 0,
        }
    }

    /// Whether two columns are of one family.
    pub(super) fn are_alike(&self, column: usize, other: usize) -> bool {
        let family = |column| self.member(column).map(|member| &member.family);
        family(column) == family(other)
    }

    /// What keeps a column from being its joint's.
    pub(super) fn doubt(&self, column: usize) -> Option<String> {
        let member = self.member(column)?;
        if member.by == By::Name {
            // `joint0_pos` beside `joint1_pos`: the log counts from 0, the robot from 1, and names shift by one.
            let counted = self.group(member)?.counted.as_ref()?;
            let is_numbered = member.number.is_some();
            return is_numbered.then(|| format!("while `{counted}` is counted"));
        }
        self.misfit(member).or_else(|| {
            // A temperature is called after the part of the drive that has it, as `mos_temperature`; no other limb is meant.
            if member.signal == Signal::TemperatureC {
                return None;
            }
            let main = self.main.as_ref().filter(|main| **main != member.family)?;
            let of_main = |other: &&Member| other.family == *main && other.number.is_some();
            let like = self.members.iter().flatten().find(of_main)?;
            Some(format!("named otherwise than `{}`", like.column))
        })
    }

    /// What keeps the numbers of a member's group from being those of the robot's joints.
    fn misfit(&self, member: &Member) -> Option<String> {
        let group = self.group(member)?;
        if let Some(beyond) = &group.beyond {
            return Some(format!("which go on to `{beyond}`, beyond the robot's"));
        }
        // Numbers that the robot's joints have themselves need not be all: its gripper is in few logs.
        let (found, count) = (group.joints.len(), self.joints.len());
        if found < count && member.by == By::Count {
            return Some(format!("of which it has {found} of the robot's {count}"));
        }
        let other_name = || {
            let is_named = |other: &&Member| other.by == By::Name && other.family != member.family;
            let other = self.members.iter().flatten().find(is_named)?;
            Some(&other.column)
        };
        let named = match (member.by, &group.named) {
            // `tau_2` beside `arm_joint2_pos` is that joint's: the number is the robot's own, and the name says nothing else.
            (By::OwnNumber, _) if member.family.is_empty() => None,
            (By::Count, Some(named)) => Some(named),
            _ => other_name(),
        };
        named.map(|named| format!("while `{named}` has a joint's name"))
    }

    /// One that has positions first, as they are what a joint's other signals go with; then the plainest, which is what was
    /// measured. Where none fits, the one with most columns is what the user is asked about.
    fn likeliest(&self) -> Option<String> {
        let mut families: BTreeMap<&String, (BTreeSet<Signal>, usize)> = BTreeMap::new();
        for member in self.members.iter().flatten() {
            if member.by != By::Name && member.joint.is_some() {
                let (fitting, columns) = families.entry(&member.family).or_default();
                *columns += 1;
                if !fitting.contains(&member.signal) && self.misfit(member).is_none() {
                    fitting.insert(member.signal);
                }
            }
        }
        let has_position = |fitting: &BTreeSet<Signal>| {
            fitting.contains(&Signal::LinkPositionRad)
                || fitting.contains(&Signal::MotorPositionRad)
        };
        let likeliest = families
            .into_iter()
            .max_by_key(|(family, (fitting, columns))| {
                let plain = family.is_empty() && !fitting.is_empty();
                (
                    has_position(fitting),
                    !fitting.is_empty(),
                    plain,
                    fitting.len(),
                    *columns,
                )
            });
        likeliest.map(|(family, _)| family.clone())
    }

    fn group(&self, member: &Member) -> Option<&Group> {
        self.groups.get(&(member.family.clone(), member.signal))
    }

    fn member(&self, column: usize) -> Option<&Member> {
        self.members.get(column)?.as_ref()
    }
}

impl Member {
    fn of(name: &str, joints: &[GuessJoint]) -> Option<Self> {
        let said = said(name, joints)?;
        let rest = meaning_of(name, joints)?.rest;
        let joint = said.joint.or_else(|| named(&said.meaning.rest, joints));
        let is_it = |other: &GuessJoint| joint.is_some_and(|joint| joint.name == other.name);
        Some(Self {
            column: name.to_owned(),
            family: family(&rest),
            number: rest.last().and_then(|word| number_behind(word)),
            signal: said.meaning.signal().0,
            joint: joints.iter().position(is_it),
            by: if joint.is_some() { By::Name } else { By::Count },
        })
    }
}

/// The joint whose name the rest of a column's is; of a robot with one joint, also where nothing is left.
fn named<'a>(rest: &[String], joints: &'a [GuessJoint]) -> Option<&'a GuessJoint> {
    let plain = |text: &str| -> String {
        let kept = text.chars().filter(|c| c.is_alphanumeric());
        kept.flat_map(char::to_lowercase).collect()
    };
    let name = rest.concat();
    let is_named = |joint: &&GuessJoint| plain(&joint.name) == name;
    joints.iter().find(is_named).or(match joints {
        [joint] if name.is_empty() => Some(joint),
        _ => None,
    })
}

/// The joint of a number. The robot's own numbers go before counting, where both begin at 0 or neither does.
fn by_number(number: usize, from_zero: bool, joints: &[GuessJoint]) -> (Option<usize>, By) {
    let own = |number| {
        let is_own = |joint: &GuessJoint| number_behind(&joint.name) == Some(number);
        joints.iter().position(is_own)
    };
    if let Some(joint) = own(number).filter(|_| from_zero == own(0).is_some()) {
        return (Some(joint), By::OwnNumber);
    }
    let place = number.checked_sub(usize::from(!from_zero));
    (place.filter(|place| *place < joints.len()), By::Count)
}

/// The number that a name ends with.
fn number_behind(name: &str) -> Option<usize> {
    let start = name.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    name[start..].parse().ok()
}
