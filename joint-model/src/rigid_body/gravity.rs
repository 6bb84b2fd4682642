//! Gravity: the torque that holds it and its potential energy.
//!
//! Gravity acts on a link and all it carries as on one first moment `h`, which each link inherits from the
//! next: `h_i = h_i,augmented + R_i+1 h_i+1`.

use nalgebra::Vector3;

use super::one_joint::Standing;
use super::{Chain, assert_joints};

impl Chain {
    /// Joint torque that holds the chain still against gravity.
    pub fn gravity_torque(&self, position_rad: &[f64], torque_nm: &mut [f64]) {
        assert_joints(self.joint_count(), &[position_rad.len(), torque_nm.len()]);
        let mut standing = Standing::default();
        self.links_standing(position_rad, &mut standing);
        let mut carried_kg_m = Vector3::zeros();
        let links = self.bodies.iter().zip(standing.links());
        for ((body, link), torque_nm) in links.zip(torque_nm).rev() {
            let h = body.augmented.first_moment_kg_m + carried_kg_m;
            *torque_nm = link.holding_torque_nm(&h);
            carried_kg_m = link.rotation * h;
        }
    }

    /// Gravitational potential energy, zero with every centre of mass at the base origin's height.
    pub fn potential_energy_j(&self, position_rad: &[f64]) -> f64 {
        assert_joints(self.joint_count(), &[position_rad.len()]);
        let mut carried_kg_m = Vector3::zeros();
        let mut mass_kg = 0.0;
        for (body, &angle_rad) in self.bodies.iter().zip(position_rad).rev() {
            mass_kg += body.mass_kg;
            carried_kg_m =
                body.rotation(angle_rad) * (body.augmented.first_moment_kg_m + carried_kg_m);
        }
        -self
            .gravity_m_s2
            .dot(&(carried_kg_m + mass_kg * self.bodies[0].origin_m))
    }
}
