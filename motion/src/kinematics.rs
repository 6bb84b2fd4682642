//! Inverse kinematics of the PA-10 with joint 3 locked at zero, in closed form.
//!
//! Joints 1, 2 and 4 place the wrist, joints 5 to 7 turn the tool. Of the eight solutions this takes the one with the
//! shoulder facing the tool, the elbow up (joint 4 positive) and the wrist bent forward (joint 6 positive).
//! The formulas run on plain numbers or on dual numbers, which carry exact first and second derivatives along a path.

use joint_model::rigid_body::{Chain, JointKind, Link};
use nalgebra::{Isometry3, Rotation3, Vector3};
use num_dual::DualNum;

use crate::MotionError;

const JOINTS: usize = 7;
/// Deviations of an arm's shape below this are rounding, not design.
const SHAPE_TOLERANCE: f64 = 1e-9;

/// The dimensions of an arm like the PA-10: at zero it points along z, with axes z, y, z, y, z, y, z.
#[derive(Clone, Debug)]
pub struct PaTenArm {
    shoulder_height_m: f64,
    upper_arm_m: f64,
    forearm_m: f64,
    wrist_to_last_link_m: f64,
    /// The last link in the tool's frame.
    last_link_in_tool: Isometry3<f64>,
}

impl PaTenArm {
    /// Takes the dimensions from a chain.
    ///
    /// # Errors
    /// [`MotionError::Shape`] if the chain is no such arm.
    pub fn new(chain: &Chain) -> Result<Self, MotionError> {
        let shape = |reason: String| MotionError::Shape { reason };
        let links = chain.links();
        if links.len() != JOINTS {
            return Err(shape(format!(
                "this robot has {} joints, not seven",
                links.len()
            )));
        }
        for (index, link) in links.iter().enumerate() {
            let axis = if index % 2 == 0 {
                Vector3::z()
            } else {
                Vector3::y()
            };
            let offset = link.origin.translation.vector.xy().norm();
            let turned = link
                .origin
                .rotation
                .angle()
                .max((link.axis.into_inner() - axis).norm());
            let is_next = link.parent == Link::serial(index) && link.kind == JointKind::Revolute;
            if !is_next || offset > SHAPE_TOLERANCE || turned > SHAPE_TOLERANCE {
                let reason = "is not on the arm's centre line with axes z, y, z, y, z, y, z";
                return Err(shape(format!("joint {} {reason}", index + 1)));
            }
        }
        let along = |from: usize, to: usize| {
            links[from..=to]
                .iter()
                .map(|link| link.origin.translation.z)
                .sum()
        };
        let last_link = links
            .iter()
            .fold(Isometry3::identity(), |pose, link| pose * link.origin);
        Ok(Self {
            shoulder_height_m: along(0, 1),
            upper_arm_m: along(2, 3),
            forearm_m: along(4, 5),
            wrist_to_last_link_m: along(6, 6),
            last_link_in_tool: chain.tool_pose(&[0.0; JOINTS]).inverse() * last_link,
        })
    }

    /// Joint positions that bring the tool to `pose`; `None` out of reach, with the arm stretched, or where the wrist
    /// is straight.
    pub fn solve(&self, pose: &Isometry3<f64>) -> Option<[f64; JOINTS]> {
        let position_m = pose.translation.vector;
        self.solve_along(
            [position_m.x, position_m.y, position_m.z],
            &pose.rotation.to_rotation_matrix(),
        )
    }

    /// The same for a tool position that may carry derivatives, at constant orientation.
    pub(crate) fn solve_along<D: DualNum<Primitive = f64> + Copy>(
        &self,
        tool_m: [D; 3],
        orientation: &Rotation3<f64>,
    ) -> Option<[D; JOINTS]> {
        let last_link = orientation * self.last_link_in_tool.rotation.to_rotation_matrix();
        let wrist_from_tool_m = orientation * self.last_link_in_tool.translation.vector
            - last_link * Vector3::new(0.0, 0.0, self.wrist_to_last_link_m);
        let wrist_m = [0, 1, 2].map(|i| tool_m[i] + wrist_from_tool_m[i]);
        let [q1, q2, q4] = self.place_wrist(wrist_m)?;
        let [q5, q6, q7] = turn_tool(q1, q2 + q4, &last_link)?;
        Some([q1, q2, D::from(0.0), q4, q5, q6, q7])
    }

    /// The plane arm of upper arm and forearm, turned about the vertical by joint 1.
    fn place_wrist<D: DualNum<Primitive = f64> + Copy>(&self, [x, y, z]: [D; 3]) -> Option<[D; 3]> {
        let (upper_m, fore_m) = (self.upper_arm_m, self.forearm_m);
        let out = (x * x + y * y).sqrt();
        let up = z - self.shoulder_height_m;
        let cos_q4 = (out * out + up * up - (upper_m * upper_m + fore_m * fore_m))
            / (2.0 * upper_m * fore_m);
        let sin_squared = -cos_q4 * cos_q4 + 1.0;
        let regular = sin_squared.re() > SINGULAR && out.re() > SINGULAR;
        regular.then(|| {
            let sin_q4 = sin_squared.sqrt();
            let q2 = angle(out, up) - angle(sin_q4 * fore_m, cos_q4 * fore_m + upper_m);
            [angle(y, x), q2, angle(sin_q4, cos_q4)]
        })
    }
}

/// Nearer than this to a singular pose (sine squared of the angle from it, or metres from the axis of joint 1) the
/// derivatives lose their digits.
const SINGULAR: f64 = 1e-6;

/// Joints 5 to 7 from what is left of the orientation behind the forearm: `Rz(q5)·Ry(q6)·Rz(q7)`.
fn turn_tool<D: DualNum<Primitive = f64> + Copy>(
    q1: D,
    forearm_tilt: D,
    last_link: &Rotation3<f64>,
) -> Option<[D; 3]> {
    let ((sin_1, cos_1), (sin_t, cos_t)) = (q1.sin_cos(), forearm_tilt.sin_cos());
    // A column of the orientation, seen from the forearm: Ry(-tilt)·Rz(-q1).
    let seen = |column: usize| {
        let [x, y, z] = [0, 1, 2].map(|row| last_link[(row, column)]);
        let out = cos_1 * x + sin_1 * y;
        [
            cos_t * out - sin_t * z,
            cos_1 * y - sin_1 * x,
            sin_t * out + cos_t * z,
        ]
    };
    let [x_axis, y_axis, z_axis] = [seen(0), seen(1), seen(2)];
    let sin_squared = z_axis[0] * z_axis[0] + z_axis[1] * z_axis[1];
    // False for NaN too.
    let bent = sin_squared.re() > SINGULAR;
    bent.then(|| {
        let q6 = angle(sin_squared.sqrt(), z_axis[2]);
        [
            angle(z_axis[1], z_axis[0]),
            q6,
            angle(y_axis[2], -x_axis[2]),
        ]
    })
}

/// Four-quadrant arc tangent with derivatives that stay finite on both axes.
fn angle<D: DualNum<Primitive = f64> + Copy>(y: D, x: D) -> D {
    let near = if x.re().abs() > y.re().abs() {
        (y / x).atan()
    } else {
        -(x / y).atan()
    };
    // The branches differ by a constant, which the plain arc tangent gives.
    near + (y.re().atan2(x.re()) - near.re())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use nalgebra::UnitQuaternion;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn solutions_bring_the_tool_to_the_pose(
            q1 in -2.0..2.0f64, q2 in 0.1..1.3f64, q4 in 0.1..2.3f64,
            q5 in -2.0..2.0f64, q6 in 0.1..2.8f64, q7 in -3.0..3.0f64,
        ) {
            let chain = robot::load("pa10").unwrap().chain;
            let asked = [q1, q2, 0.0, q4, q5, q6, q7];
            let pose = chain.tool_pose(&asked);
            let solved = PaTenArm::new(&chain).unwrap().solve(&pose);
            if let Some(solved) = solved {
                let reached = chain.tool_pose(&solved);
                prop_assert!((reached.translation.vector - pose.translation.vector).norm() < 1e-9);
                prop_assert!(reached.rotation.angle_to(&pose.rotation) < 1e-7);
            }
            // With the wrist in front of the base the configuration is the asked one.
            if 0.45 * q2.sin() + 0.5 * (q2 + q4).sin() > 0.01 {
                for (solved, asked) in solved.unwrap().iter().zip(asked) {
                    prop_assert!((solved - asked).abs() < 1e-6, "{solved} is not {asked}");
                }
            }
        }
    }

    #[test]
    fn a_tool_off_the_flange_is_accounted_for() {
        let robot = robot::load("pa10").unwrap();
        let tool = Isometry3::from_parts(
            Vector3::new(0.02, -0.03, 0.15).into(),
            UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3),
        );
        let chain = Chain::new(robot.chain.links(), Vector3::new(0.0, 0.0, -9.81), tool).unwrap();
        let pose = chain.tool_pose(&[0.3, 0.7, 0.0, 1.2, -0.4, 0.9, 0.5]);
        let solved = PaTenArm::new(&chain).unwrap().solve(&pose).unwrap();
        assert!(
            (chain.tool_pose(&solved).translation.vector - pose.translation.vector).norm() < 1e-9
        );
    }

    #[test]
    fn out_of_reach_is_none() {
        let arm = PaTenArm::new(&robot::load("pa10").unwrap().chain).unwrap();
        assert!(arm.solve(&Isometry3::translation(2.0, 0.0, 0.0)).is_none());
        assert!(
            arm.solve(&Isometry3::translation(f64::NAN, 0.0, 0.0))
                .is_none()
        );
    }

    #[test]
    fn other_arms_are_refused() {
        let error = PaTenArm::new(&robot::load("shd17").unwrap().chain).unwrap_err();
        assert!(error.to_string().contains("1 joints, not seven"), "{error}");
    }
}
