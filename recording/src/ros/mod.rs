//! Messages of ROS, read as far as they tell about joints.

mod bag;
mod group;
mod message;
mod wire;

pub(crate) use bag::Bag;
pub(crate) use message::Kind;
pub(crate) use wire::Encoding;
