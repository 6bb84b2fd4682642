//! Poses of joint and tool frames.

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::{Chain, assert_joints};

impl Chain {
    /// The tool frame in the base frame.
    pub fn tool_pose(&self, position_rad: &[f64]) -> Isometry3<f64> {
        self.joint_frame(position_rad, self.joint_count() - 1) * self.tool
    }

    /// The frame of joint `index` in the base frame, turned with its link.
    ///
    /// # Panics
    /// When the chain has no joint `index`.
    pub fn joint_frame(&self, position_rad: &[f64], index: usize) -> Isometry3<f64> {
        assert_joints(self.joint_count(), &[position_rad.len()]);
        let mut rotation = Matrix3::identity();
        let mut origin_m = Vector3::zeros();
        for (body, &angle_rad) in self.bodies[..=index].iter().zip(position_rad) {
            origin_m += rotation * body.origin_m;
            rotation *= body.rotation(angle_rad);
        }
        rotation *= self.bodies[index].alignment.matrix().transpose();
        let rotation = Rotation3::from_matrix_unchecked(rotation);
        Isometry3::from_parts(
            origin_m.into(),
            UnitQuaternion::from_rotation_matrix(&rotation),
        )
    }
}
