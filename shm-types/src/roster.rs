//! Who belongs to a running instance: written by its supervisor whenever that changes, for those who look on.

use serde::{Deserialize, Serialize};

use crate::instance::{Instance, InstanceError};

/// File of the roster in the instance's directory.
const ROSTER_FILE: &str = "processes.json";

/// One process of an instance.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Member {
    /// What it is, by name.
    pub role: String,
    /// Its process id.
    pub process_id: u32,
    /// Monotonic clock when it was started.
    pub started_at_ns: u64,
    /// How often its role was started again during the run.
    pub restarts: u64,
    /// How its predecessor ended.
    pub last_end: Option<String>,
}

/// Writes the members of the instance.
///
/// # Errors
/// [`InstanceError::File`].
pub fn write(instance: &Instance, members: &[Member]) -> Result<(), InstanceError> {
    instance.write_report(ROSTER_FILE, members)
}

/// Reads the members of the instance.
///
/// # Errors
/// [`InstanceError::File`] where nothing runs, [`InstanceError::RunConfig`] where the file is not ours.
pub fn read(instance: &Instance) -> Result<Vec<Member>, InstanceError> {
    instance.read_report(ROSTER_FILE)
}
