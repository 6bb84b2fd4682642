//! One joint's torque, for chains that differ in the mass and inertia of their links only.
//!
//! What their links' motion is does not depend on what they weigh, so it is computed once for all of them; and the way back
//! from the tips ends at the joint. Torques are those of [`Chain::inverse_dynamics`] and [`Chain::gravity_torque`], bit by bit.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::body::Body;
use super::chain::LINKS_MAX;
use super::inverse_dynamics::{LinkMotion, along_joint, load};
use super::{Chain, assert_joints};

/// How the links of a chain move at an instant, whatever they weigh.
#[derive(Clone, Debug, Default)]
pub struct Moving(ArrayVec<MovingLink, LINKS_MAX>);

#[derive(Clone, Debug)]
struct MovingLink {
    /// From its frame to the parent's.
    rotation: Matrix3<f64>,
    /// Its origin in the parent's frame.
    origin_m: Vector3<f64>,
    field: Matrix3<f64>,
    origin_m_s2: Vector3<f64>,
}

/// How the links of a chain stand at an instant, whatever they weigh.
#[derive(Clone, Debug, Default)]
pub struct Standing(ArrayVec<StandingLink, LINKS_MAX>);

#[derive(Clone, Debug)]
pub(super) struct StandingLink {
    /// From its frame to the parent's.
    rotation: Matrix3<f64>,
    /// Its origin in the parent's frame.
    origin_m: Vector3<f64>,
    /// Gravity in its frame.
    gravity_m_s2: Vector3<f64>,
    slides: bool,
}

impl StandingLink {
    /// Torque that holds what the joint carries against gravity: `-(h × g)·z`, or the force `-m g·z`.
    #[inline]
    pub(super) fn holding_torque_nm(&self, carried: &Carried) -> f64 {
        if self.slides {
            return -carried.mass_kg * self.gravity_m_s2.z;
        }
        let h = &carried.first_moment_kg_m;
        h.y * self.gravity_m_s2.x - h.x * self.gravity_m_s2.y
    }

    /// First moment about the parent's origin of what this link carries, but for the mass that the parent's augmented link
    /// counts at this one's origin.
    #[inline]
    pub(super) fn passed_on_kg_m(&self, body: &Body, h: &Vector3<f64>) -> Vector3<f64> {
        let passed_kg_m = self.rotation * h;
        if body.left_out_kg == 0.0 {
            return passed_kg_m;
        }
        passed_kg_m + body.left_out_kg * self.origin_m
    }
}

/// What a joint carries, as gravity acts on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// First moment about the joint, in the frame of its link.
    pub(super) first_moment_kg_m: Vector3<f64>,
    pub(super) mass_kg: f64,
}

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
        let mut motions: ArrayVec<LinkMotion, LINKS_MAX> = ArrayVec::new();
        for (joint, body) in self.bodies.iter().enumerate() {
            let parent = body.parent.map(|parent| motions[parent]);
            let mut moved = parent.unwrap_or(LinkMotion::of_base(self));
            let rotation = moved.on_to(body, given.map(|values| values[joint]));
            motions.push(moved);
            moving.0.push(MovingLink {
                rotation,
                origin_m: body.origin_m(position_rad[joint]),
                field: moved.field,
                origin_m_s2: moved.origin_m_s2,
            });
        }
    }

    /// Torque of one joint where links move so, of this chain or of one that [moves as](Self::moves_as) it.
    pub fn moving_torque_nm(&self, joint: usize, moving: &Moving) -> f64 {
        // of the links from the joint on, added up in the order of inverse dynamics
        let mut loads: ArrayVec<_, LINKS_MAX> = ArrayVec::new();
        let links = self.bodies.iter().zip(&moving.0).skip(joint);
        loads.extend(links.map(|(body, link)| load(body, &link.field, &link.origin_m_s2)));
        for index in (joint + 1..self.bodies.len()).rev() {
            let (body, link) = (&self.bodies[index], &moving.0[index]);
            let (force_n, moment_nm) = loads[index - joint];
            // what hangs on a link before the joint is none of its load
            let parent = body.parent.and_then(|parent| parent.checked_sub(joint));
            if let Some(parent) = parent {
                let force_n = link.rotation * force_n;
                loads[parent].0 += force_n;
                loads[parent].1 += link.rotation * moment_nm + link.origin_m.cross(&force_n);
            }
        }
        let (force_n, moment_nm) = &loads[0];
        along_joint(&self.bodies[joint], force_n, moment_nm)
    }

    /// How the links stand at this position.
    pub fn links_standing(&self, position_rad: &[f64], standing: &mut Standing) {
        assert_joints(self.joint_count(), &[position_rad.len()]);
        standing.0.clear();
        for (body, &position) in self.bodies.iter().zip(position_rad) {
            let rotation = body.rotation(position);
            let of_parent_m_s2 = body
                .parent
                .map_or(self.gravity_m_s2, |parent| standing.0[parent].gravity_m_s2);
            standing.0.push(StandingLink {
                rotation,
                origin_m: body.origin_m(position),
                gravity_m_s2: rotation.tr_mul(&of_parent_m_s2),
                slides: body.slides,
            });
        }
    }

    /// What a joint carries where links stand so: its own position does not matter.
    pub fn carried(&self, joint: usize, standing: &Standing) -> Carried {
        let mut moments_kg_m: ArrayVec<_, LINKS_MAX> = ArrayVec::new();
        moments_kg_m.extend(standing.0.iter().map(|_| Vector3::zeros()));
        let links = self.bodies.iter().zip(&standing.0).enumerate();
        for (index, (body, link)) in links.skip(joint + 1).rev() {
            let h = moments_kg_m[index] + body.augmented.first_moment_kg_m;
            // what hangs on a link before the joint is not carried by it
            if let Some(parent) = body.parent.filter(|parent| *parent >= joint) {
                moments_kg_m[parent] += link.passed_on_kg_m(body, &h);
            }
        }
        let body = &self.bodies[joint];
        Carried {
            first_moment_kg_m: moments_kg_m[joint] + body.augmented.first_moment_kg_m,
            mass_kg: body.carried_kg,
        }
    }
}

impl Standing {
    pub(super) fn links(&self) -> &[StandingLink] {
        &self.0
    }

    /// Torque that holds what a joint carries.
    pub fn holding_torque_nm(&self, joint: usize, carried: &Carried) -> f64 {
        self.0[joint].holding_torque_nm(carried)
    }
}
