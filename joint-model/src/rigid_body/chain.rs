//! The chain: its links, joint frames, gravity and tool.

use arrayvec::ArrayVec;
use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

use crate::JOINTS_MAX;

/// One moving link and the revolute joint that carries it.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// The joint frame in the parent link's frame (in the base frame for the first link), at joint angle zero.
    pub origin: Isometry3<f64>,
    /// The joint's axis in the joint frame.
    pub axis: Unit<Vector3<f64>>,
    /// Mass of the link.
    pub mass_kg: f64,
    /// Centre of mass in the joint frame.
    pub centre_of_mass_m: Vector3<f64>,
    /// Inertia about the centre of mass, in axes parallel to the joint frame.
    pub inertia_kg_m2: Matrix3<f64>,
}

/// Why a chain cannot be built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChainError {
    /// No links at all, or more than [`JOINTS_MAX`].
    JointCount {
        /// Links given.
        found: usize,
    },
    /// A mass is negative or not finite.
    Mass {
        /// Index of the link.
        link: usize,
        /// The value found.
        mass_kg: f64,
    },
    /// An inertia is not symmetric positive semidefinite, or violates the triangle inequality.
    Inertia {
        /// Index of the link.
        link: usize,
    },
}

/// A serial chain of revolute joints on a fixed base.
#[derive(Clone, Debug)]
pub struct Chain {
    pub(crate) links: ArrayVec<Link, JOINTS_MAX>,
    pub(crate) gravity_m_s2: Vector3<f64>,
    pub(crate) tool: Isometry3<f64>,
}

impl Chain {
    /// Builds a chain. `tool` is the tool frame in the last link's frame.
    ///
    /// # Errors
    /// [`ChainError`], naming the link.
    pub fn new(_links: &[Link], _gravity_m_s2: Vector3<f64>, _tool: Isometry3<f64>) -> Result<Self, ChainError> {
        todo!()
    }

    /// Number of joints, 1 to [`JOINTS_MAX`].
    pub fn joint_count(&self) -> usize {
        self.links.len()
    }

    /// The links, base to tip.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Joint torque that produces `acceleration_rad_s2` at this position and velocity, gravity included
    /// (recursive Newton-Euler, Featherstone 2008, Table 5.1).
    pub fn inverse_dynamics(
        &self,
        _position_rad: &[f64],
        _velocity_rad_s: &[f64],
        _acceleration_rad_s2: &[f64],
        _torque_nm: &mut [f64],
    ) {
        todo!()
    }

    /// Joint torque that holds the chain still against gravity.
    pub fn gravity_torque(&self, _position_rad: &[f64], _torque_nm: &mut [f64]) {
        todo!()
    }

    /// Joint acceleration under `torque_nm` (articulated-body algorithm, Featherstone 2008, Table 7.1).
    pub fn forward_dynamics(
        &self,
        _position_rad: &[f64],
        _velocity_rad_s: &[f64],
        _torque_nm: &[f64],
        _acceleration_rad_s2: &mut [f64],
    ) {
        todo!()
    }

    /// The tool frame in the base frame.
    pub fn tool_pose(&self, _position_rad: &[f64]) -> Isometry3<f64> {
        todo!()
    }

    /// Gravitational potential energy, zero with every centre of mass at the base origin's height.
    pub fn potential_energy_j(&self, _position_rad: &[f64]) -> f64 {
        todo!()
    }
}
