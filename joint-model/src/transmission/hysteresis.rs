//! Torsional hysteresis: winding up takes more torque than unwinding gives back, at any rate.
//!
//! Dahl's element in parallel with the spring: `dT_h/dΔθ = (W/2 - T_h·sgn(Δθ̇))/Δθ_y`, integrated exactly along the
//! twist, so it depends on the path and not on the rate or the step. Source: Dahl, AIAA Journal 14 (1976) 1675–1682,
//! exponent 1; hysteresis of harmonic drives: Kircanski, Goldenberg, Int. J. Robotics Research 16 (1997) 214–239.
//! Left out: a width that depends on the load.

/// A rate-independent loop around the spring's curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorsionalHysteresis {
    /// `W`: torque between the winding and the unwinding branch once both are developed.
    pub width_nm: f64,
    /// `Δθ_y`: twist over which the torque changes branch (to 1/e of the way). Positive.
    pub yield_rad: f64,
}

impl TorsionalHysteresis {
    /// Torque of the element after a further twist; its torque before is its state.
    pub fn advance_nm(&self, torque_nm: f64, twist_rad: f64) -> f64 {
        let branch_nm = (0.5 * self.width_nm).copysign(twist_rad);
        branch_nm + (torque_nm - branch_nm) * (-twist_rad.abs() / self.yield_rad).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOP: TorsionalHysteresis = TorsionalHysteresis {
        width_nm: 4.0,
        yield_rad: 1e-4,
    };

    fn twist(mut torque_nm: f64, from_rad: f64, to_rad: f64, steps: usize) -> (f64, f64) {
        let twist_rad = (to_rad - from_rad) / steps as f64;
        let mut spent_j = 0.0;
        for _ in 0..steps {
            let after_nm = LOOP.advance_nm(torque_nm, twist_rad);
            spent_j += 0.5 * (torque_nm + after_nm) * twist_rad;
            torque_nm = after_nm;
        }
        (torque_nm, spent_j)
    }

    #[test]
    fn the_torque_does_not_depend_on_how_the_path_is_cut() {
        let (coarse_nm, _) = twist(0.3, 0.0, 2e-4, 1);
        let (fine_nm, _) = twist(0.3, 0.0, 2e-4, 1000);
        assert!((coarse_nm - fine_nm).abs() < 1e-12);
    }

    #[test]
    fn the_branches_lie_the_width_apart_and_bound_the_torque() {
        let (up_nm, _) = twist(0.0, 0.0, 1e-2, 100);
        let (down_nm, _) = twist(up_nm, 1e-2, -1e-2, 100);
        assert!((up_nm - down_nm - LOOP.width_nm).abs() < 1e-9);
    }

    #[test]
    fn a_closed_loop_takes_energy_and_standing_still_changes_nothing() {
        let (up_nm, up_j) = twist(-2.0, -1e-3, 1e-3, 2000);
        let (_, down_j) = twist(up_nm, 1e-3, -1e-3, 2000);
        assert!(up_j + down_j > 0.0);
        assert_eq!(LOOP.advance_nm(1.1, 0.0), 1.1);
    }
}
