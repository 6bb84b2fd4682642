//! The processes beside the loop: torque estimator, feedforward controller, relay.
//!
//! Each is a pure core ([`feedforward`], [`estimators`], [`relay`], [`tracking`]) that turns messages into messages,
//! and a thin process around it that owns shared memory and clock.
#![forbid(unsafe_code)]
#![cfg_attr(rtsan, feature(sanitize))]

pub mod answering;
pub mod by_hand;
pub mod compensation;
pub mod controller;
pub mod correction;
pub mod estimator_process;
pub mod estimators;
pub mod feedforward;
pub mod feedforward_process;
pub mod friction;
pub mod reference;
pub mod relay;
pub mod relay_process;
pub mod torsion_load;
pub mod tracking;
pub mod velocity_control;
