//! From recordings to the physical effect that explains why a robot is not as its robot file says.
#![forbid(unsafe_code)]

pub mod baseline;
pub mod closed_loop;
pub mod diagnose;
pub mod effects;
pub mod engine;
pub mod evidence;
pub mod recorded_motion;
mod seen_steps;
pub mod separate;
pub mod watch;

pub use diagnose::{DiagnoseError, Diagnosis, JointTraces, Progress};
pub use engine::{Engine, Options, diagnose};
