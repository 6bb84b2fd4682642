//! Joint torque without a torque sensor: one estimator, one file.

mod residual;
mod structural_damping;

pub use residual::Residual;
pub use structural_damping::StructuralDamping;

use joint_model::filter::FilterError;
use joint_model::rigid_body::Chain;
use robot::Robot;
use shm_types::messages::{ABSENT, PerJoint, Readings, SensorSample, TorqueEstimate};

/// All estimators of one robot.
#[derive(Clone, Debug)]
pub struct Estimators {
    chain: Chain,
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
            chain: robot.chain.clone(),
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
        let gravity_nm = self.gravity_nm(readings);
        for (index, joint) in self.joints.iter_mut().enumerate() {
            let motor_position_rad = readings.motor_position_rad[index];
            estimate.residual_torque_nm[index] = joint.residual.estimate_nm(
                sample.header.cycle,
                motor_position_rad,
                readings.motor_torque_nm[index],
                gravity_nm[index],
            );
            let torsion_rad =
                motor_position_rad / joint.gear_ratio - readings.link_position_rad[index];
            estimate.structural_damping_torque_nm[index] =
                joint.structural_damping.estimate_nm(torsion_rad);
        }
        estimate
    }

    /// Gravity at the measured motor angles over the gear ratios; a joint without one counts as at zero.
    fn gravity_nm(&self, readings: &Readings) -> PerJoint {
        let mut position_rad = PerJoint::default();
        for (index, joint) in self.joints.iter().enumerate() {
            let motor_rad = readings.motor_position_rad[index];
            if motor_rad.is_finite() {
                position_rad[index] = motor_rad / joint.gear_ratio;
            }
        }
        let count = self.joints.len();
        let mut gravity_nm = PerJoint::default();
        self.chain
            .gravity_torque(&position_rad[..count], &mut gravity_nm[..count]);
        gravity_nm
    }
}
