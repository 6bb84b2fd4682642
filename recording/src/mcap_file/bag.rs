//! MCAP files of ROS: the messages about joints, whatever else was recorded.

use super::damaged;
use super::records::{Next, Records};
use crate::ReadProblem;
use crate::ros::{Bag, Encoding, Kind};
use crate::writer::METADATA;
use mcap::records::Record;
use std::collections::HashMap;
use std::path::Path;

/// Whether an MCAP file is of ROS: what is announced first, a channel of its messages or a recording of ours, decides.
pub(crate) fn is_bag(path: &Path) -> Result<bool, ReadProblem> {
    let mut records = Records::open(path)?;
    let mut schemas = HashMap::new();
    loop {
        match records.next()? {
            Next::End { .. } => return Ok(false),
            Next::Record { record, .. } => match record {
                Record::Metadata(run) if run.name == METADATA => return Ok(false),
                Record::Schema { header, .. } => {
                    schemas.insert(header.id, header.name);
                }
                Record::Channel(channel) => {
                    let schema = schemas.get(&channel.schema_id);
                    let known = schema.is_some_and(|schema| Kind::of(schema).is_some());
                    if known && encoding(&channel.message_encoding).is_some() {
                        return Ok(true);
                    }
                }
                _ => {}
            },
        }
    }
}

/// Adds what an MCAP file's messages tell.
pub(crate) fn read_bag(path: &Path, bag: &mut Bag) -> Result<(), ReadProblem> {
    let mut records = Records::open(path)?;
    let mut schemas = HashMap::new();
    let mut topics: HashMap<u16, Option<usize>> = HashMap::new();
    loop {
        let (offset, record) = match records.next()? {
            Next::End { whole } => {
                bag.truncated |= !whole;
                return Ok(());
            }
            Next::Record { offset, record } => (offset, record),
        };
        match record {
            Record::Schema { header, .. } => {
                schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                topics.entry(channel.id).or_insert_with(|| {
                    let schema = schemas.get(&channel.schema_id).map_or("", String::as_str);
                    bag.topic(&channel.topic, schema, encoding(&channel.message_encoding))
                });
            }
            Record::Message { header, data } => {
                let topic = topics.get(&header.channel_id).ok_or_else(|| {
                    let channel = header.channel_id;
                    damaged(
                        offset,
                        format!("a message of an unknown channel, {channel}"),
                    )
                })?;
                if let Some(topic) = *topic {
                    let received_ns = i64::try_from(header.log_time).unwrap_or(i64::MAX);
                    bag.add(topic, received_ns, &data)?;
                }
            }
            _ => {}
        }
    }
}

fn encoding(name: &str) -> Option<Encoding> {
    match name {
        "cdr" => Some(Encoding::Cdr),
        "ros1" => Some(Encoding::Ros1),
        _ => None,
    }
}
