//! From recordings to the physical effect that explains why a robot is not as its robot file says.
#![forbid(unsafe_code)]

pub mod baseline;
pub mod closed_loop;
pub mod control;
pub mod data;
pub mod diagnose;
mod elastic;
pub mod engine;
mod exchanged;
pub mod fit;
mod follow;
pub mod found;
pub mod hypothesis;
pub mod joint;
pub mod judge;
pub mod known;
mod links;
pub mod load;
mod lost;
#[cfg(test)]
mod made_up;
pub mod mend;
pub mod observe;
mod on_all_cores;
pub mod regression;
mod remembered;
pub mod repeats;
pub mod report;
pub mod respond;
mod rigid;
mod rounding;
mod runs;
pub mod samples;
pub mod scale;
pub mod search;
pub mod separate;
pub mod simulate;
pub mod smooth;
pub mod spectrum;
pub mod stage;
pub mod stretch;
mod timing;
pub mod twin;
mod units;
mod vibration;
pub mod watch;
mod waves;
pub mod whiten;
mod whole_arm;

pub use diagnose::{DiagnoseError, Diagnosis, JointTraces, Progress};
pub use engine::{Engine, Options, diagnose};
