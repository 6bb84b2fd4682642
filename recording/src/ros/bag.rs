//! What a bag's messages say about joints, brought together into one table.

use super::group::Group;
use super::message::{Kind, decode};
use super::wire::Encoding;
use crate::clock::UnitsPerSecond;
use crate::columns::{Known, TIME};
use crate::frame::{Column, Frame, Values};
use crate::{JOINTS_MAX, ReadProblem};
use std::collections::BTreeSet;

/// Sets of joints that come in messages of their own; a sender with more of them makes rows of nothing.
const GROUPS_MAX: usize = 64;

/// The topics of a bag and what was read of them.
#[derive(Default)]
pub(crate) struct Bag {
    topics: Vec<(String, Kind, Encoding)>,
    groups: Vec<Group>,
    /// Topic and type of all, for the error that finds no joints.
    seen: BTreeSet<String>,
    unreadable: u64,
    unstamped: u64,
    left_out: u64,
    pub(crate) truncated: bool,
}

impl Bag {
    /// A topic, to be told by the number that is handed over, if its messages are read at all.
    pub(crate) fn topic(
        &mut self,
        name: &str,
        kind: &str,
        encoding: Option<Encoding>,
    ) -> Option<usize> {
        self.seen.insert(format!("{name} ({kind})"));
        let (Some(known), Some(encoding)) = (Kind::of(kind), encoding) else {
            return None;
        };
        self.topics.push((name.to_owned(), known, encoding));
        Some(self.topics.len() - 1)
    }

    /// Takes a message of that topic, which was received at that time.
    pub(crate) fn add(
        &mut self,
        topic: usize,
        received_ns: i64,
        bytes: &[u8],
    ) -> Result<(), ReadProblem> {
        let (name, kind, encoding) = &self.topics[topic];
        let Some(told) = decode(*kind, bytes, *encoding) else {
            self.unreadable += 1;
            return Ok(());
        };
        if told.joints.len() > JOINTS_MAX {
            let joints = told.joints.len();
            return Err(ReadProblem::TooManyJoints { joints });
        }
        let start_ns = match told.stamp_ns {
            0 => {
                self.unstamped += 1;
                received_ns
            }
            stamp_ns => stamp_ns,
        };
        let same = |group: &Group| group.topic == *name && group.joints == told.joints;
        let index = match self.groups.iter().position(same) {
            Some(index) => index,
            None if self.groups.len() == GROUPS_MAX => {
                self.left_out += 1;
                return Ok(());
            }
            None => {
                let joints = told.joints.clone();
                self.groups.push(Group::new(name.clone(), *kind, joints));
                self.groups.len() - 1
            }
        };
        self.groups[index].add(start_ns, &told);
        Ok(())
    }

    /// The rows of the fastest topic that tells the joints' states, with all others at its times.
    pub(crate) fn into_frame(mut self) -> Result<Frame, ReadProblem> {
        let disordered = self
            .groups
            .iter_mut()
            .filter_map(|group| group.sort().then(|| group.topic.clone()));
        let disordered: BTreeSet<String> = disordered.collect();
        self.groups
            .retain(|group| !group.joints.is_empty() && !group.stamps_ns.is_empty());
        // States go before what a controller says of them, and that before what was planned; the fastest first.
        self.groups
            .sort_by_key(|group| (group.kind, std::cmp::Reverse(group.stamps_ns.len())));
        let states = self.groups.iter().filter(|group| group.kind.tells_states());
        let Some(base) = states.max_by_key(|group| (group.kind.is_state(), group.stamps_ns.len()))
        else {
            return Err(ReadProblem::NoJointStates {
                channels: self.seen.into_iter().collect(),
                not_decoded: self.unreadable,
            });
        };
        let mut frame = Frame {
            truncated: self.truncated,
            ..Frame::default()
        };
        let stamps = base.stamps_ns.iter().copied().map(Some).collect();
        frame.columns.push(Column {
            name: TIME.to_owned(),
            values: Values::Instants(stamps, UnitsPerSecond::NANOSECONDS),
        });
        let is_base = |group: &Group| std::ptr::eq(group, base);
        let in_order =
            std::iter::once(base).chain(self.groups.iter().filter(|group| !is_base(group)));
        let mut brought = Vec::new();
        for group in in_order {
            let times = (!is_base(group)).then_some(&base.stamps_ns[..]);
            if add_columns(&mut frame, group, times) && times.is_some() {
                brought.push(told_rate(group));
            }
        }
        let mut note = |key: &str, text: String| frame.notes.insert(key.to_owned(), text);
        note("rows_of", told_rate(base));
        if !brought.is_empty() {
            let text = format!(
                "{}, by straight lines between its messages",
                brought.join("; ")
            );
            note("brought_to_these_rows", text);
        }
        let effort = "the effort of ROS, torque at the joint, is read as joint_torque_nm; if a drive's torque was multiplied by \
                      the gear ratio to get it, map it to motor_torque_nm with one over the ratio as its scale";
        note("effort", effort.to_owned());
        if !disordered.is_empty() {
            note("sorted_by_stamp", Vec::from_iter(disordered).join(", "));
        }
        for (key, count) in [
            ("messages_without_a_stamp_timed_by_receipt", self.unstamped),
            ("messages_not_decoded", self.unreadable),
            ("messages_with_ever_other_joints_left_out", self.left_out),
        ] {
            if count > 0 {
                note(key, count.to_string());
            }
        }
        Ok(frame)
    }
}

fn told_rate(group: &Group) -> String {
    let rate = group
        .rate_hz()
        .map_or(String::new(), |rate_hz| format!(" at {rate_hz:.3} Hz"));
    format!("{}, {} messages{rate}", group.topic, group.messages)
}

/// Adds what a group tells, at the times of the rows or at its own; whether that is anything.
fn add_columns(frame: &mut Frame, group: &Group, times_ns: Option<&[i64]>) -> bool {
    let mut any = false;
    for (joint, name) in group.joints.iter().enumerate() {
        for (index, quantity) in group.kind.quantities().iter().enumerate() {
            let values = match times_ns {
                Some(times_ns) => group.column_at(times_ns, joint, index),
                None => group.column(joint, index),
            };
            let column_name = format!("{}/{name}/{}", group.topic, quantity.name());
            let taken = frame
                .columns
                .iter()
                .any(|column| column.name == column_name);
            if taken || values.iter().all(|value| value.is_nan()) {
                continue;
            }
            any = true;
            let column = frame.columns.len();
            frame.known.extend(quantity.signal().map(|signal| Known {
                column,
                joint: name.clone(),
                signal,
            }));
            frame.columns.push(Column {
                name: column_name,
                values: Values::Numbers(values),
            });
        }
    }
    any
}
