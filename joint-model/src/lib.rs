//! Harmonic-drive joint physics and rigid-body dynamics: no clock, no I/O, no heap after start.
//!
//! SI units. `motor_` names the side before the gear, `link_` or `joint_` the side after it. Torques and
//! positions are positive about the joint's axis on both sides; a reversing gear is undone where data enters.
#![forbid(unsafe_code)]

pub mod filter;
pub mod friction;
pub mod harmonic;
pub mod joint_spring;
pub mod rigid_body;
pub mod torque_table;
pub mod transmission;
pub mod velocity_filter;
pub mod velocity_observer;

/// The most joints that the loop, the plant and the estimators take; their buffers are sized by it.
/// A chain may have more: [`rigid_body::LINKS_MAX`].
pub const JOINTS_MAX: usize = 16;
