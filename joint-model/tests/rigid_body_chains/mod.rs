//! The chains of `rigid_body_reference.json`, shared by the tests and the bench of the rigid-body dynamics.
#![allow(dead_code, reason = "each test reads a part of it")]

use std::sync::LazyLock;

use joint_model::rigid_body::{Chain, JointKind, Link};
use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use serde::Deserialize;

#[derive(Deserialize)]
pub struct Reference {
    /// One of each length, joint after joint.
    pub chains: Vec<ReferenceChain>,
    /// Joints that turn and slide, on any link before them.
    pub trees: Vec<ReferenceChain>,
}

#[derive(Deserialize)]
pub struct ReferenceChain {
    gravity_m_s2: [f64; 3],
    tool: Frame,
    links: Vec<ReferenceLink>,
    pub states: Vec<State>,
}

#[derive(Deserialize)]
struct ReferenceLink {
    /// Where it is not the link before; -1 for the base.
    parent: Option<isize>,
    #[serde(default)]
    slides: bool,
    origin: Frame,
    axis: [f64; 3],
    mass_kg: f64,
    centre_of_mass_m: [f64; 3],
    inertia_kg_m2: [[f64; 3]; 3],
}

#[derive(Clone, Copy, Deserialize)]
pub struct Frame {
    translation_m: [f64; 3],
    quaternion_xyzw: [f64; 4],
}

/// A random state and what Pinocchio computes for it.
#[derive(Deserialize)]
pub struct State {
    pub position_rad: Vec<f64>,
    pub velocity_rad_s: Vec<f64>,
    pub acceleration_rad_s2: Vec<f64>,
    pub inverse_dynamics_nm: Vec<f64>,
    pub gravity_torque_nm: Vec<f64>,
    pub applied_torque_nm: Vec<f64>,
    pub forward_dynamics_rad_s2: Vec<f64>,
    pub potential_energy_j: f64,
    pub last_joint_frame: Frame,
    pub tool_pose: Frame,
}

pub static REFERENCE: LazyLock<Reference> = LazyLock::new(|| {
    serde_json::from_str(include_str!("../rigid_body_reference.json"))
        .expect("the committed reference parses")
});

/// The reference chain of `joint_count` joints and its states.
pub fn reference_chain(joint_count: usize) -> (Chain, &'static [State]) {
    let chain = &REFERENCE.chains[joint_count - 1];
    (chain.build(), &chain.states)
}

impl ReferenceChain {
    pub fn build(&self) -> Chain {
        let links = self.links.iter().enumerate();
        let links: Vec<Link> = links.map(|(index, link)| link.link(index)).collect();
        Chain::new(&links, self.gravity_m_s2.into(), self.tool.isometry())
            .expect("the reference chains are valid")
    }
}

impl ReferenceLink {
    fn link(&self, index: usize) -> Link {
        Link {
            parent: match self.parent {
                Some(parent) => usize::try_from(parent).ok(),
                None => Link::serial(index),
            },
            kind: match self.slides {
                true => JointKind::Prismatic,
                false => JointKind::Revolute,
            },
            origin: self.origin.isometry(),
            axis: Unit::new_normalize(Vector3::from(self.axis)),
            mass_kg: self.mass_kg,
            centre_of_mass_m: self.centre_of_mass_m.into(),
            inertia_kg_m2: Matrix3::from(self.inertia_kg_m2).transpose(),
        }
    }
}

impl Frame {
    pub fn isometry(&self) -> Isometry3<f64> {
        let [x, y, z, w] = self.quaternion_xyzw;
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        Isometry3::from_parts(Translation3::from(self.translation_m), rotation)
    }
}
