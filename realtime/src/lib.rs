//! Linux real-time calls behind safe functions.
//!
//! Everything asked of the kernel is read back, so that a report says what was granted and not what was wished.

pub mod clock;
pub mod cores;
pub mod grant;
pub mod process;
pub mod usage;
pub mod wait;
