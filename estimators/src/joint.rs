//! The estimators of one joint.

use joint_model::filter::FilterError;
use joint_model::rigid_body::ChainError;
use recording::Signal;
use robot::RobotJoint;
use serde::{Deserialize, Serialize};

use crate::fusion::NoResolution;
use crate::{
    Compliance, DisturbanceObserver, Estimate, Fusion, GaussianProcess, Missing, Residual, Sample,
    StructuralDamping, Taghirad, TorqueEstimator,
};

/// Which estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// [`Residual`]
    Residual,
    /// [`StructuralDamping`]
    StructuralDamping,
    /// [`Compliance`]
    Compliance,
    /// [`Taghirad`]
    Taghirad,
    /// [`DisturbanceObserver`]
    DisturbanceObserver,
    /// [`GaussianProcess`]
    GaussianProcess,
    /// [`Fusion`]
    Fusion,
}

impl Kind {
    /// All, in the order of reports.
    pub const ALL: [Self; 7] = [
        Self::StructuralDamping,
        Self::Compliance,
        Self::Taghirad,
        Self::DisturbanceObserver,
        Self::GaussianProcess,
        Self::Residual,
        Self::Fusion,
    ];
    /// The five of the torque paper and its references.
    pub const PUBLISHED: [Self; 5] = [
        Self::StructuralDamping,
        Self::Compliance,
        Self::Taghirad,
        Self::DisturbanceObserver,
        Self::GaussianProcess,
    ];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Residual => "residual",
            Self::StructuralDamping => "structural damping",
            Self::Compliance => "compliance",
            Self::Taghirad => "Taghirad",
            Self::DisturbanceObserver => "disturbance observer",
            Self::GaussianProcess => "Gaussian process",
            Self::Fusion => "fusion",
        }
    }

    /// As the command line and JSON have it.
    pub fn identifier(self) -> &'static str {
        match self {
            Self::Residual => "residual",
            Self::StructuralDamping => "structural_damping",
            Self::Compliance => "compliance",
            Self::Taghirad => "taghirad",
            Self::DisturbanceObserver => "disturbance_observer",
            Self::GaussianProcess => "gaussian_process",
            Self::Fusion => "fusion",
        }
    }

    /// The signals without which it gives no estimate.
    pub fn needs(self) -> &'static [Signal] {
        use Signal::{LinkPositionRad, MotorPositionRad, MotorTorqueNm};
        match self {
            Self::StructuralDamping | Self::Taghirad => &[MotorPositionRad, LinkPositionRad],
            Self::Residual | Self::DisturbanceObserver => &[MotorPositionRad, MotorTorqueNm],
            Self::Compliance | Self::GaussianProcess | Self::Fusion => {
                &[MotorPositionRad, LinkPositionRad, MotorTorqueNm]
            }
        }
    }

    /// The estimator of that identifier.
    pub fn from_identifier(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.identifier() == name)
    }
}

/// Why a joint's estimators cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EstimatorError {
    /// The control period is too long for a filter.
    #[error("joint `{joint}`: samples come too seldom for a torque estimator's filter ({source})")]
    Filter {
        /// The joint.
        joint: String,
        /// The filter's demand.
        source: FilterError,
    },
    /// An encoder's step is not known.
    #[error("joint `{joint}`: {source}")]
    Resolution {
        /// The joint.
        joint: String,
        /// Which.
        source: NoResolution,
    },
    /// The control period is too long for the external torque's filter.
    #[error("external torque: samples come too seldom for its filter ({0})")]
    ExternalFilter(FilterError),
    /// A link cannot be heavier by its tolerance.
    #[error("external torque: {0}")]
    Bodies(ChainError),
}

/// All estimators that a joint has parameters for; the residual's are the model itself.
#[derive(Clone, Debug)]
pub struct JointEstimators {
    residual: Residual,
    structural_damping: Option<StructuralDamping>,
    compliance: Option<Compliance>,
    taghirad: Option<Taghirad>,
    disturbance_observer: Option<DisturbanceObserver>,
    gaussian_process: Option<GaussianProcess>,
    fusion: Option<Box<Fusion>>,
}

impl JointEstimators {
    /// Estimators with the robot file's parameters. Structural damping has nominal ones where it was not calibrated.
    ///
    /// # Errors
    /// [`EstimatorError`]: the filter or the robot file's key that stands in the way.
    pub fn new(joint: &RobotJoint, period_s: f64) -> Result<Self, EstimatorError> {
        let filter = |source| EstimatorError::Filter {
            joint: joint.name.clone(),
            source,
        };
        let ratio = joint.gear_ratio;
        let known = joint.estimators.clone().unwrap_or_default();
        let damping = known
            .structural_damping
            .or_else(|| StructuralDamping::nominal(joint));
        let process = known.compliance.as_ref().zip(known.gaussian_process);
        Ok(Self {
            residual: Residual::new(joint, period_s).map_err(filter)?,
            structural_damping: damping.map(|found| StructuralDamping::new(found, ratio, period_s)),
            compliance: known
                .compliance
                .as_ref()
                .map(|found| Compliance::new(found, ratio)),
            taghirad: known
                .taghirad
                .map(|found| Taghirad::new(found, ratio, period_s))
                .transpose()
                .map_err(filter)?,
            disturbance_observer: known
                .disturbance_observer
                .map(|found| DisturbanceObserver::new(found, joint, period_s))
                .transpose()
                .map_err(filter)?,
            gaussian_process: process
                .map(|(model, table)| GaussianProcess::new(model, table, ratio)),
            fusion: known
                .fusion
                .map(|found| Fusion::new(&found, joint, period_s).map(Box::new))
                .transpose()
                .map_err(|source| EstimatorError::Resolution {
                    joint: joint.name.clone(),
                    source,
                })?,
        })
    }

    /// The estimator of a kind, if the joint has it.
    pub fn get(&mut self, kind: Kind) -> Option<&mut dyn TorqueEstimator> {
        fn shown<T: TorqueEstimator>(found: Option<&mut T>) -> Option<&mut dyn TorqueEstimator> {
            found.map(|estimator| estimator as &mut dyn TorqueEstimator)
        }
        match kind {
            Kind::Residual => shown(Some(&mut self.residual)),
            Kind::StructuralDamping => shown(self.structural_damping.as_mut()),
            Kind::Compliance => shown(self.compliance.as_mut()),
            Kind::Taghirad => shown(self.taghirad.as_mut()),
            Kind::DisturbanceObserver => shown(self.disturbance_observer.as_mut()),
            Kind::GaussianProcess => shown(self.gaussian_process.as_mut()),
            Kind::Fusion => shown(self.fusion.as_deref_mut()),
        }
    }

    /// The estimate of a kind, if the joint has it.
    pub fn estimate(&mut self, kind: Kind, sample: &Sample) -> Option<Result<Estimate, Missing>> {
        self.get(kind).map(|estimator| estimator.estimate(sample))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::calibrated_joint;
    use recording::Signal;

    const PERIOD_S: f64 = 1.0 / 1500.0;

    fn without(signal: Option<Signal>) -> Sample {
        let value = |own: Signal, value: f64| {
            if signal == Some(own) { f64::NAN } else { value }
        };
        Sample {
            cycle: 0,
            motor_position_rad: value(Signal::MotorPositionRad, 10.0),
            link_position_rad: value(Signal::LinkPositionRad, 0.0995),
            motor_torque_nm: value(Signal::MotorTorqueNm, 0.05),
            load_nm: 0.6,
        }
    }

    #[test]
    fn every_estimator_names_every_signal_it_needs_and_no_other() {
        for kind in Kind::ALL {
            let answer = |signal| {
                let mut joint = JointEstimators::new(&calibrated_joint(), PERIOD_S).unwrap();
                joint.estimate(kind, &without(signal)).unwrap()
            };
            assert!(answer(None).is_ok(), "{kind:?}");
            for signal in [
                Signal::MotorPositionRad,
                Signal::LinkPositionRad,
                Signal::MotorTorqueNm,
            ] {
                let found = answer(Some(signal));
                if kind.needs().contains(&signal) {
                    assert_eq!(found, Err(Missing(signal)), "{kind:?}");
                } else {
                    assert!(found.is_ok(), "{kind:?} without {signal}: {found:?}");
                }
            }
        }
    }
}
