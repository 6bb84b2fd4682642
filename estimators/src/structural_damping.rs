//! Joint torque from the rate of the gear's torsion.
//!
//! SD eqs (10), (13): the torsion's rate, counted only where the torsion exceeds `θ_offset`, is accumulated with a leak,
//! `T(s) = B τs/(τs + 1) Δθ(s)`. For motion faster than `τ` that is `B Δθ`: `B_st`, printed in Nm s/rad, acts as a
//! stiffness in Nm/rad. A held load fades with `τ`; a torsion below `θ_offset` resets the estimate, and the fading with it.
//! `T_fs0` of eq (10) is zero, as in the paper's experiments. A moving average over `average_s` may follow, which the paper
//! proposes against the ripples of its Fig. 8.
//!
//! Until it is calibrated, `B` is the robot file's gear stiffness, and `τ` and `θ_offset` are the published ones (`τ` =
//! 15.36 s, `B_st` = 3007, `θ_offset` = 0.0157). They belong to one joint; the printed `θ_offset` only fits a gear's torsion
//! if it was meant in degrees.
//! Limits: needs a link encoder and no motor torque; drifts under static load; as eq (13) counts no rate below `θ_offset`, the
//! estimate is too small by about `B θ_offset` above it; the kinematic error counts as torsion; the moving average delays by
//! half of its length.

use robot::estimators::StructuralDampingParameters;
use robot::{Effect, RobotJoint};

use crate::{Estimate, GAP_MAX_CYCLES, Missing, Sample, TorqueEstimator};

/// SD Table II.
const TIME_CONSTANT_S: f64 = 15.36;
/// SD Table II, 0.0157 read as degrees.
const OFFSET_RAD: f64 = 0.0157 * std::f64::consts::PI / 180.0;
/// The longest moving average: 85 ms at 1.5 kHz.
const AVERAGE_MAX: usize = 128;

/// One joint's structural-damping estimator.
#[derive(Clone, Debug)]
pub struct StructuralDamping {
    parameters: StructuralDampingParameters,
    gear_ratio: f64,
    kept_per_cycle: f64,
    before: Option<(u64, f64)>,
    torque_nm: f64,
    average: Average,
}

impl StructuralDamping {
    /// What is used until it is calibrated: the joint's nominal stiffness, if the robot file has one, and the published rest.
    pub fn nominal(joint: &RobotJoint) -> Option<StructuralDampingParameters> {
        let accumulation_nm_rad = joint.effects.iter().find_map(|effect| match effect {
            Effect::TorsionalCompliance { stiffness_nm_rad } => Some(*stiffness_nm_rad),
            _ => None,
        })?;
        Some(StructuralDampingParameters {
            accumulation_nm_rad,
            time_constant_s: TIME_CONSTANT_S,
            offset_rad: OFFSET_RAD,
            average_s: 0.0,
        })
    }

    /// An estimator with these parameters.
    pub fn new(parameters: StructuralDampingParameters, gear_ratio: f64, period_s: f64) -> Self {
        Self {
            parameters,
            gear_ratio,
            kept_per_cycle: (-period_s / parameters.time_constant_s).exp(),
            before: None,
            torque_nm: 0.0,
            average: Average::over(parameters.average_s / period_s),
        }
    }
}

impl TorqueEstimator for StructuralDamping {
    fn estimate(&mut self, sample: &Sample) -> Result<Estimate, Missing> {
        let torsion_rad = sample.torsion_rad(self.gear_ratio)?;
        let before = self.before.replace((sample.cycle, torsion_rad));
        if torsion_rad.abs() < self.parameters.offset_rad {
            self.torque_nm = 0.0; // eq (13), second line
        } else if let Some((cycle, before_rad)) = before {
            let cycles = sample.cycle.saturating_sub(cycle);
            if cycles > GAP_MAX_CYCLES {
                self.torque_nm = 0.0;
            } else {
                let kept = self.kept_per_cycle.powi(cycles as i32);
                // eqs (10), (13): the rate times the period, whatever its length
                self.torque_nm = self.torque_nm * kept
                    + self.parameters.accumulation_nm_rad * (torsion_rad - before_rad);
            }
        }
        Ok(Estimate::bare(self.average.of(self.torque_nm)))
    }
}

/// A moving average over a fixed number of samples.
#[derive(Clone, Debug)]
struct Average {
    values: [f64; AVERAGE_MAX],
    length: usize,
    filled: usize,
    next: usize,
}

impl Average {
    fn over(samples: f64) -> Self {
        Self {
            values: [0.0; AVERAGE_MAX],
            length: (samples.round() as usize).clamp(1, AVERAGE_MAX),
            filled: 0,
            next: 0,
        }
    }

    fn of(&mut self, value: f64) -> f64 {
        if self.length == 1 {
            return value;
        }
        self.values[self.next] = value;
        self.next = (self.next + 1) % self.length;
        self.filled = (self.filled + 1).min(self.length);
        // summed anew each time: a running sum would keep its rounding errors for ever
        self.values[..self.filled].iter().sum::<f64>() / self.filled as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::twisted;

    const PERIOD_S: f64 = 1.0 / 1500.0;

    fn estimator(time_constant_s: f64, average_s: f64) -> StructuralDamping {
        let parameters = StructuralDampingParameters {
            accumulation_nm_rad: 8000.0,
            time_constant_s,
            offset_rad: 2.7e-4,
            average_s,
        };
        StructuralDamping::new(parameters, 100.0, PERIOD_S)
    }

    fn torque_nm(estimator: &mut StructuralDamping, cycle: u64, torsion_rad: f64) -> f64 {
        let estimate = estimator.estimate(&twisted(cycle, torsion_rad));
        estimate.unwrap().torque_nm
    }

    #[test]
    fn fast_torsion_reads_as_a_stiffness_from_the_threshold_on() {
        let mut estimator = estimator(15.36, 0.0);
        let mut worst = 0.0_f64;
        for cycle in 0..1500 {
            let torsion = 1e-3 * (2.0 * std::f64::consts::TAU * cycle as f64 * PERIOD_S).sin();
            let torque = torque_nm(&mut estimator, cycle, torsion);
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
        let mut estimator = estimator(1.0, 0.0);
        torque_nm(&mut estimator, 0, 0.0);
        let begun = torque_nm(&mut estimator, 1, 1e-3);
        assert_eq!(begun, 8.0);
        let mut torque = begun;
        for cycle in 2..1502 {
            torque = torque_nm(&mut estimator, cycle, 1e-3);
        }
        assert!((torque / begun - (-1.0_f64).exp()).abs() < 1e-9);
        assert_eq!(torque_nm(&mut estimator, 1502, 1e-4), 0.0);
    }

    #[test]
    fn equation_10_accumulates_a_steady_rate_up_to_its_leak() {
        // T(t) = B·r·τ (1 - e^(-t/τ)) with B = 8000, r = 0.001 rad/s, τ = 0.5 s, beyond the threshold from the beginning
        let mut estimator = estimator(0.5, 0.0);
        let torsion = |cycle: u64| 1e-3 + 1e-3 * cycle as f64 * PERIOD_S;
        torque_nm(&mut estimator, 0, torsion(0));
        for cycle in 1..=3000 {
            let found = torque_nm(&mut estimator, cycle, torsion(cycle));
            let time_s = cycle as f64 * PERIOD_S;
            let expected = 8000.0 * 1e-3 * 0.5 * (1.0 - (-time_s / 0.5).exp());
            // the sum takes each period's rate at its end: half a period of it
            assert!(
                (found - expected).abs() < 8000.0 * 1e-3 * PERIOD_S,
                "{found} {expected}"
            );
        }
    }

    #[test]
    fn equation_13_counts_from_the_threshold_itself_on() {
        let mut at = estimator(15.36, 0.0);
        torque_nm(&mut at, 0, 2.6e-4);
        assert!((torque_nm(&mut at, 1, 2.7e-4) - 8000.0 * 1e-5).abs() < 1e-9);
        assert_eq!(torque_nm(&mut at, 2, 2.6999e-4), 0.0);
    }

    #[test]
    fn a_lost_sample_loses_no_torsion_and_a_long_gap_starts_again() {
        let (mut whole, mut holed) = (estimator(15.36, 0.0), estimator(15.36, 0.0));
        let ramp = |cycle: u64| 1e-6 * cycle as f64;
        for cycle in 0..600 {
            let full_nm = torque_nm(&mut whole, cycle, ramp(cycle));
            if cycle % 100 != 50 {
                let nm = torque_nm(&mut holed, cycle, ramp(cycle));
                assert!((nm - full_nm).abs() < 1e-4);
            }
        }
        assert_eq!(torque_nm(&mut holed, 700, ramp(700)), 0.0);
    }

    #[test]
    fn the_average_is_over_its_length() {
        let mut estimator = estimator(1e9, 4.0 * PERIOD_S);
        let torsions = [0.0, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3];
        let torques: Vec<f64> = torsions
            .iter()
            .enumerate()
            .map(|(cycle, torsion)| torque_nm(&mut estimator, cycle as u64, *torsion))
            .collect();
        let expected = [0.0, 4.0, 16.0 / 3.0, 6.0, 8.0, 8.0];
        for (found, expected) in torques.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{torques:?}");
        }
    }

    #[test]
    fn no_link_encoder_no_estimate() {
        use recording::Signal;
        let mut estimator = estimator(1.0, 0.0);
        let blind = estimator.estimate(&twisted(0, f64::NAN));
        assert_eq!(blind, Err(Missing(Signal::LinkPositionRad)));
        assert_eq!(torque_nm(&mut estimator, 1, 1e-3), 0.0);
        assert!(torque_nm(&mut estimator, 2, 2e-3) > 0.0, "and recovers");
    }
}
