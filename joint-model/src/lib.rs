//! Harmonic-drive joint physics and rigid-body dynamics: no clock, no I/O, no heap.
//!
//! SI units. `motor_` names the side before the gear, `link_` or `joint_` the side after it. Torques and
//! positions are positive about the joint's axis on both sides; a reversing gear is undone where data enters.
#![forbid(unsafe_code)]

pub mod filter;
pub mod friction;
pub mod rigid_body;
pub mod transmission;
pub mod velocity_filter;
pub mod velocity_observer;

/// The most joints a chain may have; every buffer in the workspace is sized by it.
pub const JOINTS_MAX: usize = 16;
