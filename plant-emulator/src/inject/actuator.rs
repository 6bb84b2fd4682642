//! Effects on the motor: torque constant, offset, ripple, saturation, lag.

use arrayvec::ArrayVec;
use joint_model::harmonic::{self, Harmonic};
use robot::effect::parts::{self, Full};

/// The most ripple harmonics of one joint.
const RIPPLES_MAX: usize = 8;

/// What lies between the torque the drive means to give and the torque at the shaft.
#[derive(Clone, Debug)]
pub(crate) struct Actuator {
    /// True over nominal torque constant.
    gain: f64,
    /// Joint side.
    offset_nm: f64,
    /// Motor side.
    ripples: ArrayVec<Harmonic, RIPPLES_MAX>,
    /// Largest torque, motor side.
    pub limit_nm: f64,
    /// Added to the current loop's time constant.
    pub lag_s: f64,
}

impl Default for Actuator {
    fn default() -> Self {
        Self {
            gain: 1.0,
            offset_nm: 0.0,
            ripples: ArrayVec::new(),
            limit_nm: f64::INFINITY,
            lag_s: 0.0,
        }
    }
}

impl parts::Actuator for Actuator {
    fn scale_torque(&mut self, gain: f64) {
        self.gain *= gain;
    }

    fn add_torque(&mut self, offset_nm: f64) {
        self.offset_nm += offset_nm;
    }

    fn add_ripple(&mut self, ripple_nm: Harmonic) -> Result<(), Full> {
        Full::push(&mut self.ripples, ripple_nm)
    }

    fn limit_torque(&mut self, limit_nm: f64) {
        self.limit_nm = self.limit_nm.min(limit_nm);
    }

    fn add_lag(&mut self, time_constant_s: f64) {
        self.lag_s += time_constant_s;
    }
}

impl Actuator {
    /// Motor torque at the shaft for the torque the drive reports.
    pub fn shaft_nm(&self, reported_nm: f64, motor_position_rad: f64, gear_ratio: f64) -> f64 {
        self.gain * reported_nm + self.disturbance_nm(motor_position_rad, gear_ratio)
    }

    /// Undoes [`Actuator::shaft_nm`].
    pub fn reported_nm(&self, shaft_nm: f64, motor_position_rad: f64, gear_ratio: f64) -> f64 {
        (shaft_nm - self.disturbance_nm(motor_position_rad, gear_ratio)) / self.gain
    }

    fn disturbance_nm(&self, motor_position_rad: f64, gear_ratio: f64) -> f64 {
        let ripple_nm = harmonic::sum(&self.ripples, motor_position_rad);
        ripple_nm + self.offset_nm / gear_ratio
    }
}
