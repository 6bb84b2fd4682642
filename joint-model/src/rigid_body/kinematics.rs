//! Poses of joint and tool frames.

use arrayvec::ArrayVec;
use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::chain::LINKS_MAX;
use super::{Chain, assert_joints};

impl Chain {
    /// The tool frame in the base frame; it is fixed to the last link.
    pub fn tool_pose(&self, position_rad: &[f64]) -> Isometry3<f64> {
        self.joint_frame(position_rad, self.joint_count() - 1) * self.tool
    }

    /// The frame of joint `index` in the base frame, moved with its link.
    ///
    /// # Panics
    /// When the chain has no joint `index`.
    pub fn joint_frame(&self, position_rad: &[f64], index: usize) -> Isometry3<f64> {
        assert_joints(self.joint_count(), &[position_rad.len()]);
        let mut way: ArrayVec<usize, LINKS_MAX> = ArrayVec::new();
        let mut next = Some(index);
        while let Some(link) = next {
            way.push(link);
            next = self.bodies[link].parent;
        }
        let mut rotation = Matrix3::identity();
        let mut origin_m = Vector3::zeros();
        for &link in way.iter().rev() {
            let (body, position) = (&self.bodies[link], position_rad[link]);
            origin_m += rotation * body.origin_m(position);
            rotation *= body.rotation(position);
        }
        rotation *= self.bodies[index].alignment.matrix().transpose();
        let rotation = Rotation3::from_matrix_unchecked(rotation);
        Isometry3::from_parts(
            origin_m.into(),
            UnitQuaternion::from_rotation_matrix(&rotation),
        )
    }
}
