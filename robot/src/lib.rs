//! Robot files, effects and injection files: read, checked, turned into models.
//!
//! A robot is a TOML file: the nominal model of an arm and its drives. The keys are the public fields of [`RobotFile`],
//! [`LinkFile`] and [`RobotJoint`]; [`load`] takes a shipped robot's name or a path. Every error is one line that says
//! what is wrong, where, and what to change.
//!
//! ```
//! let robot = robot::load("pa10")?;
//! assert_eq!(robot.joints.len(), 7);
//! assert_eq!(robot.joint_index("joint4"), Some(3));
//! # Ok::<(), robot::RobotError>(())
//! ```
#![forbid(unsafe_code)]

mod apply;
mod bodies;
mod build;
mod check;
mod control;
mod description;
mod drive_fault;
pub mod effect;
mod error;
pub mod estimators;
mod file;
mod hold;
mod injection;
mod links;
mod mass;
mod mjcf;
mod model;
mod nominal;
mod parse;
pub mod published;
mod push;
mod robot;
mod starter;
mod survey;
mod table;
mod tolerance;
mod urdf;
mod write;
mod xml;

pub use apply::{Outcome, Simulator, SimulatorFile, reshaped_description};
pub use bodies::{Bodies, changed_chain};
pub use control::{Control, ControlKind, Feedback, Feedforward};
pub use drive_fault::{DriveFaultInjection, load_drive_faults};
pub use effect::{Effect, EffectKind, EncoderSide, LateSide, Part, Scope, Stage};
pub use error::{Place, RobotError, nearest};
pub use estimators::EstimatorParameters;
pub use file::{HoldingBrake, InertiaFile, LinkFile, LinkKind, RobotFile, RobotJoint};
pub use injection::{Injection, load_injection, parse_injection};
pub use links::{MassChange, Reshaping};
pub use parse::parse as parse_toml;
pub use published::published;
pub use push::{Push, load_pushes};
pub use robot::{Robot, Source, load, load_file, load_text, shipped};
pub use starter::starter;
pub use survey::{Survey, survey};
pub use table::{
    DirectionalFriction, FrictionTable, LoadTorqueRow, LoadTorqueTable, StribeckRow, TableOver,
    TorqueTable,
};
pub use tolerance::{DEFAULT_TOLERANCE, Tolerance};
pub use write::Written;
