//! From a box of drives to the first torque: the order in which things are tried, what each step needs to see, and what was
//! passed.
//!
//! A [`Step`] is tried in an ordinary run of the loop that is asked for nothing, no torque, one joint's torque or a small sine
//! ([`Step::task`]). A [`Watch`] looks at what the loop tells and gives a [`Verdict`] with the number that decided. A
//! [`Progress`] keeps what was passed, for one robot file and driver, and says what may come next. All three are pure: clock,
//! terminal and files are the caller's.
#![forbid(unsafe_code)]

mod moment;
mod progress;
mod step;
mod verdict;
mod watch;

pub use moment::{Eyes, Moment};
pub use progress::{Missing, Passed, Progress, fingerprint};
pub use step::{Stage, Step};
pub use verdict::{Finding, Verdict};
pub use watch::{Watch, small_sine, watch};
