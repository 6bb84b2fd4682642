//! The torque estimator's answer to a sample: every joint's estimates in one message.

use estimators::{EstimatorError, JointEstimators, Kind, Sample};
use joint_model::rigid_body::Chain;
use robot::Robot;
use shm_types::messages::{ABSENT, PerJoint, Readings, SensorSample, TorqueEstimate};

/// All estimators of one robot.
#[derive(Clone, Debug)]
pub struct Estimators {
    chain: Chain,
    gear_ratios: Vec<f64>,
    joints: Vec<JointEstimators>,
}

impl Estimators {
    /// Estimators with the robot file's values.
    ///
    /// # Errors
    /// [`EstimatorError`] if the control period is too long for their filters, or the robot file lacks an encoder's step.
    pub fn new(robot: &Robot, period_s: f64) -> Result<Self, EstimatorError> {
        let joints = robot
            .joints
            .iter()
            .map(|joint| JointEstimators::new(joint, period_s));
        Ok(Self {
            joints: joints.collect::<Result<_, _>>()?,
            gear_ratios: robot.joints.iter().map(|joint| joint.gear_ratio).collect(),
            chain: robot.chain.clone(),
        })
    }

    /// The estimates for one sample. No allocation, no clock.
    pub fn estimate(&mut self, sample: &SensorSample) -> TorqueEstimate {
        let mut answer = TorqueEstimate {
            header: sample.header,
            residual_torque_nm: ABSENT,
            structural_damping_torque_nm: ABSENT,
            fusion_torque_nm: ABSENT,
            fusion_std_nm: ABSENT,
        };
        let readings = &sample.readings;
        let load_nm = self.gravity_nm(readings);
        for (index, joint) in self.joints.iter_mut().enumerate() {
            let sample = Sample {
                cycle: sample.header.cycle,
                motor_position_rad: readings.motor_position_rad[index],
                link_position_rad: readings.link_position_rad[index],
                motor_torque_nm: readings.motor_torque_nm[index],
                load_nm: load_nm[index],
            };
            for (kind, torque_nm) in [
                (Kind::Residual, &mut answer.residual_torque_nm[index]),
                (
                    Kind::StructuralDamping,
                    &mut answer.structural_damping_torque_nm[index],
                ),
            ] {
                if let Some(Ok(estimate)) = joint.estimate(kind, &sample) {
                    *torque_nm = estimate.torque_nm;
                }
            }
            if let Some(Ok(estimate)) = joint.estimate(Kind::Fusion, &sample) {
                answer.fusion_torque_nm[index] = estimate.torque_nm;
                answer.fusion_std_nm[index] = estimate.std_nm.unwrap_or(f64::NAN);
            }
        }
        answer
    }

    /// Gravity at the measured motor angles over the gear ratios; a joint without one counts as at zero.
    fn gravity_nm(&self, readings: &Readings) -> PerJoint {
        let mut position_rad = PerJoint::default();
        for (index, gear_ratio) in self.gear_ratios.iter().enumerate() {
            let motor_rad = readings.motor_position_rad[index];
            if motor_rad.is_finite() {
                position_rad[index] = motor_rad / gear_ratio;
            }
        }
        let count = self.joints.len();
        let mut gravity_nm = PerJoint::default();
        self.chain
            .gravity_torque(&position_rad[..count], &mut gravity_nm[..count]);
        gravity_nm
    }
}
