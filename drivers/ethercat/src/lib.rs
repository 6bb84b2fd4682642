//! The driver for CiA 402 drives on EtherCAT: cyclic torque, velocity, and position with torque offset.
//!
//! [`ETHERCAT`] is what `--driver ethercat` chooses. [`settings`] has the keys of the robot file, [`setup`] what is asked of
//! drives before anything moves, [`driver`] the cycle. [`walk`], [`units`], [`image`] and [`pace`] are pure.

pub mod client;
pub mod driver;
pub mod frames;
pub mod image;
pub mod master;
pub mod pace;
pub mod settings;
pub mod setup;
pub mod units;
pub mod walk;

pub use driver::{ETHERCAT, EthercatDriver};
