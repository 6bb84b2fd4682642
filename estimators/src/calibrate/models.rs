//! Fits of the published estimators with a law: structural damping, compliance, Taghirad's, the disturbance observer.

use robot::estimators::{
    ComplianceParameters, DisturbanceObserverParameters, KinematicErrorTable,
    StructuralDampingParameters, TaghiradParameters,
};

use super::least_squares::{Parameter, Solution, fit};
use super::{Bench, Calibration, Fit, range};
use crate::joint::{EstimatorError, Kind};
use crate::{Compliance, DisturbanceObserver, StructuralDamping, Taghirad};

/// Terms of the kinematic error: Tuttle finds the second and the fourth largest; six catch their neighbours.
pub(super) const KINEMATIC_TERMS: usize = 6;
/// `C_fs`, SD Table II. `S_1` and `S_2` scale both sides of eq (8), so its value does not matter.
const STIFFENING_PER_NM: f64 = 0.089;
const STARTS: usize = 12;
/// A law with many linear parameters has few minima.
const STARTS_LINEAR: usize = 3;

fn parameter(name: &'static str, start: f64, bounds: [f64; 2]) -> Parameter {
    Parameter {
        name,
        start,
        bounds,
    }
}

impl Bench<'_> {
    /// SD eqs (10) to (13): three parameters.
    pub(super) fn structural_damping(&self, found: &mut Calibration) {
        let stiffness = self.stiffness_nm_rad();
        let twist_rad = range(self.torsions_rad().into_iter());
        let parameters = [
            parameter(
                "accumulation_nm_rad",
                stiffness,
                [0.1 * stiffness, 10.0 * stiffness],
            ),
            parameter("time_constant_s", 15.0, [0.05, 1e4]),
            parameter(
                "offset_rad",
                0.05 * twist_rad,
                [1e-4 * twist_rad, 0.5 * twist_rad],
            ),
        ];
        let made = |values: &[f64]| StructuralDampingParameters {
            accumulation_nm_rad: values[0],
            time_constant_s: values[1],
            offset_rad: values[2],
            average_s: 0.0,
        };
        let solution = fit(&parameters, STARTS, &|values| {
            let estimator =
                StructuralDamping::new(made(values), self.joint.gear_ratio, self.period_s());
            self.misses(estimator)
        });
        found.parameters.structural_damping = Some(made(&solution.values()));
        found.keep(Kind::StructuralDamping, solution, STARTS);
    }

    /// SD eq (9).
    pub(super) fn taghirad(&self, found: &mut Calibration) -> Result<(), EstimatorError> {
        let stiffness = self.stiffness_nm_rad();
        let twist_rad = range(self.torsions_rad().into_iter());
        let torque_nm = range(self.rows.iter().map(|row| self.reference_nm[*row]));
        let parameters = [
            parameter(
                "stiffness_nm_rad",
                stiffness,
                [0.1 * stiffness, 10.0 * stiffness],
            ),
            parameter("damping_nm", 0.1 * torque_nm, [0.0, 100.0 * torque_nm]),
            parameter("exponent", 0.5, [0.05, 2.0]),
            parameter("zero_rad", 0.0, [-twist_rad, twist_rad]),
        ];
        let made = |values: &[f64]| TaghiradParameters {
            stiffness_nm_rad: values[0],
            damping_nm: values[1],
            exponent: values[2],
            zero_rad: values[3],
        };
        let (ratio, period_s) = (self.joint.gear_ratio, self.period_s());
        let filter = |source| EstimatorError::Filter {
            joint: self.joint.name.clone(),
            source,
        };
        let nominal = made(&parameters.map(|parameter| parameter.start));
        Taghirad::new(nominal, ratio, period_s).map_err(filter)?;
        let solution = fit(&parameters, STARTS, &|values| {
            // the filter was made before
            Taghirad::new(made(values), ratio, period_s)
                .map_or_else(|_| Vec::new(), |estimator| self.misses(estimator))
        });
        found.parameters.taghirad = Some(made(&solution.values()));
        found.keep(Kind::Taghirad, solution, STARTS);
        Ok(())
    }

    /// Vassileva's: Coulomb and viscous friction in each direction.
    pub(super) fn disturbance_observer(
        &self,
        found: &mut Calibration,
    ) -> Result<(), EstimatorError> {
        let torque_nm = range(self.rows.iter().map(|row| self.reference_nm[*row]));
        let coulomb = [-0.1 * torque_nm, 10.0 * torque_nm];
        let viscous = [-10.0 * torque_nm, 100.0 * torque_nm];
        let parameters = [
            parameter("coulomb_nm, positive", 0.1 * torque_nm, coulomb),
            parameter("coulomb_nm, negative", 0.1 * torque_nm, coulomb),
            parameter("viscous_nm_s_rad, positive", 0.1 * torque_nm, viscous),
            parameter("viscous_nm_s_rad, negative", 0.1 * torque_nm, viscous),
        ];
        let made = |values: &[f64]| DisturbanceObserverParameters {
            coulomb_nm: [values[0], values[1]],
            viscous_nm_s_rad: [values[2], values[3]],
        };
        let filter = |source| EstimatorError::Filter {
            joint: self.joint.name.clone(),
            source,
        };
        let nominal = made(&parameters.map(|parameter| parameter.start));
        DisturbanceObserver::new(nominal, self.joint, self.period_s()).map_err(filter)?;
        let solution = fit(&parameters, STARTS_LINEAR, &|values| {
            // the filters were made before
            DisturbanceObserver::new(made(values), self.joint, self.period_s())
                .map_or_else(|_| Vec::new(), |estimator| self.misses(estimator))
        });
        found.parameters.disturbance_observer = Some(made(&solution.values()));
        found.keep(Kind::DisturbanceObserver, solution, STARTS_LINEAR);
        Ok(())
    }

    /// Zhang's, SD eqs (5) to (8), with the kinematic error.
    pub(super) fn compliance(&self, found: &mut Calibration) {
        let stiffness_nm_rad = self.stiffness_nm_rad();
        let twist_rad = range(self.torsions_rad().into_iter());
        let motor_nm = range(
            self.rows
                .iter()
                .map(|row| self.log.samples[*row].motor_torque_nm),
        );
        let reference_nm = self.rows.iter().map(|row| self.reference_nm[*row].abs());
        let torque_max_nm = reference_nm.fold(0.0, f64::max);
        let squared = self.joint.gear_ratio.powi(2);
        let mut parameters = vec![
            parameter(
                "wave_generator_stiffness_nm_rad",
                10.0 * stiffness_nm_rad / squared,
                [
                    0.1 * stiffness_nm_rad / squared,
                    1e4 * stiffness_nm_rad / squared,
                ],
            ),
            parameter(
                "wave_generator_stiffening_per_nm",
                10.0 / motor_nm,
                [0.1 / motor_nm, 1e4 / motor_nm],
            ),
            parameter("torsion_scale", 0.5, [0.001, 3.0]),
            parameter("torque_scale", 1.5, [0.1, 1e3]),
            parameter("zero_rad", 0.0, [-twist_rad, twist_rad]),
        ];
        let term = parameter("kinematic_error", 0.0, [-twist_rad, twist_rad]);
        parameters.extend([term; 2 * KINEMATIC_TERMS]);
        let made = |values: &[f64]| ComplianceParameters {
            stiffness_nm_rad,
            stiffening_per_nm: STIFFENING_PER_NM,
            wave_generator_stiffness_nm_rad: values[0],
            wave_generator_stiffening_per_nm: values[1],
            torsion_scale: values[2],
            torque_scale: values[3],
            zero_rad: values[4],
            torque_max_nm,
            kinematic_error: kinematic_error(&values[5..]),
        };
        let solution = fit(&parameters, STARTS_LINEAR, &|values| {
            self.static_misses(Compliance::new(&made(values), self.joint.gear_ratio))
        });
        found.parameters.compliance = Some(made(&solution.values()));
        found.keep(Kind::Compliance, solution, STARTS_LINEAR);
    }
}

/// Cosines and sines in turn.
pub(super) fn kinematic_error(values: &[f64]) -> KinematicErrorTable {
    let every = |from: usize| values.iter().skip(from).step_by(2).copied().collect();
    KinematicErrorTable {
        cosine_rad: every(0),
        sine_rad: every(1),
    }
}

impl Solution {
    pub(super) fn values(&self) -> Vec<f64> {
        self.fitted.iter().map(|fitted| fitted.value).collect()
    }
}

impl Calibration {
    pub(super) fn keep(&mut self, kind: Kind, solution: Solution, starts: usize) {
        self.fits.push(Fit {
            kind,
            fitted: solution.fitted,
            rms_nm: solution.rms,
            starts,
            agreeing_starts: solution.agreeing_starts,
        });
    }
}
