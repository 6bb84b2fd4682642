//! Forward dynamics: from torque to motion, by the articulated-body algorithm.
//!
//! Featherstone, Rigid Body Dynamics Algorithms (2008), Table 7.1, with ordinary instead of spatial
//! accelerations, which need no linear velocities. Names follow the book: `I^A` is the inertia a joint feels of
//! everything it carries, `p^A` the wrench that this needs without any acceleration, `U = I^A S`, `D = Sᵀ U`,
//! `u = τ - Sᵀ p^A`. The axis `S` is z, so `U` is a column of `I^A` and `D` an element.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::body::Body;
use super::symmetric::Symmetric3;
use super::{Chain, assert_joints};
use crate::JOINTS_MAX;

/// What velocity alone causes, in the link's frame.
struct MovingLink {
    /// From this frame to the parent's.
    rotation: Matrix3<f64>,
    /// Acceleration of the origin and of the link; no angular one about z.
    velocity_product: Acceleration,
    /// Wrench that keeps the link turning.
    bias: Wrench,
}

#[derive(Clone, Copy)]
struct Acceleration {
    angular_rad_s2: Vector3<f64>,
    linear_m_s2: Vector3<f64>,
}

#[derive(Clone, Copy)]
struct Wrench {
    moment_nm: Vector3<f64>,
    force_n: Vector3<f64>,
}

/// `moment = angular·α + coupling·a`, `force = couplingᵀ·α + linear·a`.
struct ArticulatedInertia {
    angular_kg_m2: Symmetric3,
    /// Rows.
    coupling_kg_m: [Vector3<f64>; 3],
    linear_kg: Symmetric3,
}

/// How a joint yields: `q̈ = u/D - (U/D)ᵀ (α, a)`, the accelerations without `q̈`.
struct JointResponse {
    /// Angular part of `U/D`; its z is 1.
    angular: Vector3<f64>,
    /// Linear part of `U/D`.
    linear_1_m: Vector3<f64>,
    /// `D`.
    inertia_kg_m2: f64,
    /// `u/D`.
    free_rad_s2: f64,
}

impl Chain {
    /// Joint acceleration under `torque_nm`, gravity included.
    ///
    /// Not finite where a joint moves nothing that has inertia about its axis, as with a massless last link.
    pub fn forward_dynamics(
        &self,
        position_rad: &[f64],
        velocity_rad_s: &[f64],
        torque_nm: &[f64],
        acceleration_rad_s2: &mut [f64],
    ) {
        assert_joints(
            self.joint_count(),
            &[
                position_rad.len(),
                velocity_rad_s.len(),
                torque_nm.len(),
                acceleration_rad_s2.len(),
            ],
        );
        // Filled in place: buffers this large would be copied on return.
        let (mut moving, mut responses) = (ArrayVec::new(), ArrayVec::new());
        self.move_links(position_rad, velocity_rad_s, &mut moving);
        self.respond(&moving, torque_nm, &mut responses);
        self.accelerate(&moving, &responses, acceleration_rad_s2);
    }

    /// Base to tip.
    fn move_links(
        &self,
        position_rad: &[f64],
        velocity_rad_s: &[f64],
        moving: &mut ArrayVec<MovingLink, JOINTS_MAX>,
    ) {
        let mut omega = Vector3::zeros();
        for ((body, &position), &velocity) in
            self.bodies.iter().zip(position_rad).zip(velocity_rad_s)
        {
            let rotation = body.rotation(position);
            let centripetal_m_s2 = rotation.tr_mul(&omega.cross(&omega.cross(&body.origin_m)));
            omega = rotation.tr_mul(&omega);
            let coriolis_rad_s2 = Vector3::new(omega.y * velocity, -omega.x * velocity, 0.0);
            omega.z += velocity;
            moving.push(MovingLink {
                rotation,
                velocity_product: Acceleration {
                    angular_rad_s2: coriolis_rad_s2,
                    linear_m_s2: centripetal_m_s2,
                },
                bias: Wrench {
                    moment_nm: omega.cross(&body.inertia_kg_m2.times(&omega)),
                    force_n: omega.cross(&omega.cross(&body.first_moment_kg_m)),
                },
            });
        }
    }

    /// Tip to base.
    fn respond(
        &self,
        moving: &[MovingLink],
        torque_nm: &[f64],
        responses: &mut ArrayVec<JointResponse, JOINTS_MAX>,
    ) {
        let mut carried: Option<(ArticulatedInertia, Wrench)> = None;
        for (index, (body, link)) in self.bodies.iter().zip(moving).enumerate().rev() {
            let mut inertia = ArticulatedInertia::of(body);
            let mut bias = link.bias;
            if let Some((carried_inertia, carried_bias)) = &carried {
                inertia.add(carried_inertia);
                bias.moment_nm += carried_bias.moment_nm;
                bias.force_n += carried_bias.force_n;
            }
            let response = inertia.response(torque_nm[index] - bias.moment_nm.z);
            // The base does not move, so nothing needs what it feels.
            if index > 0 {
                inertia.remove_joint(&response);
                let bias = inertia.bias_through_joint(&bias, &link.velocity_product, &response);
                carried = Some((
                    inertia.seen_by_parent(&link.rotation, &body.origin_m),
                    bias.seen_by_parent(&link.rotation, &body.origin_m),
                ));
            }
            responses.push(response);
        }
    }

    fn accelerate(
        &self,
        moving: &[MovingLink],
        tip_to_base: &[JointResponse],
        acceleration_rad_s2: &mut [f64],
    ) {
        let mut alpha = Vector3::zeros();
        // A base that accelerates upwards yields the same motion as gravity.
        let mut origin_m_s2 = -self.gravity_m_s2;
        let joints = self.bodies.iter().zip(moving).zip(tip_to_base.iter().rev());
        for (((body, link), response), acceleration) in joints.zip(acceleration_rad_s2) {
            origin_m_s2 = link
                .rotation
                .tr_mul(&(origin_m_s2 + alpha.cross(&body.origin_m)))
                + link.velocity_product.linear_m_s2;
            alpha = link.rotation.tr_mul(&alpha) + link.velocity_product.angular_rad_s2;
            *acceleration = response.free_rad_s2
                - response.angular.dot(&alpha)
                - response.linear_1_m.dot(&origin_m_s2);
            alpha.z += *acceleration;
        }
    }
}

impl Wrench {
    #[inline]
    fn seen_by_parent(&self, rotation: &Matrix3<f64>, origin_m: &Vector3<f64>) -> Self {
        let force_n = rotation * self.force_n;
        Self {
            moment_nm: rotation * self.moment_nm + origin_m.cross(&force_n),
            force_n,
        }
    }
}

impl ArticulatedInertia {
    #[inline]
    fn of(body: &Body) -> Self {
        let (h, m) = (&body.first_moment_kg_m, body.mass_kg);
        Self {
            angular_kg_m2: body.inertia_kg_m2,
            coupling_kg_m: [
                Vector3::new(0.0, -h.z, h.y),
                Vector3::new(h.z, 0.0, -h.x),
                Vector3::new(-h.y, h.x, 0.0),
            ],
            linear_kg: Symmetric3 {
                xx: m,
                xy: 0.0,
                xz: 0.0,
                yy: m,
                yz: 0.0,
                zz: m,
            },
        }
    }

    #[inline]
    fn add(&mut self, other: &Self) {
        self.angular_kg_m2 += &other.angular_kg_m2;
        for (row, other_row) in self.coupling_kg_m.iter_mut().zip(&other.coupling_kg_m) {
            *row += other_row;
        }
        self.linear_kg += &other.linear_kg;
    }

    /// `U/D` and `u/D` for `u = net_torque_nm`.
    #[inline]
    fn response(&self, net_torque_nm: f64) -> JointResponse {
        let inertia_kg_m2 = self.angular_kg_m2.zz;
        let inverse = 1.0 / inertia_kg_m2;
        JointResponse {
            angular: Vector3::new(
                self.angular_kg_m2.xz * inverse,
                self.angular_kg_m2.yz * inverse,
                1.0,
            ),
            linear_1_m: self.coupling_kg_m[2] * inverse,
            inertia_kg_m2,
            free_rad_s2: net_torque_nm * inverse,
        }
    }

    /// `I^a = I^A - U Uᵀ/D`: the joint passes nothing on about its axis, so its row and column vanish.
    #[inline]
    fn remove_joint(&mut self, response: &JointResponse) {
        let Symmetric3 { xz, yz, .. } = self.angular_kg_m2;
        let row = self.coupling_kg_m[2];
        let (angular, linear) = (&response.angular, &response.linear_1_m);
        self.angular_kg_m2.xx -= xz * angular.x;
        self.angular_kg_m2.xy -= xz * angular.y;
        self.angular_kg_m2.yy -= yz * angular.y;
        self.angular_kg_m2.xz = 0.0;
        self.angular_kg_m2.yz = 0.0;
        self.angular_kg_m2.zz = 0.0;
        self.coupling_kg_m[0] -= linear * xz;
        self.coupling_kg_m[1] -= linear * yz;
        self.coupling_kg_m[2] = Vector3::zeros();
        self.linear_kg.xx -= row.x * linear.x;
        self.linear_kg.xy -= row.x * linear.y;
        self.linear_kg.xz -= row.x * linear.z;
        self.linear_kg.yy -= row.y * linear.y;
        self.linear_kg.yz -= row.y * linear.z;
        self.linear_kg.zz -= row.z * linear.z;
    }

    /// `p^a = p^A + I^a c + U u/D`; `self` is `I^a`.
    #[inline]
    fn bias_through_joint(
        &self,
        bias: &Wrench,
        product: &Acceleration,
        response: &JointResponse,
    ) -> Wrench {
        let (c, a) = (&product.angular_rad_s2, &product.linear_m_s2);
        let [row_x, row_y, _] = &self.coupling_kg_m;
        let planar = &self.angular_kg_m2;
        let net_torque_nm = response.free_rad_s2 * response.inertia_kg_m2;
        let moment_nm = Vector3::new(
            planar.xx * c.x + planar.xy * c.y + row_x.dot(a),
            planar.xy * c.x + planar.yy * c.y + row_y.dot(a),
            0.0,
        );
        let force_n = row_x * c.x + row_y * c.y + self.linear_kg.times(a);
        Wrench {
            moment_nm: bias.moment_nm + moment_nm + response.angular * net_torque_nm,
            force_n: bias.force_n + force_n + response.linear_1_m * net_torque_nm,
        }
    }

    /// Turned into the parent's axes and moved to its origin; `self` is `I^a`, without z in its angular parts.
    #[inline]
    fn seen_by_parent(&self, rotation: &Matrix3<f64>, origin_m: &Vector3<f64>) -> Self {
        let linear_kg = self.linear_kg.turned(rotation);
        let angular_kg_m2 = self.angular_kg_m2.planar_turned(rotation);
        let (along_x, along_y) = (
            rotation * self.coupling_kg_m[0],
            rotation * self.coupling_kg_m[1],
        );
        let turned = [
            along_x * rotation.m11 + along_y * rotation.m12,
            along_x * rotation.m21 + along_y * rotation.m22,
            along_x * rotation.m31 + along_y * rotation.m32,
        ];

        // H' = H + [p]× M and I' = I + [p]× H'ᵀ - H [p]×, from moment' = moment + p × force, a = a' + α × p.
        let [m_x, m_y, m_z] = linear_kg.rows();
        let p = origin_m;
        let moved = [
            turned[0] + m_z * p.y - m_y * p.z,
            turned[1] + m_x * p.z - m_z * p.x,
            turned[2] + m_y * p.x - m_x * p.y,
        ];
        let before = turned.map(|row| p.cross(&row));
        let after = moved.map(|row| p.cross(&row));
        let shift = Symmetric3 {
            xx: before[0].x + after[0].x,
            xy: before[0].y + after[1].x,
            xz: before[0].z + after[2].x,
            yy: before[1].y + after[1].y,
            yz: before[1].z + after[2].y,
            zz: before[2].z + after[2].z,
        };
        Self {
            angular_kg_m2: angular_kg_m2 + shift,
            coupling_kg_m: moved,
            linear_kg,
        }
    }
}
