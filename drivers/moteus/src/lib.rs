//! The driver for moteus drives on CAN-FD, each bus behind an fdcanusb adapter.
//!
//! [`MOTEUS`] is what `--driver moteus` chooses. Frames and lines are made and read by the maker's crate `moteus-protocol`,
//! which allocates nothing. Its crate `moteus` is not used: its transports make a `String` of every line and wait with
//! time-outs of their own, and the loop's thread may do neither. The port is therefore this crate's own; [`host`] is all it knows
//! of the system.
//!
//! `settings` has the keys of the robot file, `setup` what is asked of the drives before anything moves, `driver` the
//! cycle. `wire`, `units` and `capacity` are pure.
#![forbid(unsafe_code)]

mod capacity;
mod driver;
pub mod host;
mod port;
mod settings;
mod setup;
mod units;
mod wire;

pub use driver::{MOTEUS, MoteusDriver};
