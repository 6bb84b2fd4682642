//! Fits of the joint model to recordings: friction, position-dependent friction, gravity, stiffness.
#![forbid(unsafe_code)]

mod error;
pub mod experiment;
mod floor;
pub mod friction;
pub mod gravity;
pub mod held_out;
mod loaded_arm;
pub mod periodic;
mod statistics;
mod steady_motion;
pub mod stiffness;
mod sweep_pose;

pub use error::IdentificationError;
pub use loaded_arm::{PAYLOAD_CENTRE_KEY, PAYLOAD_KEY, Payload, Sweep};
pub use statistics::Estimate;
