//! How small structural damping's largest error can be at all: parameters chosen on the judged data itself.
//!
//! No calibration may do that; what even this misses, no calibration reaches. SD eqs (10) and (13) are linear in `B_st`, so the
//! best one is found exactly for each time constant and threshold of a grid.

use estimators::compare::Judge;
use estimators::{StructuralDamping, TorqueEstimator};
use robot::RobotJoint;
use robot::estimators::StructuralDampingParameters;

/// From the published one to one that does not fade within the data.
const TIME_CONSTANTS_S: [f64; 4] = [15.36, 60.0, 400.0, 3000.0];
/// Up to the published one, read as degrees.
const OFFSETS_RAD: [f64; 8] = [2e-5, 6e-5, 1e-4, 1.3e-4, 1.6e-4, 1.9e-4, 2.3e-4, 2.74e-4];
/// Between these shares of the nominal stiffness `B_st` is looked for.
const STIFFNESS_SHARES: [f64; 2] = [0.3, 3.0];
/// Halvings of that span by the golden section: down to 1e-5 of it.
const STEPS: usize = 24;
/// As a comparison counts.
const SETTLING_S: f64 = 0.5;

/// In motion; `None` without a nominal stiffness to begin from.
pub fn least_maximum_nm(judge: &Judge, joint: &RobotJoint) -> Option<f64> {
    let nominal = StructuralDamping::nominal(joint)?;
    let settled = judge.log.settled(SETTLING_S);
    let rows: Vec<usize> = (0..judge.log.rows())
        .filter(|row| settled[*row] && !judge.phases.stands[*row])
        .collect();
    let sets = TIME_CONSTANTS_S.into_iter().flat_map(|time_constant_s| {
        OFFSETS_RAD.map(|offset_rad| StructuralDampingParameters {
            accumulation_nm_rad: 1.0,
            time_constant_s,
            offset_rad,
            average_s: 0.0,
        })
    });
    let least = sets.map(|set| {
        let mut estimator = StructuralDamping::new(set, joint.gear_ratio, judge.log.period_s);
        let pairs = pairs(judge, &mut estimator, &rows);
        least_over_stiffness(&pairs, nominal.accumulation_nm_rad)
    });
    least.min_by(f64::total_cmp)
}

/// Estimate for `B_st` = 1 Nm/rad, and the sensor's torque.
fn pairs(judge: &Judge, estimator: &mut dyn TorqueEstimator, rows: &[usize]) -> Vec<[f64; 2]> {
    let answers = judge.run(estimator);
    let pair = |row: &usize| {
        let found = answers[*row].as_ref().ok()?;
        let reference_nm = judge.log.joint_torque_nm[*row];
        reference_nm
            .is_finite()
            .then_some([found.torque_nm, reference_nm])
    };
    rows.iter().filter_map(pair).collect()
}

/// The largest error is convex in `B_st`: golden section.
fn least_over_stiffness(pairs: &[[f64; 2]], nominal_nm_rad: f64) -> f64 {
    let maximum = |stiffness: f64| {
        let errors = pairs
            .iter()
            .map(|[unit, reference_nm]| stiffness * unit - reference_nm);
        errors.map(f64::abs).fold(0.0, f64::max)
    };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let [mut low, mut high] = STIFFNESS_SHARES.map(|share| share * nominal_nm_rad);
    let mut least = maximum(low).min(maximum(high));
    for _ in 0..STEPS {
        let [left, right] = [high - golden * (high - low), low + golden * (high - low)];
        let [at_left, at_right] = [maximum(left), maximum(right)];
        least = least.min(at_left).min(at_right);
        if at_left < at_right {
            high = right;
        } else {
            low = left;
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_slope_leaves_equal_errors_either_way() {
        // 2·x with ±0.5 at x = 1: 2 is best and 0.5 remains; a row at zero that is off by 0.8 decides instead
        let even = [[1.0, 1.5], [1.0, 2.5], [0.5, 1.0]];
        assert!((least_over_stiffness(&even, 2.0) - 0.5).abs() < 1e-4);
        let fixed = [[1.0, 1.5], [1.0, 2.5], [0.0, 0.8]];
        assert!((least_over_stiffness(&fixed, 2.0) - 0.8).abs() < 1e-12);
    }
}
