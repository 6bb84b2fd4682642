//! Gravity: the torque that holds it and its potential energy.
//!
//! Gravity acts on a link and all it carries as on one first moment `h`, which each link inherits from those
//! that hang on it: `h_i = h_i,augmented + Σ R_j h_j`.

use arrayvec::ArrayVec;
use nalgebra::Vector3;

use super::chain::LINKS_MAX;
use super::one_joint::{Carried, Standing};
use super::{Chain, JointKind, assert_joints};

impl Chain {
    /// Joint torque that holds the chain still against gravity.
    pub fn gravity_torque(&self, position_rad: &[f64], torque_nm: &mut [f64]) {
        assert_joints(self.joint_count(), &[position_rad.len(), torque_nm.len()]);
        let mut standing = Standing::default();
        self.links_standing(position_rad, &mut standing);
        let mut moments_kg_m: ArrayVec<Vector3<f64>, LINKS_MAX> = ArrayVec::new();
        moments_kg_m.extend(self.bodies.iter().map(|_| Vector3::zeros()));
        for (index, body) in self.bodies.iter().enumerate().rev() {
            let link = &standing.links()[index];
            let h = body.augmented.first_moment_kg_m + moments_kg_m[index];
            torque_nm[index] = link.holding_torque_nm(&Carried {
                first_moment_kg_m: h,
                mass_kg: body.carried_kg,
            });
            if let Some(parent) = body.parent {
                moments_kg_m[parent] += link.passed_on_kg_m(body, &h);
            }
        }
    }

    /// Part of gravity, 0 to 1, that lies across the axis of joint `index`: what a weight on its link can make it feel. Nothing where
    /// the joint slides, for what slides weighs the same wherever it is.
    ///
    /// # Panics
    /// When the chain has no joint `index`.
    pub fn gravity_across_axis(&self, position_rad: &[f64], index: usize) -> f64 {
        let link = &self.links()[index];
        let Some(down) = self.gravity_m_s2.try_normalize(0.0) else {
            return 0.0;
        };
        if link.kind == JointKind::Prismatic {
            return 0.0;
        }
        let axis = self.joint_frame(position_rad, index).rotation * link.axis.into_inner();
        axis.cross(&down).norm()
    }

    /// Gravitational potential energy, zero with every centre of mass at the base origin's height.
    pub fn potential_energy_j(&self, position_rad: &[f64]) -> f64 {
        assert_joints(self.joint_count(), &[position_rad.len()]);
        let mut standing = Standing::default();
        self.links_standing(position_rad, &mut standing);
        let mut moments_kg_m: ArrayVec<Vector3<f64>, LINKS_MAX> = ArrayVec::new();
        moments_kg_m.extend(self.bodies.iter().map(|_| Vector3::zeros()));
        let mut about_base_kg_m = Vector3::zeros();
        for (index, body) in self.bodies.iter().enumerate().rev() {
            let link = &standing.links()[index];
            let h = body.augmented.first_moment_kg_m + moments_kg_m[index];
            let passed_kg_m = link.passed_on_kg_m(body, &h);
            match body.parent {
                Some(parent) => moments_kg_m[parent] += passed_kg_m,
                // the base has no augmented link, so it counts the mass here
                None => {
                    let counted_kg = body.carried_kg - body.left_out_kg;
                    about_base_kg_m +=
                        passed_kg_m + counted_kg * body.origin_m(position_rad[index]);
                }
            }
        }
        -self.gravity_m_s2.dot(&about_base_kg_m)
    }
}
