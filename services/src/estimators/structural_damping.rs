//! Joint torque from the rate of the gear's torsion.
//!
//! SD eqs (10), (13): the torsion's rate, counted only where the torsion exceeds `θ_offset`, is accumulated with a leak,
//! `T(s) = B τs/(τs + 1) Δθ(s)`. For motion faster than `τ` that is `B Δθ`: `B_st`, printed in Nm s/rad, acts as a
//! stiffness in Nm/rad. A held load fades with `τ`; a torsion below `θ_offset` resets the estimate, and the fading with it.
//!
//! Until it is calibrated, `B` is the robot file's gear stiffness. The published set (`τ` = 15.36 s, `B_st` = 3007,
//! `θ_offset` = 0.0157) belongs to one joint; its `θ_offset` only fits a gear's torsion if it was meant in degrees.
//! Limits: needs a link encoder; drifts under static load; as eq (13) counts no rate below `θ_offset`, the estimate is
//! too small by about `B θ_offset` above it.

use robot::{Effect, RobotJoint};

/// SD Table II.
const TIME_CONSTANT_S: f64 = 15.36;
/// SD Table II, 0.0157 read as degrees.
const OFFSET_RAD: f64 = 0.0157 * std::f64::consts::PI / 180.0;

/// One joint's structural-damping estimator.
#[derive(Clone, Debug)]
pub struct StructuralDamping {
    accumulation_nm_rad: f64,
    kept_per_cycle: f64,
    offset_rad: f64,
    torsion_rad: f64,
    torque_nm: f64,
}

impl StructuralDamping {
    /// An estimator with the joint's nominal stiffness; without one it gives NaN.
    pub fn new(joint: &RobotJoint, period_s: f64) -> Self {
        let stiffness_nm_rad = joint.effects.iter().find_map(|effect| match effect {
            Effect::TorsionalCompliance { stiffness_nm_rad } => Some(*stiffness_nm_rad),
            _ => None,
        });
        Self::with_parameters(
            stiffness_nm_rad.unwrap_or(f64::NAN),
            TIME_CONSTANT_S,
            OFFSET_RAD,
            period_s,
        )
    }

    /// An estimator with these parameters: `B` in Nm/rad, `τ`, `θ_offset`.
    pub fn with_parameters(
        accumulation_nm_rad: f64,
        time_constant_s: f64,
        offset_rad: f64,
        period_s: f64,
    ) -> Self {
        Self {
            accumulation_nm_rad,
            kept_per_cycle: (-period_s / time_constant_s).exp(),
            offset_rad,
            torsion_rad: f64::NAN,
            torque_nm: 0.0,
        }
    }

    /// Joint torque after one more torsion (motor angle over gear ratio minus link angle); NaN without one.
    pub fn estimate_nm(&mut self, torsion_rad: f64) -> f64 {
        let before_rad = std::mem::replace(&mut self.torsion_rad, torsion_rad);
        if !torsion_rad.is_finite() {
            return f64::NAN;
        }
        if torsion_rad.abs() < self.offset_rad {
            self.torque_nm = 0.0;
        } else if before_rad.is_finite() {
            self.torque_nm = self.torque_nm * self.kept_per_cycle
                + self.accumulation_nm_rad * (torsion_rad - before_rad);
        }
        self.torque_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1.0 / 1500.0;

    #[test]
    fn fast_torsion_reads_as_a_stiffness_from_the_threshold_on() {
        let mut estimator = StructuralDamping::with_parameters(8000.0, 15.36, 2.7e-4, PERIOD_S);
        let mut worst = 0.0_f64;
        for cycle in 0..1500 {
            let torsion = 1e-3 * (2.0 * std::f64::consts::TAU * cycle as f64 * PERIOD_S).sin();
            let torque = estimator.estimate_nm(torsion);
            if torsion.abs() >= 2.7e-4 {
                worst =
                    worst.max((torque - 8000.0 * (torsion - 2.7e-4_f64.copysign(torsion))).abs());
            } else {
                assert_eq!(torque, 0.0);
            }
        }
        // One sample's step past the threshold, 8.4e-6 rad at most, and a little leak.
        assert!(worst < 0.15, "{worst}");
    }

    #[test]
    fn a_held_load_fades_with_the_time_constant_and_small_torsion_resets() {
        let mut estimator = StructuralDamping::with_parameters(8000.0, 1.0, 2.7e-4, PERIOD_S);
        estimator.estimate_nm(0.0);
        let begun = estimator.estimate_nm(1e-3);
        let mut torque = begun;
        for _ in 0..1500 {
            torque = estimator.estimate_nm(1e-3);
        }
        assert!((torque / begun - (-1.0_f64).exp()).abs() < 1e-9);
        assert_eq!(estimator.estimate_nm(1e-4), 0.0);
    }

    #[test]
    fn no_link_encoder_no_estimate() {
        let mut estimator = StructuralDamping::with_parameters(8000.0, 1.0, 2.7e-4, PERIOD_S);
        assert!(estimator.estimate_nm(f64::NAN).is_nan());
        assert_eq!(estimator.estimate_nm(1e-3), 0.0);
        assert!(estimator.estimate_nm(2e-3) > 0.0, "and recovers");
    }
}
