//! Virtual moteus drives on a virtual robot: what a driver is written and tested against where there is no hardware.
//!
//! [`Bench`] is a robot whose joints are driven by moteus drives, on one or more CAN-FD buses with an fdcanusb adapter each.
//! Lines and instants go in, lines come out; there is no clock and no port in it. [`process`] puts each bus behind a
//! pseudo-terminal, where the maker's tools and any program of one's own find it.
//!
//! The drives keep the maker's register map in its four encodings, the diagnostic stream with configuration and telemetry,
//! the watchdog, faults and limits with their numbers, and position control with its scales, torques and limits. Behind each
//! is a joint of the emulated robot. What is not emulated is said at the head of each file. Everything was written from the
//! maker's documentation and firmware; its Python package and its Rust crate are what it is tested with.
//!
//! ```
//! use moteus_emulator::{Bench, Setup};
//!
//! let robot = robot::load("shd17")?;
//! let setup = Setup {
//!     initial_position_rad: vec![0.0],
//!     buses: 1,
//!     is_homed: true,
//!     seed: 1,
//!     faults: Vec::new(),
//! };
//! let mut bench = Bench::new(&robot, &setup)?;
//! bench.take_line(0, 0, b"can send 8001 1100"); // read the mode, in one byte
//! let mut answer = Vec::new();
//! bench.read(0, 0, &mut answer);
//! assert_eq!(answer, b"OK\r\nrcv 0100 210000\r\n");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod bench;
mod channels;
mod config;
mod controller;
mod diagnostic;
mod fault;
pub mod fdcanusb;
pub mod process;
mod pty;
mod registers;
mod servo;
mod telemetry;
mod trajectory;
mod tunnel;
mod value;

pub use bench::{Bench, BenchError, Setup};
pub use controller::{Controller, Homed};
pub use fault::{Fault, FaultError, FaultKind};
pub use servo::{Mode, Servo, code};
