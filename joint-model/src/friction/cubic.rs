//! Cubic friction polynomial: dry friction and a drag whose slope changes twice.
//!
//! `T = sgn(ω)·(c_0 + c_1·|ω| + c_2·ω² + c_3·|ω|³)`, each direction with coefficients of its own. Source: Tuttle, MIT
//! AI-TR 1365 (1992), Coulomb friction with a cubic viscous term; the second of the three models of PA10-05, Table I,
//! whose four degrees of freedom are the coefficients. A fit holds between the velocities it was made at and may even
//! push beyond them, so this is a model to compare with and not part of [`SteadyFriction`](super::SteadyFriction).

use super::Direction;

/// The coefficients of one direction, as magnitudes that oppose motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CubicRow {
    /// `c_0`, level at the limit of speed zero.
    pub c0_nm: f64,
    /// `c_1`, slope there.
    pub c1_nm_s_rad: f64,
    /// `c_2`.
    pub c2_nm_s2_rad2: f64,
    /// `c_3`.
    pub c3_nm_s3_rad3: f64,
}

impl CubicRow {
    /// Friction at a speed, opposing the motion where positive.
    pub fn level_nm(&self, speed_rad_s: f64) -> f64 {
        let bend_nm_s_rad = (self.c3_nm_s3_rad3 * speed_rad_s + self.c2_nm_s2_rad2) * speed_rad_s;
        self.c0_nm + (self.c1_nm_s_rad + bend_nm_s_rad) * speed_rad_s
    }
}

/// The polynomial with a row for each direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CubicFriction {
    /// Motion in the positive direction.
    pub positive: CubicRow,
    /// Motion in the negative direction.
    pub negative: CubicRow,
}

impl CubicFriction {
    /// The row that applies to a direction.
    pub fn row(&self, direction: Direction) -> &CubicRow {
        match direction {
            Direction::Positive => &self.positive,
            Direction::Negative => &self.negative,
        }
    }

    /// Torque to spend against friction, positive with positive velocity; none at rest, where the direction is open.
    pub fn drag_nm(&self, velocity_rad_s: f64) -> f64 {
        if velocity_rad_s == 0.0 {
            return 0.0;
        }
        let direction = Direction::of(velocity_rad_s);
        direction.sign() * self.row(direction).level_nm(velocity_rad_s.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::{QuadraticFriction, ViscousFriction};

    const ROW: CubicRow = CubicRow {
        c0_nm: 40.0,
        c1_nm_s_rad: 90.0,
        c2_nm_s2_rad2: -200.0,
        c3_nm_s3_rad3: 250.0,
    };

    #[test]
    fn takes_energy_where_its_level_is_positive() {
        let law = CubicFriction {
            positive: ROW,
            negative: CubicRow { c0_nm: 41.0, ..ROW },
        };
        for velocity_rad_s in [-0.4, -0.02, 0.0, 1e-9, 0.02, 0.4] {
            assert!(law.drag_nm(velocity_rad_s) * velocity_rad_s >= 0.0);
        }
    }

    #[test]
    fn is_odd_with_equal_rows_and_vanishes_at_rest() {
        let law = CubicFriction {
            positive: ROW,
            negative: ROW,
        };
        for velocity_rad_s in [1e-9, 0.1, 0.4] {
            assert_eq!(law.drag_nm(-velocity_rad_s), -law.drag_nm(velocity_rad_s));
        }
        assert_eq!(law.drag_nm(0.0), 0.0);
    }

    #[test]
    fn each_direction_has_its_own_row() {
        let law = CubicFriction {
            positive: ROW,
            negative: CubicRow::default(),
        };
        assert_eq!(law.drag_nm(-0.3), 0.0);
        assert_eq!(law.drag_nm(0.3), ROW.level_nm(0.3));
    }

    #[test]
    fn without_a_cubic_term_it_is_coulomb_viscous_and_quadratic_friction() {
        let row = CubicRow {
            c3_nm_s3_rad3: 0.0,
            ..ROW
        };
        let law = CubicFriction {
            positive: row,
            negative: row,
        };
        let viscous = ViscousFriction {
            viscous_nm_s_rad: row.c1_nm_s_rad,
        };
        let quadratic = QuadraticFriction {
            quadratic_nm_s2_rad2: row.c2_nm_s2_rad2,
        };
        for velocity_rad_s in [-0.4_f64, -0.02, 0.02, 0.4] {
            let sum_nm = row.c0_nm.copysign(velocity_rad_s)
                + viscous.drag_nm(velocity_rad_s)
                + quadratic.drag_nm(velocity_rad_s);
            assert!((law.drag_nm(velocity_rad_s) - sum_nm).abs() < 1e-12);
        }
    }

    #[test]
    fn a_polynomial_is_worth_its_value() {
        // 40 + 9 - 2 + 0.25
        assert!((ROW.level_nm(0.1) - 47.25).abs() < 1e-12);
    }
}
