//! Joint torque from motor torque and velocity response (Vassileva's torque disturbance observer).
//!
//! `T = Q(s)(N T_m - T_c(sgn ω) - b(sgn ω) ω - J N² ω̇)`, joint side: the load is what the motor torque does beyond
//! friction and the rotor's inertia. `Q` is a second-order low-pass at 30 Hz; the acceleration is that of the same filter,
//! so all terms are delayed alike. Source: Vassileva et al., as SD, section I, describes it: Coulomb and viscous
//! friction with a law for each direction of motion.
//! Limits: the two friction laws meet in a jump at reversals; at rest friction may be anything up to breakaway, and the
//! estimate is off by as much; needs no link encoder; delays by 8 ms.

use joint_model::filter::{Butterworth, FilterError};
use joint_model::velocity_filter::VelocityFilter;
use robot::RobotJoint;
use robot::estimators::DisturbanceObserverParameters;

use crate::{Estimate, Missing, Sample, TorqueEstimator};

/// Passes what a joint's motion does; the motor encoder's second derivative is useless above.
const CUTOFF_HZ: f64 = 30.0;

/// One joint's disturbance observer.
#[derive(Clone, Debug)]
pub struct DisturbanceObserver {
    parameters: DisturbanceObserverParameters,
    gear_ratio: f64,
    reflected_inertia_kg_m2: f64,
    period_s: f64,
    velocity: VelocityFilter,
    velocity_rad_s: f64,
    acceleration_rad_s2: f64,
    cycle: Option<u64>,
    drive: Butterworth,
}

impl DisturbanceObserver {
    /// An estimator with these parameters and the joint's rotor inertia.
    ///
    /// # Errors
    /// [`FilterError`] if the control period is too long for its filters.
    pub fn new(
        parameters: DisturbanceObserverParameters,
        joint: &RobotJoint,
        period_s: f64,
    ) -> Result<Self, FilterError> {
        let rate_hz = 1.0 / period_s;
        Ok(Self {
            parameters,
            gear_ratio: joint.gear_ratio,
            reflected_inertia_kg_m2: joint.reflected_inertia_kg_m2(),
            period_s,
            velocity: VelocityFilter::new(2, CUTOFF_HZ, rate_hz)?,
            velocity_rad_s: 0.0,
            acceleration_rad_s2: 0.0,
            cycle: None,
            drive: Butterworth::design(2, CUTOFF_HZ, rate_hz)?,
        })
    }

    fn move_to(&mut self, cycle: u64, position_rad: f64) {
        let before_rad_s = self.velocity_rad_s;
        self.velocity_rad_s = self.velocity.observe(cycle, position_rad, self.period_s);
        let cycles = self.cycle.map_or(1, |before| cycle.saturating_sub(before));
        if cycles > 0 {
            self.acceleration_rad_s2 =
                (self.velocity_rad_s - before_rad_s) / (cycles as f64 * self.period_s);
        }
        self.cycle = Some(cycle);
    }

    fn friction_nm(&self) -> f64 {
        let velocity_rad_s = self.velocity_rad_s;
        if velocity_rad_s == 0.0 {
            return 0.0;
        }
        let side = usize::from(velocity_rad_s < 0.0);
        self.parameters.coulomb_nm[side].copysign(velocity_rad_s)
            + self.parameters.viscous_nm_s_rad[side] * velocity_rad_s
    }
}

impl TorqueEstimator for DisturbanceObserver {
    fn estimate(&mut self, sample: &Sample) -> Result<Estimate, Missing> {
        let position_rad = sample.motor_position_rad()? / self.gear_ratio;
        let motor_torque_nm = sample.motor_torque_nm()?;
        self.move_to(sample.cycle, position_rad);
        let drive_nm = self.drive.step(self.gear_ratio * motor_torque_nm);
        Ok(Estimate::bare(
            drive_nm - self.friction_nm() - self.reflected_inertia_kg_m2 * self.acceleration_rad_s2,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_friction_and_inertia_leave_of_a_constant_torque() {
        let joint = robot::load("shd17").unwrap().joints.remove(0);
        let parameters = DisturbanceObserverParameters {
            coulomb_nm: [2.0, 3.0],
            viscous_nm_s_rad: [1.0, 4.0],
        };
        for (direction, friction_nm) in [(1.0, 2.0 + 1.0 * 0.5), (-1.0, -(3.0 + 4.0 * 0.5))] {
            let mut observer = DisturbanceObserver::new(parameters, &joint, 1e-3).unwrap();
            let mut found_nm = 0.0;
            for cycle in 0..1000 {
                let sample = Sample {
                    cycle,
                    motor_position_rad: direction * 100.0 * 0.5 * cycle as f64 * 1e-3,
                    link_position_rad: f64::NAN,
                    motor_torque_nm: 0.1,
                    load_nm: 0.0,
                };
                found_nm = observer.estimate(&sample).unwrap().torque_nm;
            }
            assert!((found_nm - (10.0 - friction_nm)).abs() < 1e-6, "{found_nm}");
        }
    }

    #[test]
    fn an_acceleration_takes_rotor_inertia_times_it() {
        let joint = robot::load("shd17").unwrap().joints.remove(0);
        let none = DisturbanceObserverParameters {
            coulomb_nm: [0.0; 2],
            viscous_nm_s_rad: [0.0; 2],
        };
        let mut observer = DisturbanceObserver::new(none, &joint, 1e-3).unwrap();
        let mut found_nm = 0.0;
        for cycle in 0..1000 {
            let time_s = cycle as f64 * 1e-3;
            let sample = Sample {
                cycle,
                motor_position_rad: 100.0 * 0.5 * 2.0 * time_s * time_s,
                link_position_rad: f64::NAN,
                motor_torque_nm: 0.0,
                load_nm: 0.0,
            };
            found_nm = observer.estimate(&sample).unwrap().torque_nm;
        }
        // 1.14e-5 kg m² behind a hundredfold gear, at 2 rad/s²
        assert!((found_nm + 0.228).abs() < 1e-6, "{found_nm}");
    }
}
