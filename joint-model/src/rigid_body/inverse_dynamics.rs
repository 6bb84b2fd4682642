//! Inverse dynamics: from motion to torque, by recursive Newton-Euler.
//!
//! Featherstone, Rigid Body Dynamics Algorithms (2008), Table 5.1, with ordinary instead of spatial
//! accelerations. A point at `r` in a link whose origin accelerates with `a` has acceleration `a + Ω r`, where
//! `Ω = [α]× + [ω]×[ω]×`; one `Ω` per link serves the next origin, the force and the moment (Balafoutis and
//! Patel, Dynamic Analysis of Robot Manipulators, 1991).

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::body::Body;
use super::chain::LINKS_MAX;
use super::{Chain, assert_joints};

/// What the way to the tips leaves for the way back, in the link's frame; on the way back, with what it carries.
struct LoadedLink {
    rotation: Matrix3<f64>,
    force_n: Vector3<f64>,
    moment_nm: Vector3<f64>,
}

impl Chain {
    /// Joint torque that produces `acceleration_rad_s2` at this position and velocity, gravity included.
    pub fn inverse_dynamics(
        &self,
        position_rad: &[f64],
        velocity_rad_s: &[f64],
        acceleration_rad_s2: &[f64],
        torque_nm: &mut [f64],
    ) {
        assert_joints(
            self.joint_count(),
            &[
                position_rad.len(),
                velocity_rad_s.len(),
                acceleration_rad_s2.len(),
                torque_nm.len(),
            ],
        );
        let mut loaded = ArrayVec::new();
        self.load_links(
            position_rad,
            velocity_rad_s,
            acceleration_rad_s2,
            &mut loaded,
        );
        for (index, body) in self.bodies.iter().enumerate().rev() {
            let link: &LoadedLink = &loaded[index];
            torque_nm[index] = along_joint(body, &link.force_n, &link.moment_nm);
            if let Some(parent) = body.parent {
                let force_n = link.rotation * link.force_n;
                let moment_nm = link.rotation * link.moment_nm
                    + body.origin_m(position_rad[index]).cross(&force_n);
                loaded[parent].force_n += force_n;
                loaded[parent].moment_nm += moment_nm;
            }
        }
    }

    /// Force and moment that each augmented link's own motion takes, base to tips. Filled in place: a buffer
    /// this large would be copied on return.
    fn load_links(
        &self,
        position_rad: &[f64],
        velocity_rad_s: &[f64],
        acceleration_rad_s2: &[f64],
        loaded: &mut ArrayVec<LoadedLink, LINKS_MAX>,
    ) {
        let mut omega_rad_s = Vector3::zeros();
        let mut alpha_rad_s2 = Vector3::zeros();
        let mut field = Matrix3::zeros();
        // A base that accelerates upwards takes the same torques as gravity.
        let mut origin_m_s2 = -self.gravity_m_s2;
        let mut trunk: ArrayVec<LinkMotion, LINKS_MAX> = ArrayVec::new();
        let joints = position_rad
            .iter()
            .zip(velocity_rad_s)
            .zip(acceleration_rad_s2);
        for (body, ((&position, &velocity), &acceleration)) in self.bodies.iter().zip(joints) {
            if self.branches {
                let parent = body.parent.map(|parent| trunk[parent]);
                LinkMotion {
                    omega_rad_s,
                    alpha_rad_s2,
                    field,
                    origin_m_s2,
                } = parent.unwrap_or(LinkMotion::of_base(self));
            }
            let rotation = body.rotation(position);
            origin_m_s2 = rotation.tr_mul(&(origin_m_s2 + field * body.origin_m(position)));
            omega_rad_s = rotation.tr_mul(&omega_rad_s);
            alpha_rad_s2 = rotation.tr_mul(&alpha_rad_s2);
            let coriolis = Vector3::new(omega_rad_s.y * velocity, -omega_rad_s.x * velocity, 0.0);
            if body.slides {
                origin_m_s2 += 2.0 * coriolis + Vector3::new(0.0, 0.0, acceleration);
            } else {
                alpha_rad_s2 += Vector3::new(coriolis.x, coriolis.y, acceleration);
                omega_rad_s.z += velocity;
            }
            field = acceleration_field(&omega_rad_s, &alpha_rad_s2);
            if self.branches {
                trunk.push(LinkMotion {
                    omega_rad_s,
                    alpha_rad_s2,
                    field,
                    origin_m_s2,
                });
            }
            let (force_n, moment_nm) = load(body, &field, &origin_m_s2);
            loaded.push(LoadedLink {
                rotation,
                force_n,
                moment_nm,
            });
        }
    }
}

/// How a link moves, in its frame: the way to the tips of `load_links`, which runs in every cycle and is a tenth faster written out.
#[derive(Clone, Copy)]
pub(super) struct LinkMotion {
    omega_rad_s: Vector3<f64>,
    alpha_rad_s2: Vector3<f64>,
    /// `Ω`.
    pub(super) field: Matrix3<f64>,
    /// Of its origin.
    pub(super) origin_m_s2: Vector3<f64>,
}

impl LinkMotion {
    /// A base that accelerates upwards takes the same torques as gravity.
    pub(super) fn of_base(chain: &Chain) -> Self {
        Self {
            omega_rad_s: Vector3::zeros(),
            alpha_rad_s2: Vector3::zeros(),
            field: Matrix3::zeros(),
            origin_m_s2: -chain.gravity_m_s2,
        }
    }

    /// From a link to one that hangs on it, whose joint is at this position, velocity and acceleration. Returns the rotation
    /// from that one's frame to this one's.
    #[inline]
    pub(super) fn on_to(
        &mut self,
        body: &Body,
        [position, velocity, acceleration]: [f64; 3],
    ) -> Matrix3<f64> {
        let rotation = body.rotation(position);
        self.origin_m_s2 =
            rotation.tr_mul(&(self.origin_m_s2 + self.field * body.origin_m(position)));
        self.omega_rad_s = rotation.tr_mul(&self.omega_rad_s);
        self.alpha_rad_s2 = rotation.tr_mul(&self.alpha_rad_s2);
        let omega = &mut self.omega_rad_s;
        let coriolis = Vector3::new(omega.y * velocity, -omega.x * velocity, 0.0);
        if body.slides {
            self.origin_m_s2 += 2.0 * coriolis + Vector3::new(0.0, 0.0, acceleration);
        } else {
            self.alpha_rad_s2 += Vector3::new(coriolis.x, coriolis.y, acceleration);
            omega.z += velocity;
        }
        self.field = acceleration_field(&self.omega_rad_s, &self.alpha_rad_s2);
        rotation
    }
}

/// `Ω = [α]× + [ω]×[ω]×`.
#[inline]
fn acceleration_field(omega: &Vector3<f64>, alpha: &Vector3<f64>) -> Matrix3<f64> {
    let (xx, yy, zz) = (omega.x * omega.x, omega.y * omega.y, omega.z * omega.z);
    let (xy, xz, yz) = (omega.x * omega.y, omega.x * omega.z, omega.y * omega.z);
    Matrix3::new(
        -(yy + zz),
        xy - alpha.z,
        xz + alpha.y,
        xy + alpha.z,
        -(xx + zz),
        yz - alpha.x,
        xz - alpha.y,
        yz + alpha.x,
        -(xx + yy),
    )
}

/// What a joint feels of force and moment at its link: what acts along or about its axis.
#[inline]
pub(super) fn along_joint(body: &Body, force_n: &Vector3<f64>, moment_nm: &Vector3<f64>) -> f64 {
    if body.slides { force_n.z } else { moment_nm.z }
}

/// Force `∫ a + Ω r dm` and moment `∫ r × (a + Ω r) dm`; augmented links that turn are without mass at their origin, which
/// their parents have, and for those that slide it is added here.
#[inline]
pub(super) fn load(
    body: &Body,
    field: &Matrix3<f64>,
    origin_m_s2: &Vector3<f64>,
) -> (Vector3<f64>, Vector3<f64>) {
    let link = &body.augmented;
    let (h, s, f) = (&link.first_moment_kg_m, &link.second_moment_kg_m2, field);
    let about_origin_nm = Vector3::new(
        (f.m31 * s.xy + f.m32 * s.yy + f.m33 * s.yz) - (f.m21 * s.xz + f.m22 * s.yz + f.m23 * s.zz),
        (f.m11 * s.xz + f.m12 * s.yz + f.m13 * s.zz) - (f.m31 * s.xx + f.m32 * s.xy + f.m33 * s.xz),
        (f.m21 * s.xx + f.m22 * s.xy + f.m23 * s.xz) - (f.m11 * s.xy + f.m12 * s.yy + f.m13 * s.yz),
    );
    let mut force_n = field * h;
    if body.slides {
        force_n += body.at_origin_kg * origin_m_s2;
    }
    (force_n, about_origin_nm + h.cross(origin_m_s2))
}
