//! One joint's torque, for chains that differ in the mass and inertia of their links only.
//!
//! What their links' motion is does not depend on what they weigh, so it is computed once for all of them; and the way back
//! from the tip ends at the joint. Torques are those of [`Chain::inverse_dynamics`] and [`Chain::gravity_torque`], bit by bit.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::inverse_dynamics::{LinkMotion, load};
use super::{Chain, assert_joints};
use crate::JOINTS_MAX;

/// How the links of a chain move at an instant, whatever they weigh.
#[derive(Clone, Debug, Default)]
pub struct Moving(ArrayVec<MovingLink, JOINTS_MAX>);

#[derive(Clone, Debug)]
struct MovingLink {
    rotation: Matrix3<f64>,
    field: Matrix3<f64>,
    origin_m_s2: Vector3<f64>,
}

/// How the links of a chain stand at an instant, whatever they weigh.
#[derive(Clone, Debug, Default)]
pub struct Standing(ArrayVec<StandingLink, JOINTS_MAX>);

#[derive(Clone, Debug)]
pub(super) struct StandingLink {
    /// From its frame to the parent's.
    pub(super) rotation: Matrix3<f64>,
    /// Gravity in its frame.
    gravity_m_s2: Vector3<f64>,
}

impl StandingLink {
    /// Torque that holds a first moment of mass against gravity: `-(h × g)·z`.
    #[inline]
    pub(super) fn holding_torque_nm(&self, h: &Vector3<f64>) -> f64 {
        h.y * self.gravity_m_s2.x - h.x * self.gravity_m_s2.y
    }
}

/// A first moment of mass about a joint, in the frame of its link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried(Vector3<f64>);

impl Chain {
    /// Whether another chain's links move as these do under the same joint motion, in the same gravity.
    pub fn moves_as(&self, other: &Self) -> bool {
        let bodies = self.bodies.iter().zip(&other.bodies);
        self.bodies.len() == other.bodies.len()
            && self.gravity_m_s2 == other.gravity_m_s2
            && bodies.clone().all(|(one, other)| one.is_where(other))
    }

    /// How the links move at this position, velocity and acceleration.
    pub fn links_moving(
        &self,
        position_rad: &[f64],
        velocity_rad_s: &[f64],
        acceleration_rad_s2: &[f64],
        moving: &mut Moving,
    ) {
        let given = [position_rad, velocity_rad_s, acceleration_rad_s2];
        assert_joints(self.joint_count(), &given.map(<[f64]>::len));
        moving.0.clear();
        let mut moved = LinkMotion::of_base(self);
        for (joint, body) in self.bodies.iter().enumerate() {
            let rotation = moved.on_to(body, given.map(|values| values[joint]));
            moving.0.push(MovingLink {
                rotation,
                field: moved.field,
                origin_m_s2: moved.origin_m_s2,
            });
        }
    }

    /// Torque of one joint where links move so, of this chain or of one that [moves as](Self::moves_as) it.
    pub fn moving_torque_nm(&self, joint: usize, moving: &Moving) -> f64 {
        let mut force_n = Vector3::zeros();
        let mut moment_nm = Vector3::zeros();
        let links = self.bodies.iter().zip(&moving.0).enumerate();
        for (index, (body, link)) in links.skip(joint).rev() {
            let (of_force_n, of_moment_nm) = load(&body.augmented, &link.field, &link.origin_m_s2);
            force_n += of_force_n;
            moment_nm += of_moment_nm;
            if index > joint {
                force_n = link.rotation * force_n;
                moment_nm = link.rotation * moment_nm + body.origin_m.cross(&force_n);
            }
        }
        moment_nm.z
    }

    /// How the links stand at this position.
    pub fn links_standing(&self, position_rad: &[f64], standing: &mut Standing) {
        assert_joints(self.joint_count(), &[position_rad.len()]);
        standing.0.clear();
        let mut gravity_m_s2 = self.gravity_m_s2;
        for (body, &angle_rad) in self.bodies.iter().zip(position_rad) {
            let rotation = body.rotation(angle_rad);
            gravity_m_s2 = rotation.tr_mul(&gravity_m_s2);
            standing.0.push(StandingLink {
                rotation,
                gravity_m_s2,
            });
        }
    }

    /// What a joint carries where links stand so: its own angle does not matter.
    pub fn carried(&self, joint: usize, standing: &Standing) -> Carried {
        let mut carried_kg_m = Vector3::zeros();
        let links = self.bodies.iter().zip(&standing.0).enumerate();
        for (index, (body, link)) in links.skip(joint).rev() {
            carried_kg_m += body.augmented.first_moment_kg_m;
            if index > joint {
                carried_kg_m = link.rotation * carried_kg_m;
            }
        }
        Carried(carried_kg_m)
    }
}

impl Standing {
    pub(super) fn links(&self) -> core::slice::Iter<'_, StandingLink> {
        self.0.iter()
    }

    /// Torque that holds what a joint carries.
    pub fn holding_torque_nm(&self, joint: usize, carried: &Carried) -> f64 {
        self.0[joint].holding_torque_nm(&carried.0)
    }
}
