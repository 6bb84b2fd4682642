//! Reference trajectories and the PA-10's inverse kinematics.
//!
//! A [`Trajectory`] gives every joint's position, velocity and acceleration as a pure function of time: no clock, no
//! heap, no panic in [`Trajectory::sample`]. [`load`] takes one of the [`NAMES`] (sensible defaults for any robot), a
//! TOML file ([`TrajectoryFile`]) or a CSV file of waypoints (`time_s`, `JOINT.reference_position_rad`), and checks the
//! robot's limits over the whole of it. [`Trajectory::sampled`] follows the reference of a recording.
//!
//! ```
//! let robot = robot::load("pa10")?;
//! let trajectory = motion::load("lemniscate", &robot)?;
//! let mut reference = motion::Reference::default();
//! trajectory.sample(1.5, &mut reference);
//! assert_eq!(reference.position_rad[2], 0.0); // joint 3 stays locked
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod defaults;
mod entry;
mod error;
mod even_waypoints;
mod file;
mod joint_motion;
mod kinematics;
mod lemniscate;
mod multi_sine;
mod soft_start;
mod spline;
mod trajectory;
mod trapezoid;
mod waypoints;

pub use defaults::{default_name, home_rad, swing_rad};
pub use entry::{HoldEntry, JointEntry, MultiSineEntry, SineEntry, TrapezoidEntry, WaypointsEntry};
pub use error::MotionError;
pub use file::{NAMES, TrajectoryFile, TrajectoryKind, load};
pub use kinematics::PaTenArm;
pub use lemniscate::{LEMNISCATE_PERIOD_S, lemniscate_pose};
pub use trajectory::{Reference, Trajectory};
pub use waypoints::{SampledJoint, SampledReference};
