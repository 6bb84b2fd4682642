//! Joint torque from torsion and torsion rate (Taghirad's law, SD eq (9)).
//!
//! `T = K Δθ + B_st |Δθ̇|^α sign(Δθ̇)`, with the rate by a difference through a second-order low-pass at 100 Hz: the encoders'
//! steps alone make a raw rate of some 0.03 rad/s, as much as a strong swing has.
//! Limits: one stiffness for a gear that stiffens; the kinematic error counts as torsion, and its rate as torsion rate;
//! needs a link encoder and no motor torque; the rate term comes 2 ms late.

use joint_model::filter::FilterError;
use joint_model::velocity_filter::VelocityFilter;
use robot::estimators::TaghiradParameters;

use crate::{Estimate, Missing, Sample, TorqueEstimator};

/// Above what a gear between motor and link rings with (30 to 80 Hz), below the encoders' steps.
const RATE_CUTOFF_HZ: f64 = 100.0;

/// One joint's estimator by torsion and torsion rate.
#[derive(Clone, Debug)]
pub struct Taghirad {
    parameters: TaghiradParameters,
    gear_ratio: f64,
    period_s: f64,
    rate: VelocityFilter,
}

impl Taghirad {
    /// An estimator with these parameters.
    ///
    /// # Errors
    /// [`FilterError`] if the control period is too long for its filter.
    pub fn new(
        parameters: TaghiradParameters,
        gear_ratio: f64,
        period_s: f64,
    ) -> Result<Self, FilterError> {
        Ok(Self {
            parameters,
            gear_ratio,
            period_s,
            rate: VelocityFilter::new(2, RATE_CUTOFF_HZ, 1.0 / period_s)?,
        })
    }
}

impl TorqueEstimator for Taghirad {
    fn estimate(&mut self, sample: &Sample) -> Result<Estimate, Missing> {
        let torsion_rad = sample.torsion_rad(self.gear_ratio)? - self.parameters.zero_rad;
        let rate_rad_s = self.rate.observe(sample.cycle, torsion_rad, self.period_s);
        let damping_nm = self.parameters.damping_nm
            * rate_rad_s
                .abs()
                .powf(self.parameters.exponent)
                .copysign(rate_rad_s);
        // eq (9)
        Ok(Estimate::bare(
            self.parameters.stiffness_nm_rad * torsion_rad + damping_nm,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::twisted;

    #[test]
    fn a_steady_rate_gives_equation_9() {
        let parameters = TaghiradParameters {
            stiffness_nm_rad: 8000.0,
            damping_nm: 2.0,
            exponent: 0.5,
            zero_rad: 1e-4,
        };
        for direction in [1.0, -1.0] {
            let mut estimator = Taghirad::new(parameters, 100.0, 1e-3).unwrap();
            let mut found_nm = 0.0;
            for cycle in 0..=200 {
                // 0.01 rad/s
                let torsion_rad = direction * 1e-5 * cycle as f64;
                let estimate = estimator.estimate(&twisted(cycle, torsion_rad));
                found_nm = estimate.unwrap().torque_nm;
            }
            // K(±0.002 - 0.0001) ± 2·√0.01
            let expected_nm = 8000.0 * (direction * 2e-3 - 1e-4) + direction * 0.2;
            assert!((found_nm - expected_nm).abs() < 1e-6, "{found_nm}");
        }
    }

    #[test]
    fn a_standing_torsion_is_a_spring() {
        let parameters = TaghiradParameters {
            stiffness_nm_rad: 8000.0,
            damping_nm: 2.0,
            exponent: 0.5,
            zero_rad: 0.0,
        };
        let mut estimator = Taghirad::new(parameters, 100.0, 1e-3).unwrap();
        let estimate = estimator.estimate(&twisted(0, 1e-3)).unwrap();
        assert!((estimate.torque_nm - 8.0).abs() < 1e-12);
    }
}
