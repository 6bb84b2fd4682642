//! Rigid-body dynamics of links in a row or in a tree on a fixed base, on joints that turn or slide.
//!
//! ```
//! use joint_model::rigid_body::{Chain, JointKind, Link};
//! use nalgebra::{Isometry3, Matrix3, Vector3};
//!
//! let pendulum = Link {
//!     parent: None,
//!     kind: JointKind::Revolute,
//!     origin: Isometry3::identity(),
//!     axis: Vector3::y_axis(),
//!     mass_kg: 2.0,
//!     centre_of_mass_m: Vector3::new(0.5, 0.0, 0.0),
//!     inertia_kg_m2: Matrix3::from_diagonal(&Vector3::new(0.001, 0.02, 0.02)),
//! };
//! let chain = Chain::new(&[pendulum], Vector3::new(0.0, 0.0, -9.81), Isometry3::identity())?;
//! let mut torque_nm = [0.0];
//! chain.gravity_torque(&[0.0], &mut torque_nm);
//! // Turning about y lowers a weight that lies towards x, so the joint pulls the other way.
//! assert!((torque_nm[0] + 2.0 * 9.81 * 0.5).abs() < 1e-12);
//! # Ok::<(), joint_model::rigid_body::ChainError>(())
//! ```
//!
//! One algorithm, one file; all of them run on the precomputed bodies of `body.rs`, whose joint axes are z.
//! Nothing here allocates but building a chain. Every function reads as many elements of its slices as there are joints and
//! panics where a slice is shorter, because a shorter one is a programming error, not an input.
mod body;
mod chain;
mod forward_dynamics;
mod gravity;
mod inverse_dynamics;
mod kinematics;
mod one_joint;
mod published_gravity;
mod symmetric;

pub use chain::{
    Chain, ChainError, JointKind, LINKS_MAX, Link, is_inertia_of_a_body, nearest_inertia_of_a_body,
};
pub use one_joint::{Carried, Moving, Standing};
pub use published_gravity::PublishedGravity;

/// Panics when a slice of joint values is shorter than the chain.
fn assert_joints(joint_count: usize, lengths: &[usize]) {
    assert!(
        lengths.iter().all(|&length| length >= joint_count),
        "a chain of {joint_count} joints was given slices of {lengths:?} values"
    );
}
