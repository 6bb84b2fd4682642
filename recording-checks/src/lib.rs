//! What is wrong with a recording before anything is fitted: against its robot file, in single samples, and what is mended for it.
#![forbid(unsafe_code)]

mod commanded;
pub mod data;
mod exchanged;
mod follow;
pub mod found;
mod limit;
mod lost;
pub mod mend;
mod rigid;
pub mod samples;
pub mod timing;
pub mod units;
