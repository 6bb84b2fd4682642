//! What is looked at before anything is explained: whether recordings are what the robot file says, what single samples show by
//! themselves, and what is mended for it.

mod commanded;
pub mod data;
mod exchanged;
mod follow;
pub mod found;
mod lost;
pub mod mend;
mod rigid;
pub mod samples;
pub(crate) mod timing;
mod units;
