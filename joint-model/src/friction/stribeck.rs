//! Stribeck friction: the level between breakaway and sliding.
//!
//! Two forms of one law:
//!
//! - [`StribeckCurve`], PA10-05 eq (7): `T = F_0·sgn(ω) + F_v·ω + F_s·(1 - exp(-ω/V_c))`, one row of Table II per
//!   direction. The table prints `F_s` and `V_c` of the negative direction with the sign of the motion; here both
//!   directions hold magnitudes, so that `F_s > 0` is friction that rises from rest (joints 1 to 6) and `F_s < 0`
//!   friction that falls (joint 7).
//! - [`StribeckFriction`]: `F_b·exp(-|ω|/V_c)` on top of another level. Eq (7) is Coulomb friction `F_0 + F_s`
//!   with `F_b = -F_s`.

use super::{Direction, DryFriction, Sliding};

/// Breakaway excess over the sliding level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StribeckFriction {
    /// Breakaway minus sliding friction; negative where friction rises from rest.
    pub stribeck_nm: f64,
    /// Velocity at which the excess has fallen to 1/e. Positive.
    pub stribeck_velocity_rad_s: f64,
}

impl DryFriction for StribeckFriction {
    fn level_nm(&self, at: &Sliding) -> f64 {
        self.stribeck_nm * (-at.speed_rad_s / self.stribeck_velocity_rad_s).exp()
    }
}

/// One direction of PA10-05 Table II, as magnitudes that oppose motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StribeckRow {
    /// `F_0`, level at rest.
    pub f0_nm: f64,
    /// `F_v`, viscous slope.
    pub fv_nm_s_rad: f64,
    /// `F_s`, by how much the level rises from rest.
    pub fs_nm: f64,
    /// `V_c`, velocity over which it rises. Positive.
    pub vc_rad_s: f64,
}

impl StribeckRow {
    fn level_nm(&self, speed_rad_s: f64) -> f64 {
        self.f0_nm + self.fs_nm * (1.0 - (-speed_rad_s / self.vc_rad_s).exp())
    }
}

/// PA10-05 eq (7) with a row for each direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StribeckCurve {
    /// Motion in the positive direction.
    pub positive: StribeckRow,
    /// Motion in the negative direction.
    pub negative: StribeckRow,
}

impl StribeckCurve {
    /// The row that applies to a direction.
    pub fn row(&self, direction: Direction) -> &StribeckRow {
        match direction {
            Direction::Positive => &self.positive,
            Direction::Negative => &self.negative,
        }
    }

    /// The viscous term `F_v·ω`, with the sign of the velocity.
    pub fn viscous_drag_nm(&self, velocity_rad_s: f64) -> f64 {
        self.row(Direction::of(velocity_rad_s)).fv_nm_s_rad * velocity_rad_s
    }
}

impl DryFriction for StribeckCurve {
    /// Eq (7) without its viscous term.
    fn level_nm(&self, at: &Sliding) -> f64 {
        self.row(at.direction).level_nm(at.speed_rad_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Joint 2 of PA10-05 Table II.
    const JOINT_2: StribeckCurve = StribeckCurve {
        positive: StribeckRow {
            f0_nm: 39.9709,
            fv_nm_s_rad: 35.3200,
            fs_nm: 6.2713,
            vc_rad_s: 0.0685,
        },
        negative: StribeckRow {
            f0_nm: 41.3113,
            fv_nm_s_rad: 35.8947,
            fs_nm: 5.9018,
            vc_rad_s: 0.0709,
        },
    };

    fn eq_7_nm(f0: f64, fv: f64, fs: f64, vc: f64, v: f64) -> f64 {
        f0 * v.signum() + fv * v + fs * (1.0 - (-v / vc).exp())
    }

    #[test]
    fn is_equation_7_in_both_directions() {
        let drag_nm =
            |v: f64| v.signum() * JOINT_2.level_nm(&Sliding::at(v)) + JOINT_2.viscous_drag_nm(v);
        for v in [0.02, 0.1, 0.4] {
            assert!((drag_nm(v) - eq_7_nm(39.9709, 35.3200, 6.2713, 0.0685, v)).abs() < 1e-12);
            // as printed: F_s and V_c carry the sign of the motion
            assert!((drag_nm(-v) - eq_7_nm(41.3113, 35.8947, -5.9018, -0.0709, -v)).abs() < 1e-12);
        }
    }

    #[test]
    fn the_two_forms_are_one_law() {
        let row = JOINT_2.positive;
        let breakaway = StribeckFriction {
            stribeck_nm: -row.fs_nm,
            stribeck_velocity_rad_s: row.vc_rad_s,
        };
        for v in [0.0, 0.01, 0.1, 2.0] {
            let at = Sliding::at(v);
            let level_nm = row.f0_nm + row.fs_nm + breakaway.level_nm(&at);
            assert!((JOINT_2.level_nm(&at) - level_nm).abs() < 1e-12);
        }
    }

    #[test]
    fn starts_at_breakaway_and_vanishes_at_speed() {
        let law = StribeckFriction {
            stribeck_nm: 4.0,
            stribeck_velocity_rad_s: 0.05,
        };
        assert_eq!(law.level_nm(&Sliding::at(0.0)), 4.0);
        assert!(law.level_nm(&Sliding::at(-1.0)) < 1e-7);
    }
}
