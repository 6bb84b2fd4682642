//! The control loop: one cycle as a pure function, and the process around it.
//!
//! [`cycle`] decides, [`limits`] checks what was decided, [`driver`] is the contract with the hardware,
//! [`statistics`] counts. None of them reads a clock, allocates or waits. [`process`] owns clock, shared memory and
//! driver, and is the only part that does.
#![forbid(unsafe_code)]

pub mod attribution;
pub mod cycle;
pub mod driver;
pub mod emulator_driver;
pub mod limits;
pub mod process;
pub mod report;
pub mod statistics;
