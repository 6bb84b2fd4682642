//! What can be typed after `flexspline process`.

use clap::{Args, ValueEnum};

/// `flexspline process`
#[derive(Debug, Args)]
pub struct ProcessArguments {
    /// Which process
    #[arg(value_enum)]
    pub role: RoleArgument,
    /// Name of the instance it belongs to
    #[arg(long)]
    pub instance: String,
}

/// The processes of an instance, and the one that cleans up after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names say it; see the roles in shm-types")]
pub enum RoleArgument {
    Loop,
    Emulator,
    Estimator,
    Feedforward,
    Relay,
    Janitor,
}
