//! Joint torque from the compliance model and what a Gaussian process learned of its error (Xia's method).
//!
//! `T = T_c + μ(T_c, N T_m)`: `T_c` by [`Compliance`](crate::Compliance), `μ` the mean of a Gaussian process over it and the
//! motor torque. Source: Xia et al., as SD, sections I and II, describes it: torsion by two encoders, motor current, and a full
//! calibration to train the process. The process itself costs a kernel for each training point; here it was evaluated on a grid
//! once, and a prediction is a bilinear interpolation, outside the grid that of its edge.
//! Limits: those of the compliance model's noise; no memory, so hysteresis is learned only as far as the motor torque
//! tells its branch; what lies outside the calibration's torques is extrapolated flat.

use robot::estimators::{ComplianceParameters, GaussianProcessTable};

use crate::{Compliance, Estimate, Missing, Sample, TorqueEstimator};

/// One joint's estimator by compliance and regression.
#[derive(Clone, Debug)]
pub struct GaussianProcess {
    compliance: Compliance,
    table: GaussianProcessTable,
    gear_ratio: f64,
}

impl GaussianProcess {
    /// An estimator with this model and the process' table.
    pub fn new(
        compliance: &ComplianceParameters,
        table: GaussianProcessTable,
        gear_ratio: f64,
    ) -> Self {
        Self {
            compliance: Compliance::new(compliance, gear_ratio),
            table,
            gear_ratio,
        }
    }
}

impl TorqueEstimator for GaussianProcess {
    fn estimate(&mut self, sample: &Sample) -> Result<Estimate, Missing> {
        let compliance_nm = self.compliance.estimate(sample)?.torque_nm;
        let motor_nm = self.gear_ratio * sample.motor_torque_nm;
        let table = &self.table;
        let columns = table.residual_nm.first().map_or(0, Vec::len);
        let place = [
            Place::of(motor_nm, table.motor_nm, table.residual_nm.len()),
            Place::of(compliance_nm, table.compliance_nm, columns),
        ];
        Ok(Estimate {
            torque_nm: compliance_nm + interpolated(&table.residual_nm, place),
            std_nm: Some(interpolated(&table.std_nm, place)),
        })
    }
}

/// Between which two grid lines a value lies, and how far along.
#[derive(Clone, Copy)]
struct Place {
    line: usize,
    share: f64,
}

impl Place {
    fn of(value: f64, [low, high]: [f64; 2], lines: usize) -> Self {
        let spaces = lines.saturating_sub(1) as f64;
        let along = ((value - low) / (high - low) * spaces).clamp(0.0, spaces);
        let line = (along as usize).min(lines.saturating_sub(2));
        Self {
            line,
            share: along - line as f64,
        }
    }
}

fn interpolated(rows: &[Vec<f64>], [row, column]: [Place; 2]) -> f64 {
    let along = |values: &[f64]| {
        values[column.line] * (1.0 - column.share) + values[column.line + 1] * column.share
    };
    along(&rows[row.line]) * (1.0 - row.share) + along(&rows[row.line + 1]) * row.share
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{calibrated_joint, compliance, twisted};

    #[test]
    fn a_torque_by_hand() {
        let known = calibrated_joint().estimators.unwrap();
        let table = known.gaussian_process.unwrap();
        let mut estimator = GaussianProcess::new(&compliance(), table, 100.0);
        let sample = Sample {
            motor_torque_nm: 0.1,
            ..twisted(
                0,
                1e-5 + 1.0 / (83.5 * 100.0 * 1.33) / 100.0 * (1.0 - (-8.35_f64).exp()),
            )
        };
        let found = estimator.estimate(&sample).unwrap();
        // no flexspline torsion: T_c = 0, the middle column; 100·0.1 = 10 Nm of -20 to 20, three quarters of the way up
        assert!(
            (found.torque_nm - (0.5 + 0.75 * 2.0)).abs() < 1e-9,
            "{found:?}"
        );
        assert!((found.std_nm.unwrap() - 0.25).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn a_plane_is_interpolated_exactly_and_the_edge_goes_on() {
        let plane = |x: f64, y: f64| 1.0 + 0.5 * x - 0.25 * y;
        let rows: Vec<Vec<f64>> = [0.0, 1.0, 2.0]
            .map(|y| [-1.0, 1.0].map(|x| plane(x, y)).to_vec())
            .to_vec();
        let at = |x: f64, y: f64| {
            interpolated(
                &rows,
                [Place::of(y, [0.0, 2.0], 3), Place::of(x, [-1.0, 1.0], 2)],
            )
        };
        for (x, y) in [(0.3, 0.1), (-1.0, 2.0), (1.0, 1.7), (0.0, 1.0)] {
            assert!((at(x, y) - plane(x, y)).abs() < 1e-12);
        }
        assert!((at(9.0, -9.0) - plane(1.0, 0.0)).abs() < 1e-12);
    }
}
