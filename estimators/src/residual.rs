//! Motor torque minus what the model says is lost before the link: friction and rotor inertia.
//!
//! `T_j = N T_m - T_friction(θ̇, T_g) - J N² θ̈`, joint side. The load that friction depends on is the model's gravity, as
//! where it was identified. It cannot be the estimate itself: between the knees of PA10-05, Table V, friction changes by 2 to 5 Nm
//! per Nm of load, so an error would come back multiplied. Limits: a payload is no load for it;
//! at standstill friction takes any value up to breakaway, so the estimate is off by as much.

use joint_model::filter::{Butterworth, FilterError};
use joint_model::friction::SteadyFriction;
use joint_model::velocity_filter::VelocityFilter;
use robot::RobotJoint;

use crate::{Estimate, Missing, Sample, TorqueEstimator};

/// Passes what a harmonic drive's joint can do by itself, and little of the resolver's steps.
const VELOCITY_CUTOFF_HZ: f64 = 50.0;
/// The second derivative of a quantised position needs more smoothing.
const ACCELERATION_CUTOFF_HZ: f64 = 15.0;
/// Friction is counted fully above this velocity; below, the direction of motion is lost in quantisation.
const REVERSAL_VELOCITY_RAD_S: f64 = 0.005;

/// One joint's residual estimator.
#[derive(Clone, Debug)]
pub struct Residual {
    friction: SteadyFriction,
    gear_ratio: f64,
    reflected_inertia_kg_m2: f64,
    velocity: VelocityFilter,
    acceleration: Butterworth,
    velocity_rad_s: f64,
    period_s: f64,
}

impl Residual {
    /// An estimator with the robot file's friction and rotor inertia.
    ///
    /// # Errors
    /// [`FilterError`] if the control period is too long for its filters.
    pub fn new(joint: &RobotJoint, period_s: f64) -> Result<Self, FilterError> {
        let rate_hz = 1.0 / period_s;
        Ok(Self {
            friction: joint.steady_friction(),
            gear_ratio: joint.gear_ratio,
            reflected_inertia_kg_m2: joint.reflected_inertia_kg_m2(),
            velocity: VelocityFilter::new(2, VELOCITY_CUTOFF_HZ, rate_hz)?,
            acceleration: Butterworth::design(2, ACCELERATION_CUTOFF_HZ, rate_hz)?,
            velocity_rad_s: 0.0,
            period_s,
        })
    }
}

impl TorqueEstimator for Residual {
    fn estimate(&mut self, sample: &Sample) -> Result<Estimate, Missing> {
        let motor_position_rad = sample.motor_position_rad()?;
        let motor_torque_nm = sample.motor_torque_nm()?;
        let position_rad = motor_position_rad / self.gear_ratio;
        let velocity_rad_s = self
            .velocity
            .observe(sample.cycle, position_rad, self.period_s);
        let acceleration_rad_s2 = self
            .acceleration
            .step((velocity_rad_s - self.velocity_rad_s) / self.period_s);
        self.velocity_rad_s = velocity_rad_s;
        let friction_nm = self.friction.drag_nm(
            velocity_rad_s,
            sample.load_nm,
            motor_position_rad,
            REVERSAL_VELOCITY_RAD_S,
        );
        Ok(Estimate::bare(
            self.gear_ratio * motor_torque_nm
                - friction_nm
                - self.reflected_inertia_kg_m2 * acceleration_rad_s2,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_models_friction_and_the_rotor_leave_of_the_motor_torque() {
        let joint = robot::load("shd17").unwrap().joints.remove(0);
        for direction in [1.0, -1.0] {
            let mut residual = Residual::new(&joint, 1e-3).unwrap();
            let mut found_nm = 0.0;
            for cycle in 0..2000 {
                let sample = Sample {
                    cycle,
                    motor_position_rad: direction * 100.0 * 0.5 * cycle as f64 * 1e-3,
                    link_position_rad: f64::NAN,
                    motor_torque_nm: direction * 0.1,
                    load_nm: 0.0,
                };
                found_nm = residual.estimate(&sample).unwrap().torque_nm;
            }
            // steady at 0.5 rad/s: 10 Nm less 2 Nm of Coulomb, 1·0.5 Nm of viscous and 0.6·e^-10 Nm of Stribeck friction
            let expected_nm = direction * (7.5 - 0.6 * (-10.0_f64).exp());
            assert!((found_nm - expected_nm).abs() < 1e-6, "{found_nm}");
        }
    }

    #[test]
    fn an_acceleration_takes_rotor_inertia_times_it() {
        let mut joint = robot::load("shd17").unwrap().joints.remove(0);
        joint.effects.clear();
        let mut residual = Residual::new(&joint, 1e-3).unwrap();
        let mut found_nm = 0.0;
        for cycle in 0..2000 {
            let time_s = cycle as f64 * 1e-3;
            let sample = Sample {
                cycle,
                motor_position_rad: 100.0 * 0.5 * 2.0 * time_s * time_s,
                link_position_rad: f64::NAN,
                motor_torque_nm: 0.0,
                load_nm: 0.0,
            };
            found_nm = residual.estimate(&sample).unwrap().torque_nm;
        }
        // 1.14e-5 kg m² behind a hundredfold gear, at 2 rad/s²
        assert!((found_nm + 0.228).abs() < 1e-6, "{found_nm}");
    }
}
