//! Messages put together into the rows they were written as.

use super::{EachRow, Record, damaged};
use crate::message::{CycleRow, Described, JointCycle, JointTruth, LoopCycle};
use crate::writer::{JOINT_PREFIX, TRUTH_PREFIX};
use crate::{JOINTS_MAX, ReadProblem};
use mcap::records::{Channel, MessageHeader};
use prost::Message;
use std::collections::{BTreeSet, HashMap};

/// Messages of one time and one sequence number are one row.
#[derive(Default)]
pub(super) struct Rows {
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, Role>,
    /// Topic and schema of every channel, for the error that finds no joints.
    channels_seen: BTreeSet<String>,
    joint_names: Vec<String>,
    row: Option<Row>,
    joints: Vec<JointCycle>,
    truth: Vec<Option<JointTruth>>,
    whole_truth: Vec<JointTruth>,
}

/// What a channel's messages are.
#[derive(Clone, Copy)]
enum Role {
    Loop,
    Joint(usize),
    Truth(usize),
    Foreign,
}

#[derive(Clone, Copy)]
struct Row {
    sequence: u32,
    time_ns: u64,
    loop_cycle: Option<LoopCycle>,
}

impl Rows {
    /// Joints the recorder announced, in its order.
    pub(super) fn expect_joints(&mut self, names: Option<&str>) -> Result<(), ReadProblem> {
        for name in names
            .unwrap_or_default()
            .split(',')
            .filter(|name| !name.is_empty())
        {
            self.joint(name)?;
        }
        Ok(())
    }

    pub(super) fn joint_names(&self) -> &[String] {
        &self.joint_names
    }

    pub(super) fn channels(&self) -> Vec<String> {
        self.channels_seen.iter().cloned().collect()
    }

    /// Takes the next record; hands the row before it over if this one begins another.
    pub(super) fn take(
        &mut self,
        offset: u64,
        record: Record<'_>,
        each: &mut EachRow<'_>,
    ) -> Result<(), ReadProblem> {
        match record {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => self.add_channel(channel)?,
            Record::Message { header, data } => {
                let role = *self.channels.get(&header.channel_id).ok_or_else(|| {
                    damaged(
                        offset,
                        format!("a message of an unknown channel, {}", header.channel_id),
                    )
                })?;
                self.add_message(&header, role, &data, each)?
                    .map_err(|error| damaged(offset, error))?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Hands the last row over.
    pub(super) fn finish(&mut self, each: &mut EachRow<'_>) -> Result<(), ReadProblem> {
        let Some(row) = self.row.take() else {
            return Ok(());
        };
        self.whole_truth.clear();
        self.whole_truth
            .extend(self.truth.iter().copied().flatten());
        let truth_is_whole = !self.truth.is_empty() && self.whole_truth.len() == self.truth.len();
        let cycle = row
            .loop_cycle
            .map_or(u64::from(row.sequence), |loop_cycle| loop_cycle.cycle);
        let handed_over = CycleRow {
            cycle,
            time_ns: row.time_ns,
            loop_cycle: row.loop_cycle.as_ref(),
            joints: &self.joints,
            truth: truth_is_whole.then_some(&self.whole_truth),
        };
        each(&handed_over, &self.joint_names)?;
        self.joints.fill(JointCycle::default());
        self.truth.fill(None);
        Ok(())
    }

    fn add_channel(&mut self, channel: Channel) -> Result<(), ReadProblem> {
        let schema = self
            .schemas
            .get(&channel.schema_id)
            .cloned()
            .unwrap_or_default();
        let topic = &channel.topic;
        let role = if channel.message_encoding != "protobuf" {
            Role::Foreign
        } else if schema == LoopCycle::SCHEMA {
            Role::Loop
        } else if let (JointTruth::SCHEMA, Some(joint)) =
            (schema.as_str(), topic.strip_prefix(TRUTH_PREFIX))
        {
            Role::Truth(self.joint(joint)?)
        } else if let (JointCycle::SCHEMA, Some(joint)) =
            (schema.as_str(), topic.strip_prefix(JOINT_PREFIX))
        {
            Role::Joint(self.joint(joint)?)
        } else {
            Role::Foreign
        };
        if let Role::Foreign = role {
            self.channels_seen.insert(format!("{topic} ({schema})"));
        }
        self.channels.insert(channel.id, role);
        Ok(())
    }

    fn joint(&mut self, name: &str) -> Result<usize, ReadProblem> {
        if let Some(known) = self.joint_names.iter().position(|known| known == name) {
            return Ok(known);
        }
        if self.joint_names.len() == JOINTS_MAX {
            return Err(ReadProblem::TooManyJoints {
                joints: JOINTS_MAX + 1,
            });
        }
        self.joint_names.push(name.to_owned());
        self.joints.push(JointCycle::default());
        self.truth.push(None);
        Ok(self.joint_names.len() - 1)
    }

    /// The outer error is of the row handed over, the inner one of this message.
    fn add_message(
        &mut self,
        header: &MessageHeader,
        role: Role,
        data: &[u8],
        each: &mut EachRow<'_>,
    ) -> Result<Result<(), prost::DecodeError>, ReadProblem> {
        if let Role::Foreign = role {
            return Ok(Ok(()));
        }
        let (sequence, time_ns) = (header.sequence, header.log_time);
        if self
            .row
            .is_some_and(|row| (row.sequence, row.time_ns) != (sequence, time_ns))
        {
            self.finish(each)?;
        }
        let row = self.row.get_or_insert(Row {
            sequence,
            time_ns,
            loop_cycle: None,
        });
        Ok(match role {
            Role::Loop => {
                LoopCycle::decode(data).map(|loop_cycle| row.loop_cycle = Some(loop_cycle))
            }
            Role::Joint(joint) => JointCycle::decode(data).map(|cycle| self.joints[joint] = cycle),
            Role::Truth(joint) => {
                JointTruth::decode(data).map(|truth| self.truth[joint] = Some(truth))
            }
            Role::Foreign => Ok(()),
        })
    }
}
