//! From recordings to the physical effect that explains why a robot is not as its robot file says.
#![forbid(unsafe_code)]

pub mod baseline;
mod confuse;
pub mod control;
pub mod data;
pub mod diagnose;
mod elastic;
pub mod evidence;
pub mod explain;
pub mod fit;
mod follow;
pub mod hypothesis;
pub mod joint;
pub mod judge;
pub mod known;
pub mod load;
pub mod mend;
pub mod observe;
pub mod oracle;
pub mod place;
pub mod rank;
pub mod refine;
pub mod repeats;
pub mod report;
pub mod respond;
mod rounding;
pub mod samples;
pub mod scale;
pub mod search;
pub mod separate;
pub mod shapes;
pub mod shared;
pub mod simulate;
pub mod smooth;
pub mod spectrum;
pub mod stage;
pub mod step;
pub mod stretch;
mod tell;
pub mod trust;
pub mod twin;
mod vibration;
pub mod watch;
pub mod whiten;
mod whole_arm;

pub use diagnose::{DiagnoseError, Diagnosis, JointTraces, Progress, diagnose};
