//! LuGre friction: bristles that bend before they slide.
//!
//! `dz/dt = ω - σ_0·|ω|/g·z`, `T = σ_0·z + σ_1(ω)·dz/dt`, with the steady level `g > 0` as an argument: any sum of
//! [`DryFriction`](super::DryFriction) laws, so the level may depend on velocity, direction, load, position and
//! temperature. At constant velocity `T = g·sgn(ω)`. Viscous drag is not in here; the caller adds it.
//!
//! Source: Canudas de Wit, Olsson, Åström, Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419–425, eqs (1)–(3);
//! `σ_1(ω) = σ_1·exp(-(ω/v_d)²)` after Olsson, Åström, Canudas de Wit, Gäfvert, Lischinsky, European Journal of
//! Control 4 (1998) 176–195: with constant σ_1 the bristles can return energy at speed.
//! Left out: non-local memory; the LuGre bristle creeps under a load that oscillates below breakaway.

/// Least deflection at which bristles slide, so that a joint without friction is a limit and not a division by zero.
const DEFLECTION_MIN_RAD: f64 = 1e-12;

/// Bristles of one joint, joint side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuGre {
    /// `σ_0`: stiffness before sliding. Positive.
    pub stiffness_nm_rad: f64,
    /// `σ_1`: damping before sliding.
    pub damping_nm_s_rad: f64,
    /// `v_d`: velocity beyond which the bristle damping fades. Positive.
    pub damping_velocity_rad_s: f64,
}

/// One step of the bristles, still open in the velocity at its end: drag is a line in that velocity.
///
/// Solving the joint's velocity together with this line makes the step stable for any stiffness and step length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BristleStep {
    /// Drag if the joint stands still at the end of the step.
    pub drag_at_rest_nm: f64,
    /// Change of the drag with the velocity at the end of the step; never negative.
    pub drag_slope_nm_s_rad: f64,
    retained: f64,
    bristle_rad: f64,
    bristle_max_rad: f64,
    step_s: f64,
}

impl LuGre {
    /// Begins a step of length `step_s` from bristle deflection `bristle_rad` at `velocity_rad_s`; backward Euler in
    /// the deflection, the level held.
    pub fn begin_step(
        &self,
        bristle_rad: f64,
        velocity_rad_s: f64,
        level_nm: f64,
        step_s: f64,
    ) -> BristleStep {
        let bristle_max_rad = (level_nm / self.stiffness_nm_rad).max(DEFLECTION_MIN_RAD);
        let retained = 1.0 / (1.0 + step_s * velocity_rad_s.abs() / bristle_max_rad);
        let fade = (-(velocity_rad_s / self.damping_velocity_rad_s).powi(2)).exp();
        let damping_nm_s_rad = self.damping_nm_s_rad * fade;
        BristleStep {
            drag_at_rest_nm: (self.stiffness_nm_rad * retained
                + damping_nm_s_rad * (retained - 1.0) / step_s)
                * bristle_rad,
            drag_slope_nm_s_rad: (self.stiffness_nm_rad * step_s + damping_nm_s_rad) * retained,
            retained,
            bristle_rad,
            bristle_max_rad,
            step_s,
        }
    }
}

impl BristleStep {
    /// Bristle deflection at the end of the step. It does not grow beyond what the level can bend, and falls back
    /// without a jump where the level has dropped.
    pub fn end_rad(&self, velocity_rad_s: f64) -> f64 {
        let bristle_rad = self.retained * (self.bristle_rad + self.step_s * velocity_rad_s);
        let limit_rad = self.bristle_max_rad.max(self.bristle_rad.abs());
        bristle_rad.clamp(-limit_rad, limit_rad)
    }

    /// Drag over the step, positive with positive velocity once it slides.
    pub fn drag_nm(&self, velocity_rad_s: f64) -> f64 {
        self.drag_at_rest_nm + self.drag_slope_nm_s_rad * velocity_rad_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BRISTLES: LuGre = LuGre {
        stiffness_nm_rad: 4e4,
        damping_nm_s_rad: 100.0,
        damping_velocity_rad_s: 0.01,
    };
    const STEP_S: f64 = 1e-4;

    /// Slides at a given velocity and returns the last drag.
    fn slide_nm(velocity_rad_s: f64, level_nm: f64, seconds: f64, step_s: f64) -> f64 {
        let (mut bristle_rad, mut drag_nm) = (0.0, 0.0);
        for _ in 0..(seconds / step_s) as usize {
            let step = BRISTLES.begin_step(bristle_rad, velocity_rad_s, level_nm, step_s);
            drag_nm = step.drag_nm(velocity_rad_s);
            bristle_rad = step.end_rad(velocity_rad_s);
        }
        drag_nm
    }

    #[test]
    fn steady_sliding_gives_the_level_whatever_the_step() {
        for velocity_rad_s in [0.02, 0.1, 2.0] {
            for step_s in [1e-5, 1e-4, 1e-3] {
                assert!((slide_nm(velocity_rad_s, 40.0, 1.0, step_s) - 40.0).abs() < 1e-6);
                assert!((slide_nm(-velocity_rad_s, 40.0, 1.0, step_s) + 40.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn before_sliding_it_is_a_spring() {
        let drag_nm = slide_nm(1e-3, 40.0, 0.01, 1e-6);
        let spring_nm = BRISTLES.stiffness_nm_rad * 1e-5;
        assert!((drag_nm - BRISTLES.damping_nm_s_rad * 1e-3 - spring_nm).abs() < 0.02 * spring_nm);
    }

    #[test]
    fn a_closed_cycle_never_gives_energy() {
        for amplitude_rad in [1e-5, 1e-3, 0.1] {
            let (mut bristle_rad, mut spent_j) = (0.0, 0.0);
            for k in 0..40_000 {
                let velocity_rad_s = amplitude_rad * 6.0 * (6.0 * f64::from(k) * STEP_S).cos();
                let level_nm = 30.0 + 10.0 * (-velocity_rad_s.abs() / 0.05).exp();
                let step = BRISTLES.begin_step(bristle_rad, velocity_rad_s, level_nm, STEP_S);
                spent_j += step.drag_nm(velocity_rad_s) * velocity_rad_s * STEP_S;
                bristle_rad = step.end_rad(velocity_rad_s);
                let stored_j = 0.5 * BRISTLES.stiffness_nm_rad * bristle_rad * bristle_rad;
                assert!(spent_j >= -1e-9, "gave {spent_j} J back");
                assert!(stored_j <= 0.5 * 40.0 * 40.0 / BRISTLES.stiffness_nm_rad + 1e-9);
            }
            assert!(spent_j > 0.0);
        }
    }

    #[test]
    fn without_friction_nothing_is_left() {
        for velocity_rad_s in [-1.0, 0.0, 1e-3] {
            let step = BRISTLES.begin_step(0.0, velocity_rad_s, 0.0, STEP_S);
            assert!(step.drag_nm(velocity_rad_s).abs() < 1e-5);
        }
    }

    #[test]
    fn a_mass_on_the_implicit_line_stays_stable_with_a_huge_step() {
        let (mut bristle_rad, mut velocity_rad_s) = (0.0, 1.0);
        let (inertia_kg_m2, step_s) = (0.01, 0.01);
        for _ in 0..500 {
            let step = BRISTLES.begin_step(bristle_rad, velocity_rad_s, 40.0, step_s);
            let before = velocity_rad_s;
            velocity_rad_s = (before - step_s / inertia_kg_m2 * step.drag_at_rest_nm)
                / (1.0 + step_s / inertia_kg_m2 * step.drag_slope_nm_s_rad);
            bristle_rad = step.end_rad(velocity_rad_s);
        }
        assert!(
            velocity_rad_s.abs() < 1e-3,
            "still moving at {velocity_rad_s} rad/s"
        );
    }
}
