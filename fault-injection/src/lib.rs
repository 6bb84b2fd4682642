//! Faults between the control loop, its drives and its services, and what the loop does about them.
//!
//! [`drive::FaultyDriver`] puts faults between the loop and any [`rt_loop::driver::Driver`]; [`service::FaultyService`] puts
//! them between the loop and its controller. [`mod@bench`] is the loop with both around it in virtual time: the same cores and drivers
//! as in a run on virtual drives, no clock, so that every figure can be remade. [`pulls`] pulls cables out of it. [`scenarios`] is the list, with the state each fault has to end in.
//!
//! ```
//! use fault_injection::{bench::Bench, scenarios};
//! use virtual_drives::Kind;
//!
//! let bench = Bench::new("shd17", Kind::Emulator)?;
//! let scenario = scenarios::all().into_iter().find(|scenario| scenario.name == "frame lost, once");
//! let outcome = bench.run(&scenario.expect("it is on the list"))?;
//! assert_eq!(outcome.end_state, "Running");
//! # Ok::<(), fault_injection::bench::BenchError>(())
//! ```
#![forbid(unsafe_code)]

pub mod bench;
pub mod drive;
pub mod outcome;
pub mod pulls;
pub mod scenarios;
pub mod service;

/// When a fault is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First cycle.
    pub from: u64,
    /// How many cycles it lasts.
    pub cycles: u64,
    /// Only every so many of them; 1 is each.
    pub every: u64,
}

impl Window {
    /// Whether the fault is there in `cycle`.
    pub fn holds(&self, cycle: u64) -> bool {
        cycle
            .checked_sub(self.from)
            .is_some_and(|since| since < self.cycles && since.is_multiple_of(self.every))
    }
}
