//! Joint torque from the torsion of the flexspline (Zhang's method, as SD gives it).
//!
//! SD eq (5): flexspline torsion is the measured one less the kinematic error and the wave generator's torsion,
//! `Δθ_fs = Δθ - θ_ke - Δθ_wg/N`. Eq (7): `Δθ_wg = sign(T_wg)(1 - exp(-C_wg |T_wg|))/(C_wg N K_wg0)` from the motor torque
//! `T_wg`. Eq (8): `T = S_2 tan(Δθ_fs C_fs K_fs0 S_1)/C_fs`; beyond the largest torque of the calibration, and beyond 99 % of the
//! tangent's pole, the curve goes on as a straight line: no data tell how near the pole is. The wave generator winds up behind the flexspline, so its torsion has the sign of the motor torque in our torsion.
//!
//! Of the six parameters `K_fs0` and `C_fs` are the makers', the others are calibrated. SD Table II: `K_fs0` = 8333 Nm/rad,
//! `C_fs` = 0.089 (printed as Nm, it is 1/Nm), `K_wg0` = 1.33 Nm/rad, `C_wg` = 83.5 1/Nm, `S_1` = 0.001, `S_2` = 20: with these
//! `S_1 S_2` only makes sense for torsions in degrees. Here torsions are in rad, and `S_1`, `S_2` near one.
//! Limits: a static law, without the torsion's damping and hysteresis; extrapolated straight beyond the calibration's torque;
//! noise of encoders and motor torque goes through unfiltered; at `T_wg` = 0 the wave generator's term has its steepest slope.

use joint_model::transmission::{ArctanCompliance, Spring};
use robot::estimators::ComplianceParameters;

use crate::kinematic_error::KinematicError;
use crate::{Estimate, Missing, Sample, TorqueEstimator};

/// One joint's compliance estimator.
#[derive(Clone, Debug)]
pub struct Compliance {
    spring: ArctanCompliance,
    torsion_scale: f64,
    torque_scale: f64,
    /// `S_1 Δθ_fs` at the calibration's largest torque.
    calibrated_rad: f64,
    /// Slope of the spring there.
    beyond_nm_rad: f64,
    zero_rad: f64,
    /// `C_wg`.
    wave_generator_per_nm: f64,
    /// `1/(C_wg N K_wg0)/N`: the wave generator's largest torsion at the joint.
    wave_generator_rad: f64,
    kinematic_error: KinematicError,
    gear_ratio: f64,
}

impl Compliance {
    /// An estimator with these parameters.
    pub fn new(parameters: &ComplianceParameters, gear_ratio: f64) -> Self {
        let wave_generator_per_nm = parameters.wave_generator_stiffening_per_nm;
        let spring = ArctanCompliance {
            stiffness_nm_rad: parameters.stiffness_nm_rad,
            stiffening_per_nm: parameters.stiffening_per_nm,
        };
        let calibrated_rad = spring.torsion_rad(parameters.torque_max_nm / parameters.torque_scale);
        Self {
            calibrated_rad,
            beyond_nm_rad: spring.stiffness_nm_rad(calibrated_rad),
            spring,
            torsion_scale: parameters.torsion_scale,
            torque_scale: parameters.torque_scale,
            zero_rad: parameters.zero_rad,
            wave_generator_per_nm,
            wave_generator_rad: 1.0
                / (wave_generator_per_nm
                    * gear_ratio.powi(2)
                    * parameters.wave_generator_stiffness_nm_rad),
            kinematic_error: KinematicError::new(&parameters.kinematic_error),
            gear_ratio,
        }
    }

    /// Eq (7) at the joint, `Δθ_wg/N`.
    fn wave_generator_rad(&self, motor_torque_nm: f64) -> f64 {
        let rise = -(-self.wave_generator_per_nm * motor_torque_nm.abs()).exp_m1();
        (self.wave_generator_rad * rise).copysign(motor_torque_nm)
    }

    /// Eq (8), and its tangent beyond what was calibrated.
    fn flexspline_nm(&self, flexspline_rad: f64) -> f64 {
        let scaled_rad = self.torsion_scale * flexspline_rad;
        let inside_rad = scaled_rad.clamp(-self.calibrated_rad, self.calibrated_rad);
        let beyond_nm = self.beyond_nm_rad * (scaled_rad - inside_rad);
        self.torque_scale * (self.spring.torque_nm(inside_rad) + beyond_nm)
    }
}

impl TorqueEstimator for Compliance {
    fn estimate(&mut self, sample: &Sample) -> Result<Estimate, Missing> {
        let torsion_rad = sample.torsion_rad(self.gear_ratio)?;
        let motor_torque_nm = sample.motor_torque_nm()?;
        let (error_rad, _) = self
            .kinematic_error
            .error_and_slope(sample.motor_position_rad);
        let flexspline_rad =
            torsion_rad - self.zero_rad - error_rad - self.wave_generator_rad(motor_torque_nm); // eq (5)
        Ok(Estimate::bare(self.flexspline_nm(flexspline_rad)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{compliance as parameters, twisted};
    use recording::Signal;
    use robot::estimators::KinematicErrorTable;

    #[test]
    fn equations_5_7_and_8_by_hand() {
        let mut estimator = Compliance::new(&parameters(), 100.0);
        let sample = Sample {
            motor_torque_nm: 0.02,
            ..twisted(0, 1e-3)
        };
        // eq (7): (1 - e^-1.67)/(83.5·100·1.33) = 7.3094e-5 at the motor, 7.3094e-7 at the joint
        let wave_generator_rad = (1.0 - (-1.67_f64).exp()) / (83.5 * 100.0 * 1.33) / 100.0;
        assert!((wave_generator_rad - 7.3094e-7).abs() < 1e-10);
        // eq (8): 1.1·tan(0.9·8333·0.089·(1e-3 - 1e-5 - 7.3e-7))/0.089
        let expected =
            1.1 * (0.9 * 8333.0 * 0.089 * (1e-3 - 1e-5 - wave_generator_rad)).tan() / 0.089;
        let found = estimator.estimate(&sample).unwrap().torque_nm;
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        assert!((found - 9.598).abs() < 0.001, "{found}");
    }

    #[test]
    fn equation_8_undoes_equation_6() {
        let plain = ComplianceParameters {
            torsion_scale: 1.0,
            torque_scale: 1.0,
            zero_rad: 0.0,
            ..parameters()
        };
        let mut estimator = Compliance::new(&plain, 100.0);
        for torque_nm in [-12.0, -0.3, 0.0, 5.0, 16.0_f64] {
            // eq (6)
            let flexspline_rad = (0.089 * torque_nm).atan() / (0.089 * 8333.0);
            let sample = Sample {
                motor_torque_nm: 0.0,
                ..twisted(0, flexspline_rad)
            };
            let found = estimator.estimate(&sample).unwrap().torque_nm;
            assert!((found - torque_nm).abs() < 1e-9, "{found} {torque_nm}");
        }
    }

    #[test]
    fn beyond_the_calibrated_torque_equation_8_goes_on_straight() {
        let short = ComplianceParameters {
            torsion_scale: 1.0,
            torque_scale: 1.0,
            zero_rad: 0.0,
            torque_max_nm: 10.0,
            ..parameters()
        };
        let mut estimator = Compliance::new(&short, 100.0);
        // eq (6): 10 Nm twist by atan(0.89)/(0.089·8333); the slope of eq (8) there is 8333·(1 + 0.89²) = 14933.6 Nm/rad
        let end_rad = 0.89_f64.atan() / (0.089 * 8333.0);
        for (torsion_rad, expected_nm) in [
            (end_rad, 10.0),
            (end_rad + 1e-3, 24.9336),
            // eq (8) itself has its pole at 2.118 mrad
            (-end_rad - 1e-2, -159.336),
        ] {
            let sample = Sample {
                motor_torque_nm: 0.0,
                ..twisted(0, torsion_rad)
            };
            let found = estimator.estimate(&sample).unwrap().torque_nm;
            assert!((found - expected_nm).abs() < 1e-3, "{found} {expected_nm}");
        }
    }

    #[test]
    fn equation_7_is_odd_and_ends_at_its_largest_torsion() {
        let estimator = Compliance::new(&parameters(), 100.0);
        // 1/(83.5·100·1.33) = 9.0046e-5 rad at the motor
        for (motor_torque_nm, expected_rad) in [(1.0, 9.0046e-7), (-1.0, -9.0046e-7), (0.0, 0.0)] {
            let found = estimator.wave_generator_rad(motor_torque_nm);
            assert!((found - expected_rad).abs() < 1e-11, "{found}");
        }
    }

    #[test]
    fn the_kinematic_error_is_no_torque() {
        let mut with_error = parameters();
        with_error.kinematic_error = KinematicErrorTable {
            cosine_rad: vec![1e-4],
            sine_rad: vec![0.0],
        };
        let mut estimator = Compliance::new(&with_error, 100.0);
        let sample = Sample {
            motor_torque_nm: 0.0,
            ..twisted(0, 1.1e-4)
        };
        assert!(estimator.estimate(&sample).unwrap().torque_nm.abs() < 1e-12);
    }

    #[test]
    fn each_missing_signal_is_named() {
        let mut estimator = Compliance::new(&parameters(), 100.0);
        let torque = estimator.estimate(&twisted(0, 1e-3));
        assert_eq!(torque, Err(Missing(Signal::MotorTorqueNm)));
        let link = estimator.estimate(&twisted(0, f64::NAN));
        assert_eq!(link, Err(Missing(Signal::LinkPositionRad)));
    }
}
