//! The control loop: one cycle as a pure function, and the process around it.
//!
//! [`cycle`] decides: what came is checked ([`admission`]) and sorted into an event, the [`state_machine`] says which state
//! follows, [`sending`] makes of it what the drives get, within the [`limits`]. [`driver`] is the contract with the hardware,
//! [`statistics`] counts. None of them reads a clock, allocates or waits. [`process`] owns clock, shared memory and
//! driver, and with [`lockstep`], [`accounts`] and [`steal_watch`] is the only part that does.
#![forbid(unsafe_code)]
#![cfg_attr(rtsan, feature(sanitize))]

pub mod accounts;
pub mod admission;
pub mod attribution;
pub mod capabilities;
pub mod clock_follow;
pub mod config;
pub mod cycle;
pub mod driver;
pub mod emulator_driver;
pub mod fault;
pub mod joint_motion;
pub mod last_cycles;
pub mod limits;
pub mod lockstep;
pub mod motion_clock;
pub mod process;
pub mod reference_watch;
pub mod report;
pub mod sending;
pub mod state_machine;
pub mod statistics;
pub mod status;
pub mod steal_watch;
pub mod supervision;
