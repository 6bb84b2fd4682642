//! Fits of the joint model to recordings: friction, position-dependent friction, gravity, stiffness.
#![forbid(unsafe_code)]

mod error;
pub mod experiment;
pub mod friction;
pub mod gravity;
mod loaded_arm;
pub mod periodic;
mod slow_motion;
mod statistics;
pub mod stiffness;

pub use error::IdentificationError;
pub use statistics::Estimate;
