//! Messages and topics of the control loop over shared memory.
//!
//! [`messages`] are plain data of fixed layout, [`drive`] is the part of them that tells how drives are, [`topics`] name who may write and read them, [`instance`] is the
//! directory one running robot owns, [`bus`] is how a process joins it, [`roster`] lists those who have. No control logic lives here.

pub mod bus;
pub mod control_options;
pub mod drive;
pub mod instance;
pub mod messages;
pub mod roster;
pub mod topics;

/// The most joints a message carries.
pub const JOINTS_MAX: usize = 16;
