//! Soft wind-up: the gear is much softer near zero load, before the teeth seat.
//!
//! Below the knee torque `T = K_low·Δθ`; above it the main spring's curve goes on from its own knee torque, so only
//! the lost motion is added. Source: PA10-05, section IV-D and ref. [21] (Nye, Kraml): "very low stiffness at low
//! applied loads"; PA10-03, Figs. 5 and 7.

use super::Spring;

/// A spring with a soft start. A `low_stiffness_nm_rad` above the main spring's slope would be a hard start; nothing
/// forbids it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftWindup<S> {
    /// The curve above the knee.
    pub main: S,
    /// Stiffness below the knee torque. Positive.
    pub low_stiffness_nm_rad: f64,
    /// Knee torque.
    pub knee_nm: f64,
}

impl<S: Spring> SoftWindup<S> {
    fn knee_rad(&self) -> f64 {
        self.knee_nm / self.low_stiffness_nm_rad
    }

    /// Torsion of the main spring when the whole is twisted by `size_rad`, at or above the knee.
    fn main_torsion_rad(&self, size_rad: f64) -> f64 {
        self.main.torsion_rad(self.knee_nm) + size_rad - self.knee_rad()
    }
}

impl<S: Spring> Spring for SoftWindup<S> {
    fn torque_nm(&self, torsion_rad: f64) -> f64 {
        let size_rad = torsion_rad.abs();
        if size_rad <= self.knee_rad() {
            return self.low_stiffness_nm_rad * torsion_rad;
        }
        self.main
            .torque_nm(self.main_torsion_rad(size_rad))
            .copysign(torsion_rad)
    }

    fn torsion_rad(&self, torque_nm: f64) -> f64 {
        let size_nm = torque_nm.abs();
        if size_nm <= self.knee_nm {
            return torque_nm / self.low_stiffness_nm_rad;
        }
        let size_rad =
            self.knee_rad() + self.main.torsion_rad(size_nm) - self.main.torsion_rad(self.knee_nm);
        size_rad.copysign(torque_nm)
    }

    fn stiffness_nm_rad(&self, torsion_rad: f64) -> f64 {
        let size_rad = torsion_rad.abs();
        if size_rad <= self.knee_rad() {
            return self.low_stiffness_nm_rad;
        }
        self.main.stiffness_nm_rad(self.main_torsion_rad(size_rad))
    }

    fn energy_j(&self, torsion_rad: f64) -> f64 {
        let size_rad = torsion_rad.abs();
        let soft_rad = size_rad.min(self.knee_rad());
        let soft_j = 0.5 * self.low_stiffness_nm_rad * soft_rad * soft_rad;
        if size_rad <= self.knee_rad() {
            return soft_j;
        }
        let main_j = self.main.energy_j(self.main_torsion_rad(size_rad));
        soft_j + main_j - self.main.energy_j(self.main.torsion_rad(self.knee_nm))
    }
}

#[cfg(test)]
mod tests {
    use super::super::compliance::laws;
    use super::super::{CatalogueCompliance, LinearCompliance};
    use super::*;

    const SOFT: SoftWindup<CatalogueCompliance> = SoftWindup {
        main: CatalogueCompliance {
            stiffness_nm_rad: [5.4e4, 7.8e4, 9.8e4],
            knees_nm: [29.0, 108.0],
        },
        low_stiffness_nm_rad: 1.5e4,
        knee_nm: 6.0,
    };

    #[test]
    fn is_a_spring() {
        laws::holds(&SOFT, &[1e-4, 6e-4, 1e-2]);
    }

    #[test]
    fn is_continuous_at_its_knee() {
        let knee_rad = SOFT.torsion_rad(SOFT.knee_nm);
        assert!((SOFT.torque_nm(knee_rad * (1.0 + 1e-12)) - SOFT.knee_nm).abs() < 1e-9);
    }

    #[test]
    fn only_lost_motion_is_added_above_the_knee() {
        let lost_rad = |torque_nm| SOFT.torsion_rad(torque_nm) - SOFT.main.torsion_rad(torque_nm);
        assert!(lost_rad(6.0) > 0.0);
        assert!((lost_rad(6.0) - lost_rad(100.0)).abs() < 1e-15);
    }

    #[test]
    fn equal_stiffness_changes_nothing() {
        let main = LinearCompliance {
            stiffness_nm_rad: 8333.0,
        };
        let spring = SoftWindup {
            main,
            low_stiffness_nm_rad: 8333.0,
            knee_nm: 2.0,
        };
        for torsion_rad in [-1e-3, 1e-5, 1e-3] {
            assert!((spring.torque_nm(torsion_rad) - main.torque_nm(torsion_rad)).abs() < 1e-12);
        }
    }
}
