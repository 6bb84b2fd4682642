//! Joint torque without a torque sensor: estimators, their calibration and their comparison.
//!
//! Every estimator is one file and a [`TorqueEstimator`]: it takes one [`Sample`] a cycle and gives an [`Estimate`], or
//! says which signal it lacks. No heap, no clock, no lock: the same code runs in the service, over recordings and in
//! benches. [`JointEstimators`] holds those of one joint that the robot file has parameters for; [`calibrate`] finds the
//! parameters from a recording, [`compare`] judges the estimators on others.
//!
//! Joint torque is what the gear transmits to the link, positive about the joint's axis. Torsion is the motor angle over
//! the gear ratio minus the link angle, so a positive torque twists positively; SD eq (11) has the other sign and measures
//! the other torque. "SD" is the structural-damping paper, whose equations carry most of these estimators.
#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may"))]

pub mod calibrate;
pub mod compare;
mod compliance;
mod disturbance_observer;
mod external;
mod fusion;
mod gaussian_process;
mod joint;
mod kinematic_error;
mod log;
mod residual;
mod structural_damping;
mod taghirad;

pub use compliance::Compliance;
pub use disturbance_observer::DisturbanceObserver;
pub use external::{DETECTION_SIGMAS, External, ExternalTorque};
pub use fusion::{Fusion, TorsionLaw};
pub use gaussian_process::GaussianProcess;
pub use joint::{EstimatorError, JointEstimators, Kind};
pub use log::JointLog;
pub use residual::Residual;
pub use structural_damping::StructuralDamping;
pub use taghirad::Taghirad;

use recording::Signal;

/// After more cycles than this without a sample an estimator with memory starts again; the loop's hold time, 10 ms.
pub const GAP_MAX_CYCLES: u64 = 15;

/// What one joint's sensors read in one cycle; a signal that was not measured is NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Counts every control period, so that a gap is seen.
    pub cycle: u64,
    /// Before the gear.
    pub motor_position_rad: f64,
    /// After the gear.
    pub link_position_rad: f64,
    /// Torque the drive reports, motor side.
    pub motor_torque_nm: f64,
    /// Load at which load-dependent friction is taken, joint side: the model's gravity. Only [`Residual`] uses it.
    pub load_nm: f64,
}

/// Torque transmitted to the link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Joint side.
    pub torque_nm: f64,
    /// One standard deviation, where the estimator knows it.
    pub std_nm: Option<f64>,
}

impl Estimate {
    /// An estimate that does not say how sure it is.
    fn bare(torque_nm: f64) -> Self {
        Self {
            torque_nm,
            std_nm: None,
        }
    }
}

/// Why there is no estimate: a signal the estimator needs was not measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("needs {0}")]
pub struct Missing(pub Signal);

/// One estimator of one joint's torque.
pub trait TorqueEstimator {
    /// The joint's torque after one more sample. Cycles rise; a gap counts as time.
    ///
    /// # Errors
    /// [`Missing`]: the signal without which this sample gives no estimate. The next one may.
    fn estimate(&mut self, sample: &Sample) -> Result<Estimate, Missing>;
}

impl Sample {
    /// A value that is there.
    fn need(value: f64, signal: Signal) -> Result<f64, Missing> {
        if value.is_finite() {
            Ok(value)
        } else {
            Err(Missing(signal))
        }
    }

    fn motor_position_rad(&self) -> Result<f64, Missing> {
        Self::need(self.motor_position_rad, Signal::MotorPositionRad)
    }

    fn link_position_rad(&self) -> Result<f64, Missing> {
        Self::need(self.link_position_rad, Signal::LinkPositionRad)
    }

    fn motor_torque_nm(&self) -> Result<f64, Missing> {
        Self::need(self.motor_torque_nm, Signal::MotorTorqueNm)
    }

    /// Motor angle over gear ratio minus link angle.
    fn torsion_rad(&self, gear_ratio: f64) -> Result<f64, Missing> {
        Ok(self.motor_position_rad()? / gear_ratio - self.link_position_rad()?)
    }
}

#[cfg(test)]
mod testing {
    use robot::RobotJoint;
    use robot::estimators::{
        ComplianceParameters, DisturbanceObserverParameters, EstimatorParameters,
        GaussianProcessTable, KinematicErrorTable, TaghiradParameters,
    };

    use super::*;

    /// The shipped joint with parameters for every estimator.
    pub fn calibrated_joint() -> RobotJoint {
        let mut joint = robot::load("shd17").unwrap().joints.remove(0);
        joint.estimators = Some(EstimatorParameters {
            structural_damping: None,
            compliance: Some(compliance()),
            taghirad: Some(TaghiradParameters {
                stiffness_nm_rad: 8000.0,
                damping_nm: 2.0,
                exponent: 0.5,
                zero_rad: 0.0,
            }),
            disturbance_observer: Some(DisturbanceObserverParameters {
                coulomb_nm: [2.0; 2],
                viscous_nm_s_rad: [1.0; 2],
            }),
            gaussian_process: Some(GaussianProcessTable {
                compliance_nm: [-10.0, 10.0],
                motor_nm: [-20.0, 20.0],
                residual_nm: vec![vec![0.0, 1.0], vec![2.0, 3.0]],
                std_nm: vec![vec![0.1, 0.1], vec![0.3, 0.3]],
            }),
            fusion: Some(crate::fusion::testing::parameters()),
        });
        joint
    }

    /// SD Table II in SI, with `S_1`, `S_2` near one.
    pub fn compliance() -> ComplianceParameters {
        ComplianceParameters {
            stiffness_nm_rad: 8333.0,
            stiffening_per_nm: 0.089,
            wave_generator_stiffness_nm_rad: 1.33,
            wave_generator_stiffening_per_nm: 83.5,
            torsion_scale: 0.9,
            torque_scale: 1.1,
            zero_rad: 1e-5,
            torque_max_nm: 16.0,
            kinematic_error: KinematicErrorTable::default(),
        }
    }

    /// A sample without motor torque at this torsion, motor at zero.
    pub fn twisted(cycle: u64, torsion_rad: f64) -> Sample {
        Sample {
            cycle,
            motor_position_rad: 0.0,
            link_position_rad: -torsion_rad,
            motor_torque_nm: f64::NAN,
            load_nm: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equation_11_with_a_positive_torque_twisting_positively() {
        let sample = Sample {
            motor_position_rad: 0.5,
            ..testing::twisted(0, -0.004)
        };
        // SD's Δθ is link minus motor over N: 0.004 - 0.5/100 = -0.001
        assert!((sample.torsion_rad(100.0).unwrap() - 0.001).abs() < 1e-15);
    }
}
