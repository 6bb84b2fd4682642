//! Torsional compliance: the gear twists under load.
//!
//! Three laws, each torque from torsion, torsion from torque, stiffness and stored energy:
//! [`LinearCompliance`], the first term of SD eq (9); [`CatalogueCompliance`], the makers' three slopes `K1`, `K2`,
//! `K3` with knee torques `T1`, `T2` (Harmonic Drive, engineering data); [`ArctanCompliance`], SD eq (6).

use core::f64::consts::FRAC_PI_2;

/// An elastic law: odd, rising, without memory.
pub trait Spring {
    /// Torque at a torsion.
    fn torque_nm(&self, torsion_rad: f64) -> f64;
    /// Torsion at a torque; undoes [`Spring::torque_nm`].
    fn torsion_rad(&self, torque_nm: f64) -> f64;
    /// Slope of the torque at a torsion.
    fn stiffness_nm_rad(&self, torsion_rad: f64) -> f64;
    /// Energy stored at a torsion.
    fn energy_j(&self, torsion_rad: f64) -> f64;
}

/// One stiffness: `T = K·Δθ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearCompliance {
    /// `K`. Positive.
    pub stiffness_nm_rad: f64,
}

impl Spring for LinearCompliance {
    fn torque_nm(&self, torsion_rad: f64) -> f64 {
        self.stiffness_nm_rad * torsion_rad
    }

    fn torsion_rad(&self, torque_nm: f64) -> f64 {
        torque_nm / self.stiffness_nm_rad
    }

    fn stiffness_nm_rad(&self, _torsion_rad: f64) -> f64 {
        self.stiffness_nm_rad
    }

    fn energy_j(&self, torsion_rad: f64) -> f64 {
        0.5 * self.stiffness_nm_rad * torsion_rad * torsion_rad
    }
}

/// The catalogue's three slopes; the gear stiffens as more teeth engage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CatalogueCompliance {
    /// `K1` below `T1`, `K2` up to `T2`, `K3` above. Positive.
    pub stiffness_nm_rad: [f64; 3],
    /// `T1` and `T2`, rising.
    pub knees_nm: [f64; 2],
}

impl CatalogueCompliance {
    /// Torsion at the two knees.
    fn knees_rad(&self) -> [f64; 2] {
        let [t1, t2] = self.knees_nm;
        let [k1, k2, _] = self.stiffness_nm_rad;
        [t1 / k1, t1 / k1 + (t2 - t1) / k2]
    }

    /// The same knees with all three stiffnesses multiplied.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            stiffness_nm_rad: self.stiffness_nm_rad.map(|stiffness| stiffness * factor),
            knees_nm: self.knees_nm,
        }
    }
}

impl Spring for CatalogueCompliance {
    fn torque_nm(&self, torsion_rad: f64) -> f64 {
        let size_rad = torsion_rad.abs();
        let [knee_1_rad, knee_2_rad] = self.knees_rad();
        let [k1, k2, k3] = self.stiffness_nm_rad;
        let size_nm = if size_rad < knee_1_rad {
            k1 * size_rad
        } else if size_rad < knee_2_rad {
            self.knees_nm[0] + k2 * (size_rad - knee_1_rad)
        } else {
            self.knees_nm[1] + k3 * (size_rad - knee_2_rad)
        };
        size_nm.copysign(torsion_rad)
    }

    fn torsion_rad(&self, torque_nm: f64) -> f64 {
        let size_nm = torque_nm.abs();
        let [knee_1_rad, knee_2_rad] = self.knees_rad();
        let [k1, k2, k3] = self.stiffness_nm_rad;
        let size_rad = if size_nm < self.knees_nm[0] {
            size_nm / k1
        } else if size_nm < self.knees_nm[1] {
            knee_1_rad + (size_nm - self.knees_nm[0]) / k2
        } else {
            knee_2_rad + (size_nm - self.knees_nm[1]) / k3
        };
        size_rad.copysign(torque_nm)
    }

    fn stiffness_nm_rad(&self, torsion_rad: f64) -> f64 {
        let [knee_1_rad, knee_2_rad] = self.knees_rad();
        let size_rad = torsion_rad.abs();
        let slope = usize::from(size_rad >= knee_1_rad) + usize::from(size_rad >= knee_2_rad);
        self.stiffness_nm_rad[slope]
    }

    fn energy_j(&self, torsion_rad: f64) -> f64 {
        let size_rad = torsion_rad.abs();
        let [knee_1_rad, knee_2_rad] = self.knees_rad();
        let [k1, k2, k3] = self.stiffness_nm_rad;
        let first_rad = size_rad.min(knee_1_rad);
        let second_rad = (size_rad.min(knee_2_rad) - knee_1_rad).max(0.0);
        let third_rad = (size_rad - knee_2_rad).max(0.0);
        0.5 * k1 * first_rad * first_rad
            + (self.knees_nm[0] + 0.5 * k2 * second_rad) * second_rad
            + (self.knees_nm[1] + 0.5 * k3 * third_rad) * third_rad
    }
}

/// SD eq (6): `Δθ = arctan(C·T)/(C·K_0)`, a stiffness that grows with torque.
///
/// The law bounds torsion by `π/2/(C·K_0)`, where torque is infinite; beyond 99 % of it the curve goes on as a straight
/// line, so that no torsion gives an infinite torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArctanCompliance {
    /// `K_0`, stiffness without load. Positive.
    pub stiffness_nm_rad: f64,
    /// `C`. SD Table II prints its unit as Nm; it is 1/Nm. Positive.
    pub stiffening_per_nm: f64,
}

impl ArctanCompliance {
    const ANGLE_MAX: f64 = 0.99 * FRAC_PI_2;

    fn angle(&self, torsion_rad: f64) -> f64 {
        self.stiffening_per_nm * self.stiffness_nm_rad * torsion_rad
    }
}

impl Spring for ArctanCompliance {
    fn torque_nm(&self, torsion_rad: f64) -> f64 {
        let angle = self.angle(torsion_rad);
        let inside = angle.clamp(-Self::ANGLE_MAX, Self::ANGLE_MAX);
        let tangent = inside.tan();
        (tangent + (angle - inside) * (1.0 + tangent * tangent)) / self.stiffening_per_nm
    }

    fn torsion_rad(&self, torque_nm: f64) -> f64 {
        let tangent = self.stiffening_per_nm * torque_nm;
        let tangent_max = Self::ANGLE_MAX.tan();
        let inside = tangent.clamp(-tangent_max, tangent_max);
        let angle = inside.atan() + (tangent - inside) / (1.0 + tangent_max * tangent_max);
        angle / (self.stiffening_per_nm * self.stiffness_nm_rad)
    }

    fn stiffness_nm_rad(&self, torsion_rad: f64) -> f64 {
        let inside = self
            .angle(torsion_rad)
            .clamp(-Self::ANGLE_MAX, Self::ANGLE_MAX);
        self.stiffness_nm_rad * (1.0 + inside.tan().powi(2))
    }

    fn energy_j(&self, torsion_rad: f64) -> f64 {
        let angle = self.angle(torsion_rad).abs();
        let inside = angle.min(Self::ANGLE_MAX);
        let tangent = inside.tan();
        let beyond = angle - inside;
        let area = -inside.cos().ln()
            + tangent * beyond
            + 0.5 * (1.0 + tangent * tangent) * beyond * beyond;
        area / (self.stiffening_per_nm * self.stiffening_per_nm * self.stiffness_nm_rad)
    }
}

#[cfg(test)]
pub(super) mod laws {
    use super::Spring;

    /// What every spring owes: odd, rising, invertible, and energy whose slope is the torque.
    pub fn holds(spring: &impl Spring, torsions_rad: &[f64]) {
        assert_eq!(spring.torque_nm(0.0), 0.0);
        assert_eq!(spring.energy_j(0.0), 0.0);
        for &torsion_rad in torsions_rad {
            let torque_nm = spring.torque_nm(torsion_rad);
            let small_rad = 1e-6 * torsion_rad;
            assert_eq!(spring.torque_nm(-torsion_rad), -torque_nm, "odd");
            assert!(
                (spring.torsion_rad(torque_nm) / torsion_rad - 1.0).abs() < 1e-9,
                "invertible"
            );
            let slope = (spring.torque_nm(torsion_rad + small_rad)
                - spring.torque_nm(torsion_rad - small_rad))
                / (2.0 * small_rad);
            assert!(
                (slope / spring.stiffness_nm_rad(torsion_rad) - 1.0).abs() < 1e-5,
                "stiffness is the slope"
            );
            assert!(slope > 0.0, "rising");
            let power = (spring.energy_j(torsion_rad + small_rad)
                - spring.energy_j(torsion_rad - small_rad))
                / (2.0 * small_rad);
            assert!(
                (power / torque_nm - 1.0).abs() < 1e-5,
                "torque is the slope of the energy at {torsion_rad}"
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CSF-32-50, Harmonic Drive engineering data.
    const CSF_32_50: CatalogueCompliance = CatalogueCompliance {
        stiffness_nm_rad: [5.4e4, 7.8e4, 9.8e4],
        knees_nm: [29.0, 108.0],
    };

    #[test]
    fn every_law_is_a_spring() {
        laws::holds(
            &LinearCompliance {
                stiffness_nm_rad: 8333.0,
            },
            &[1e-5, 1e-3, 0.1],
        );
        laws::holds(&CSF_32_50, &[1e-4, 1e-3, 1e-2]);
        // SD Table II with C in 1/Nm: torsion is bounded by 2.1 mrad, the last two points lie on the line beyond
        laws::holds(
            &ArctanCompliance {
                stiffness_nm_rad: 8333.0,
                stiffening_per_nm: 0.089,
            },
            &[1e-5, 1e-3, 2e-3, 2.2e-3, 1e-2],
        );
    }

    #[test]
    fn the_catalogue_curve_is_continuous_at_its_knees() {
        for knee_nm in CSF_32_50.knees_nm {
            let knee_rad = CSF_32_50.torsion_rad(knee_nm);
            assert!((CSF_32_50.torque_nm(knee_rad * (1.0 - 1e-9)) - knee_nm).abs() < 1e-6);
            assert!((CSF_32_50.torque_nm(knee_rad * (1.0 + 1e-9)) - knee_nm).abs() < 1e-6);
        }
    }

    #[test]
    fn arctan_is_equation_6_where_the_equation_is_defined() {
        let spring = ArctanCompliance {
            stiffness_nm_rad: 8333.0,
            stiffening_per_nm: 0.089,
        };
        for torque_nm in [0.5, 5.0, 16.0] {
            let torsion_rad = (0.089_f64 * torque_nm).atan() / (0.089 * 8333.0);
            assert!((spring.torsion_rad(torque_nm) - torsion_rad).abs() < 1e-15);
        }
    }
}
