//! Gravity: the torque that holds it and its potential energy.
//!
//! Gravity acts on a link and all it carries as on one first moment `h`, which each link inherits from the
//! next: `h_i = h_i,augmented + R_i+1 h_i+1`.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::{Chain, assert_joints};
use crate::JOINTS_MAX;

impl Chain {
    /// Joint torque that holds the chain still against gravity.
    pub fn gravity_torque(&self, position_rad: &[f64], torque_nm: &mut [f64]) {
        assert_joints(self.joint_count(), &[position_rad.len(), torque_nm.len()]);
        let mut turned: ArrayVec<(Matrix3<f64>, Vector3<f64>), JOINTS_MAX> = ArrayVec::new();
        let mut gravity_m_s2 = self.gravity_m_s2;
        for (body, &angle_rad) in self.bodies.iter().zip(position_rad) {
            let rotation = body.rotation(angle_rad);
            gravity_m_s2 = rotation.tr_mul(&gravity_m_s2);
            turned.push((rotation, gravity_m_s2));
        }
        let mut carried_kg_m = Vector3::zeros();
        for ((body, (rotation, g)), torque_nm) in
            self.bodies.iter().zip(&turned).zip(torque_nm).rev()
        {
            let h = body.augmented.first_moment_kg_m + carried_kg_m;
            *torque_nm = h.y * g.x - h.x * g.y; // -(h × g)·z
            carried_kg_m = rotation * h;
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
