//! Forward dynamics: from torque to motion, by the articulated-body algorithm.
//!
//! Featherstone, Rigid Body Dynamics Algorithms (2008), Table 7.1, with ordinary instead of spatial
//! accelerations, which need no linear velocities. Names follow the book: `I^A` is the inertia a joint feels of
//! everything it carries, `p^A` the wrench that this needs without any acceleration, `U = I^A S`, `D = Sᵀ U`,
//! `u = τ - Sᵀ p^A`. The axis `S` is z, so `U` is a column of `I^A` and `D` an element: of the angular part where the
//! joint turns, of the linear one where it slides.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::body::Body;
use super::chain::LINKS_MAX;
use super::symmetric::Symmetric3;
use super::{Chain, assert_joints};

/// What velocity alone causes, in the link's frame.
struct MovingLink {
    /// From this frame to the parent's.
    rotation: Matrix3<f64>,
    /// This frame's origin in the parent's.
    origin_m: Vector3<f64>,
    /// Acceleration of the origin and of the link; no angular one about z.
    velocity_product: Acceleration,
    /// Wrench that keeps the link turning, on the way back with those of the links it carries.
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
#[derive(Clone, Copy)]
struct ArticulatedInertia {
    angular_kg_m2: Symmetric3,
    /// Rows.
    coupling_kg_m: [Vector3<f64>; 3],
    linear_kg: Symmetric3,
}

/// How a joint yields: `q̈ = u/D - (U/D)ᵀ (α, a)`, the accelerations without `q̈`.
struct JointResponse {
    /// Angular part of `U/D`; its z is 1 where the joint turns.
    angular: Vector3<f64>,
    /// Linear part of `U/D`; its z is 1 where the joint slides.
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
        self.respond(&mut moving, torque_nm, &mut responses);
        self.accelerate(&moving, &responses, acceleration_rad_s2);
    }

    /// Base to tips.
    fn move_links(
        &self,
        position_rad: &[f64],
        velocity_rad_s: &[f64],
        moving: &mut ArrayVec<MovingLink, LINKS_MAX>,
    ) {
        let mut omega = Vector3::zeros();
        let mut trunk: ArrayVec<Vector3<f64>, LINKS_MAX> = ArrayVec::new();
        for ((body, &position), &velocity) in
            self.bodies.iter().zip(position_rad).zip(velocity_rad_s)
        {
            if self.branches {
                omega = body.parent.map_or(Vector3::zeros(), |parent| trunk[parent]);
            }
            let (rotation, origin_m) = (body.rotation(position), body.origin_m(position));
            let centripetal_m_s2 = rotation.tr_mul(&omega.cross(&omega.cross(&origin_m)));
            omega = rotation.tr_mul(&omega);
            let coriolis = Vector3::new(omega.y * velocity, -omega.x * velocity, 0.0);
            let velocity_product = if body.slides {
                Acceleration {
                    angular_rad_s2: Vector3::zeros(),
                    linear_m_s2: centripetal_m_s2 + 2.0 * coriolis,
                }
            } else {
                omega.z += velocity;
                Acceleration {
                    angular_rad_s2: coriolis,
                    linear_m_s2: centripetal_m_s2,
                }
            };
            if self.branches {
                trunk.push(omega);
            }
            moving.push(MovingLink {
                rotation,
                origin_m,
                velocity_product,
                bias: Wrench {
                    moment_nm: omega.cross(&body.inertia_kg_m2.times(&omega)),
                    force_n: omega.cross(&omega.cross(&body.first_moment_kg_m)),
                },
            });
        }
    }

    /// Tips to base.
    fn respond(
        &self,
        moving: &mut ArrayVec<MovingLink, LINKS_MAX>,
        torque_nm: &[f64],
        responses: &mut ArrayVec<JointResponse, LINKS_MAX>,
    ) {
        let mut inertias: ArrayVec<ArticulatedInertia, LINKS_MAX> = ArrayVec::new();
        inertias.extend(self.bodies.iter().map(ArticulatedInertia::of));
        for (index, body) in self.bodies.iter().enumerate().rev() {
            let (inertia, link) = (&mut inertias[index], &moving[index]);
            let bias = &link.bias;
            let response = if body.slides {
                inertia.sliding_response(torque_nm[index] - bias.force_n.z)
            } else {
                inertia.response(torque_nm[index] - bias.moment_nm.z)
            };
            // The base does not move, so nothing needs what it feels.
            if let Some(parent) = body.parent {
                let (product, rotation) = (&link.velocity_product, &link.rotation);
                let (of_parent, bias) = if body.slides {
                    inertia.remove_sliding_joint(&response);
                    (
                        inertia.sliding_seen_by_parent(rotation, &link.origin_m),
                        inertia.bias_through_sliding_joint(bias, product, &response),
                    )
                } else {
                    inertia.remove_joint(&response);
                    (
                        inertia.seen_by_parent(rotation, &link.origin_m),
                        inertia.bias_through_joint(bias, product, &response),
                    )
                };
                let bias = bias.seen_by_parent(rotation, &link.origin_m);
                inertias[parent].add(&of_parent);
                moving[parent].bias.moment_nm += bias.moment_nm;
                moving[parent].bias.force_n += bias.force_n;
            }
            responses.push(response);
        }
    }

    fn accelerate(
        &self,
        moving: &[MovingLink],
        tips_to_base: &[JointResponse],
        acceleration_rad_s2: &mut [f64],
    ) {
        let mut trunk: ArrayVec<Acceleration, LINKS_MAX> = ArrayVec::new();
        let mut alpha = Vector3::zeros();
        // A base that accelerates upwards yields the same motion as gravity.
        let mut origin_m_s2 = -self.gravity_m_s2;
        let joints = self
            .bodies
            .iter()
            .zip(moving)
            .zip(tips_to_base.iter().rev());
        for (((body, link), response), acceleration) in joints.zip(acceleration_rad_s2) {
            if self.branches {
                (alpha, origin_m_s2) = match body.parent.map(|parent| &trunk[parent]) {
                    Some(parent) => (parent.angular_rad_s2, parent.linear_m_s2),
                    None => (Vector3::zeros(), -self.gravity_m_s2),
                };
            }
            origin_m_s2 = link
                .rotation
                .tr_mul(&(origin_m_s2 + alpha.cross(&link.origin_m)))
                + link.velocity_product.linear_m_s2;
            alpha = link.rotation.tr_mul(&alpha) + link.velocity_product.angular_rad_s2;
            *acceleration = response.free_rad_s2
                - response.angular.dot(&alpha)
                - response.linear_1_m.dot(&origin_m_s2);
            if body.slides {
                origin_m_s2.z += *acceleration;
            } else {
                alpha.z += *acceleration;
            }
            if self.branches {
                trunk.push(Acceleration {
                    angular_rad_s2: alpha,
                    linear_m_s2: origin_m_s2,
                });
            }
        }
    }
}

/// A joint that slides: the same with the linear part's z, and nothing vanishes of the angular part.
impl ArticulatedInertia {
    /// The coupling's z column.
    fn coupling_z_kg_m(&self) -> Vector3<f64> {
        let [x, y, z] = &self.coupling_kg_m;
        Vector3::new(x.z, y.z, z.z)
    }

    fn sliding_response(&self, net_force_n: f64) -> JointResponse {
        let mass_kg = self.linear_kg.zz;
        let [.., linear_z_kg] = self.linear_kg.rows();
        JointResponse {
            angular: self.coupling_z_kg_m() / mass_kg,
            linear_1_m: linear_z_kg / mass_kg,
            inertia_kg_m2: mass_kg,
            free_rad_s2: net_force_n / mass_kg,
        }
    }

    fn remove_sliding_joint(&mut self, response: &JointResponse) {
        let coupling_z = self.coupling_z_kg_m();
        let [.., linear_z] = self.linear_kg.rows();
        let (angular, linear) = (&response.angular, &response.linear_1_m);
        self.angular_kg_m2 += &Symmetric3::of(&(-coupling_z * angular.transpose()));
        self.linear_kg += &Symmetric3::of(&(-linear_z * linear.transpose()));
        for (row, of_z) in self.coupling_kg_m.iter_mut().zip(coupling_z.iter()) {
            *row -= linear * *of_z;
        }
    }

    fn bias_through_sliding_joint(
        &self,
        bias: &Wrench,
        product: &Acceleration,
        response: &JointResponse,
    ) -> Wrench {
        // the joint adds no angular acceleration of its own to its link
        let a = &product.linear_m_s2;
        let coupled_nm = self.coupling_kg_m.map(|row| row.dot(a));
        let net_force_n = response.free_rad_s2 * response.inertia_kg_m2;
        Wrench {
            moment_nm: bias.moment_nm + Vector3::from(coupled_nm) + response.angular * net_force_n,
            force_n: bias.force_n + self.linear_kg.times(a) + response.linear_1_m * net_force_n,
        }
    }

    fn sliding_seen_by_parent(&self, rotation: &Matrix3<f64>, origin_m: &Vector3<f64>) -> Self {
        let along = self.coupling_kg_m.map(|row| rotation * row);
        let turned = |row: usize| {
            along[0] * rotation[(row, 0)]
                + along[1] * rotation[(row, 1)]
                + along[2] * rotation[(row, 2)]
        };
        Self {
            angular_kg_m2: self.angular_kg_m2.turned(rotation),
            coupling_kg_m: [turned(0), turned(1), turned(2)],
            linear_kg: self.linear_kg.turned(rotation),
        }
        .moved(origin_m)
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
        Self {
            angular_kg_m2,
            coupling_kg_m: turned,
            linear_kg,
        }
        .moved(origin_m)
    }

    /// Moved from a point at `p` to the origin, in the same axes.
    #[inline]
    fn moved(&self, p: &Vector3<f64>) -> Self {
        let Self {
            angular_kg_m2,
            coupling_kg_m: turned,
            linear_kg,
        } = *self;
        // H' = H + [p]× M and I' = I + [p]× H'ᵀ - H [p]×, from moment' = moment + p × force, a = a' + α × p.
        let [m_x, m_y, m_z] = linear_kg.rows();
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
