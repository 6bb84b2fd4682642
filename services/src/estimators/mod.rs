//! Joint torque without a torque sensor: one estimator, one file.

mod residual;
mod structural_damping;

pub use residual::Residual;
pub use structural_damping::StructuralDamping;

use joint_model::filter::FilterError;
use robot::Robot;
use shm_types::messages::{ABSENT, SensorSample, TorqueEstimate};

/// All estimators of one robot.
#[derive(Clone, Debug)]
pub struct Estimators {
    joints: Vec<JointEstimators>,
}

#[derive(Clone, Debug)]
struct JointEstimators {
    gear_ratio: f64,
    residual: Residual,
    structural_damping: StructuralDamping,
}

impl Estimators {
    /// Estimators with the robot file's values.
    ///
    /// # Errors
    /// [`FilterError`] if the control period is too long for their filters.
    pub fn new(robot: &Robot, period_s: f64) -> Result<Self, FilterError> {
        let joints = robot.joints.iter().map(|joint| {
            Ok(JointEstimators {
                gear_ratio: joint.gear_ratio,
                residual: Residual::new(joint, period_s)?,
                structural_damping: StructuralDamping::new(joint, period_s),
            })
        });
        Ok(Self {
            joints: joints.collect::<Result<_, _>>()?,
        })
    }

    /// The estimates for one sample. No allocation, no clock.
    pub fn estimate(&mut self, sample: &SensorSample) -> TorqueEstimate {
        let mut estimate = TorqueEstimate {
            header: sample.header,
            residual_torque_nm: ABSENT,
            structural_damping_torque_nm: ABSENT,
        };
        let readings = &sample.readings;
        for (index, joint) in self.joints.iter_mut().enumerate() {
            let motor_position_rad = readings.motor_position_rad[index];
            estimate.residual_torque_nm[index] = joint.residual.estimate_nm(
                sample.header.cycle,
                motor_position_rad,
                readings.motor_torque_nm[index],
            );
            let torsion_rad =
                motor_position_rad / joint.gear_ratio - readings.link_position_rad[index];
            estimate.structural_damping_torque_nm[index] =
                joint.structural_damping.estimate_nm(torsion_rad);
        }
        estimate
    }
}
