//! Rigid-body dynamics of a serial chain of revolute joints.
mod chain;

pub use chain::{Chain, ChainError, Link};
