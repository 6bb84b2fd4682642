//! From recordings to the physical effect that explains why a robot is not as its robot file says.
#![forbid(unsafe_code)]

pub mod control;
pub mod data;
pub mod diagnose;
pub mod evidence;
pub mod explain;
pub mod fit;
pub mod hypothesis;
pub mod joint;
pub mod judge;
pub mod known;
pub mod load;
pub mod observe;
pub mod place;
pub mod report;
pub mod samples;
pub mod search;
pub mod separate;
pub mod shared;
pub mod simulate;
pub mod smooth;
pub mod spectrum;
pub mod stretch;
pub mod twin;
pub mod watch;
pub mod whiten;

pub use diagnose::{DiagnoseError, Diagnosis, JointTraces, Progress, diagnose};
