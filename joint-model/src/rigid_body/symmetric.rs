//! Symmetric 3×3 matrices by their six elements.

use std::ops::{Add, AddAssign};

use nalgebra::{Matrix3, Vector3};

#[derive(Clone, Copy, Debug)]
pub(super) struct Symmetric3 {
    pub(super) xx: f64,
    pub(super) xy: f64,
    pub(super) xz: f64,
    pub(super) yy: f64,
    pub(super) yz: f64,
    pub(super) zz: f64,
}

impl Symmetric3 {
    /// The symmetric part of `matrix`.
    pub(super) fn of(matrix: &Matrix3<f64>) -> Self {
        Self {
            xx: matrix.m11,
            xy: 0.5 * (matrix.m12 + matrix.m21),
            xz: 0.5 * (matrix.m13 + matrix.m31),
            yy: matrix.m22,
            yz: 0.5 * (matrix.m23 + matrix.m32),
            zz: matrix.m33,
        }
    }

    #[inline]
    pub(super) fn rows(&self) -> [Vector3<f64>; 3] {
        [
            Vector3::new(self.xx, self.xy, self.xz),
            Vector3::new(self.xy, self.yy, self.yz),
            Vector3::new(self.xz, self.yz, self.zz),
        ]
    }

    #[inline]
    pub(super) fn times(&self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    /// `R S Rᵀ`.
    #[inline]
    pub(super) fn turned(&self, r: &Matrix3<f64>) -> Self {
        // Columns of R S.
        let [a, b, c] = self.rows().map(|row| r * row);
        Self {
            xx: a.x * r.m11 + b.x * r.m12 + c.x * r.m13,
            xy: a.x * r.m21 + b.x * r.m22 + c.x * r.m23,
            xz: a.x * r.m31 + b.x * r.m32 + c.x * r.m33,
            yy: a.y * r.m21 + b.y * r.m22 + c.y * r.m23,
            yz: a.y * r.m31 + b.y * r.m32 + c.y * r.m33,
            zz: a.z * r.m31 + b.z * r.m32 + c.z * r.m33,
        }
    }

    /// `R S Rᵀ` for an `S` whose z row and column are zero.
    #[inline]
    pub(super) fn planar_turned(&self, r: &Matrix3<f64>) -> Self {
        let (x, y) = (
            Vector3::new(r.m11, r.m21, r.m31),
            Vector3::new(r.m12, r.m22, r.m32),
        );
        // First two columns of R S.
        let a = x * self.xx + y * self.xy;
        let b = x * self.xy + y * self.yy;
        Self {
            xx: a.x * x.x + b.x * y.x,
            xy: a.x * x.y + b.x * y.y,
            xz: a.x * x.z + b.x * y.z,
            yy: a.y * x.y + b.y * y.y,
            yz: a.y * x.z + b.y * y.z,
            zz: a.z * x.z + b.z * y.z,
        }
    }
}

impl Add for Symmetric3 {
    type Output = Self;

    #[inline]
    fn add(mut self, other: Self) -> Self {
        self += &other;
        self
    }
}

impl AddAssign<&Self> for Symmetric3 {
    #[inline]
    fn add_assign(&mut self, other: &Self) {
        self.xx += other.xx;
        self.xy += other.xy;
        self.xz += other.xz;
        self.yy += other.yy;
        self.yz += other.yz;
        self.zz += other.zz;
    }
}
