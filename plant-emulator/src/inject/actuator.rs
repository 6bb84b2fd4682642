//! Effects on the motor: torque constant, offset, ripple, saturation, lag.

use arrayvec::ArrayVec;
use robot::Effect;

use super::Full;

/// The most ripple harmonics of one joint.
const RIPPLES_MAX: usize = 8;

#[derive(Clone, Copy, Debug)]
struct Ripple {
    amplitude_nm: f64,
    cycles_per_motor_rev: f64,
    phase_rad: f64,
}

/// What lies between the torque the drive means to give and the torque at the shaft.
#[derive(Clone, Debug)]
pub(crate) struct Actuator {
    /// True over nominal torque constant.
    gain: f64,
    /// Joint side.
    offset_nm: f64,
    ripples: ArrayVec<Ripple, RIPPLES_MAX>,
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

impl Actuator {
    pub(super) fn add(&mut self, effect: &Effect, strength: f64) -> Result<(), Full> {
        match *effect {
            Effect::TorqueConstantError { gain } => self.gain *= 1.0 + strength * (gain - 1.0),
            Effect::TorqueOffset { offset_nm } => self.offset_nm += strength * offset_nm,
            Effect::TorqueRipple {
                amplitude_nm,
                cycles_per_motor_rev,
                phase_rad,
            } => {
                let ripple = Ripple {
                    amplitude_nm: strength * amplitude_nm,
                    cycles_per_motor_rev,
                    phase_rad,
                };
                return self.ripples.try_push(ripple).map_err(Full::of(RIPPLES_MAX));
            }
            Effect::TorqueSaturation { limit_nm } => self.limit_nm = self.limit_nm.min(limit_nm),
            Effect::CurrentLoopLag { time_constant_s } => self.lag_s += strength * time_constant_s,
            _ => {}
        }
        Ok(())
    }

    /// Motor torque at the shaft for the torque the drive reports.
    pub fn shaft_nm(&self, reported_nm: f64, motor_position_rad: f64, gear_ratio: f64) -> f64 {
        self.gain * reported_nm + self.disturbance_nm(motor_position_rad, gear_ratio)
    }

    /// Undoes [`Actuator::shaft_nm`].
    pub fn reported_nm(&self, shaft_nm: f64, motor_position_rad: f64, gear_ratio: f64) -> f64 {
        (shaft_nm - self.disturbance_nm(motor_position_rad, gear_ratio)) / self.gain
    }

    fn disturbance_nm(&self, motor_position_rad: f64, gear_ratio: f64) -> f64 {
        let ripple_nm: f64 = self
            .ripples
            .iter()
            .map(|ripple| {
                let angle = ripple.cycles_per_motor_rev * motor_position_rad + ripple.phase_rad;
                ripple.amplitude_nm * angle.sin()
            })
            .sum();
        ripple_nm + self.offset_nm / gear_ratio
    }
}
