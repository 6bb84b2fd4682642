//! One joint's sensors: delay, eccentricity, offset, noise, digits.

use robot::EncoderSide;

use crate::inject::{Sensing, Timing};
use crate::noise::Noise;

/// Periods of true values that are remembered for delays.
pub(crate) const HISTORY: usize = 512;

/// How a joint's sensors are built.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SensorConstants {
    pub gear_ratio: f64,
    /// Motor side.
    pub motor_resolution_rad: f64,
    /// Joint side; none without a link encoder.
    pub link_resolution_rad: Option<f64>,
    pub position_noise_rad: f64,
    /// Motor side.
    pub torque_noise_nm: f64,
    pub torque_digit_nm: f64,
    pub reports_motor_velocity: bool,
    pub joint_torque_noise_nm: Option<f64>,
}

/// What the sensors look at, at one instant.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Observed {
    pub motor_position_rad: f64,
    pub motor_velocity_rad_s: f64,
    pub motor_torque_nm: f64,
    pub link_position_rad: f64,
    pub joint_torque_nm: f64,
}

impl Observed {
    fn between(&self, later: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        Self {
            motor_position_rad: mix(self.motor_position_rad, later.motor_position_rad),
            motor_velocity_rad_s: mix(self.motor_velocity_rad_s, later.motor_velocity_rad_s),
            motor_torque_nm: mix(self.motor_torque_nm, later.motor_torque_nm),
            link_position_rad: mix(self.link_position_rad, later.link_position_rad),
            joint_torque_nm: mix(self.joint_torque_nm, later.joint_torque_nm),
        }
    }
}

/// One joint's sensors with what they saw.
#[derive(Clone, Debug)]
pub(crate) struct Sensors {
    constants: SensorConstants,
    history: Vec<Observed>,
    newest: usize,
    noise: Noise,
    drops: Noise,
}

impl Sensors {
    pub fn new(constants: SensorConstants, now: Observed, noise: Noise, drops: Noise) -> Self {
        Self {
            constants,
            history: vec![now; HISTORY],
            newest: 0,
            noise,
            drops,
        }
    }

    /// Latches the present and returns the reading, or none where it is lost.
    pub fn latch(
        &mut self,
        now: Observed,
        sensing: &Sensing,
        timing: &Timing,
        period_s: f64,
    ) -> Option<Observed> {
        self.newest = (self.newest + 1) % HISTORY;
        self.history[self.newest] = now;
        // noise and losses are drawn every period, used or not, so that one effect does not reshuffle another's
        let lost = self.drops.uniform() < timing.dropped_samples;
        let reading = self.reading(&self.seen(timing, period_s), sensing);
        (!lost).then_some(reading)
    }

    /// What the sensors show: of a while ago, and of still earlier what comes from an encoder that is later than the others.
    fn seen(&self, timing: &Timing, period_s: f64) -> Observed {
        let late = |more_s: f64| self.delayed((timing.sensor_delay_s + more_s) / period_s);
        let [motor_s, link_s] = timing.encoder_delays_s;
        let mut seen = late(0.0);
        if motor_s > 0.0 {
            let motor = late(motor_s);
            seen.motor_position_rad = motor.motor_position_rad;
            seen.motor_velocity_rad_s = motor.motor_velocity_rad_s;
        }
        if link_s > 0.0 {
            seen.link_position_rad = late(link_s).link_position_rad;
        }
        seen
    }

    /// The remembered values so many periods ago.
    fn delayed(&self, periods: f64) -> Observed {
        let whole = (periods as usize).min(HISTORY - 2);
        let at = |age: usize| &self.history[(self.newest + HISTORY - age) % HISTORY];
        at(whole).between(at(whole + 1), (periods - whole as f64).clamp(0.0, 1.0))
    }

    fn reading(&mut self, seen: &Observed, sensing: &Sensing) -> Observed {
        let constants = self.constants;
        let [motor_noise, link_noise, torque_noise, joint_noise] =
            std::array::from_fn(|_| self.noise.normal());
        let motor_rad = seen.motor_position_rad
            + constants.gear_ratio * sensing.offset_rad
            + sensing.eccentricity_rad(EncoderSide::Motor, seen.motor_position_rad)
            + constants.position_noise_rad * motor_noise;
        let link_rad = seen.link_position_rad
            + sensing.offset_rad
            + sensing.eccentricity_rad(EncoderSide::Link, seen.link_position_rad)
            + constants.position_noise_rad * link_noise;
        let reports_velocity =
            constants.reports_motor_velocity || sensing.velocity_cutoff_hz.is_some();
        Observed {
            motor_position_rad: quantised(
                motor_rad,
                sensing
                    .motor_resolution_rad
                    .unwrap_or(constants.motor_resolution_rad),
            ),
            motor_velocity_rad_s: if reports_velocity {
                seen.motor_velocity_rad_s
            } else {
                f64::NAN
            },
            motor_torque_nm: quantised(
                seen.motor_torque_nm + constants.torque_noise_nm * torque_noise,
                constants.torque_digit_nm,
            ),
            link_position_rad: constants.link_resolution_rad.map_or(f64::NAN, |own_rad| {
                quantised(link_rad, sensing.link_resolution_rad.unwrap_or(own_rad))
            }),
            joint_torque_nm: constants
                .joint_torque_noise_nm
                .map_or(f64::NAN, |noise_nm| {
                    seen.joint_torque_nm + noise_nm * joint_noise
                }),
        }
    }
}

fn quantised(value: f64, step: f64) -> f64 {
    if step > 0.0 {
        (value / step).round() * step
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Purpose;

    fn sensors() -> Sensors {
        let constants = SensorConstants {
            gear_ratio: 50.0,
            motor_resolution_rad: 0.01,
            link_resolution_rad: None,
            position_noise_rad: 0.0,
            torque_noise_nm: 0.0,
            torque_digit_nm: 0.001,
            reports_motor_velocity: false,
            joint_torque_noise_nm: None,
        };
        let stream = |purpose| Noise::new(1, purpose, 0);
        let (noise, drops) = (stream(Purpose::Sensors), stream(Purpose::DroppedSamples));
        Sensors::new(constants, Observed::default(), noise, drops)
    }

    fn at(motor_position_rad: f64) -> Observed {
        Observed {
            motor_position_rad,
            ..Observed::default()
        }
    }

    #[test]
    fn positions_come_in_steps_and_missing_sensors_are_nan() {
        let sample = sensors()
            .latch(at(1.2345), &Sensing::default(), &Timing::default(), 1e-3)
            .expect("not lost");
        assert!((sample.motor_position_rad - 1.23).abs() < 1e-12);
        assert!(sample.link_position_rad.is_nan());
        assert!(sample.motor_velocity_rad_s.is_nan());
        assert!(sample.joint_torque_nm.is_nan());
    }

    #[test]
    fn a_delay_of_a_period_and_a_half_reads_between_the_samples() {
        let mut sensors = sensors();
        let timing = Timing {
            sensor_delay_s: 1.5e-3,
            ..Timing::default()
        };
        let last = (0..10).map(|k| {
            let sample = sensors.latch(at(f64::from(k)), &Sensing::default(), &timing, 1e-3);
            sample.expect("not lost").motor_position_rad
        });
        assert!((last.last().expect("ten samples") - 7.5).abs() < 1e-9);
    }

    #[test]
    fn an_encoder_that_is_late_is_so_beside_torques_that_are_not() {
        let mut sensors = sensors();
        let timing = Timing {
            sensor_delay_s: 1e-3,
            encoder_delays_s: [2e-3, 0.0],
            ..Timing::default()
        };
        let mut last = Observed::default();
        for k in 0..10 {
            let now = Observed {
                motor_torque_nm: f64::from(k),
                ..at(f64::from(k))
            };
            let sample = sensors.latch(now, &Sensing::default(), &timing, 1e-3);
            last = sample.expect("not lost");
        }
        assert!((last.motor_position_rad - 6.0).abs() < 1e-9, "{last:?}");
        assert!((last.motor_torque_nm - 8.0).abs() < 1e-9, "{last:?}");
    }

    #[test]
    fn about_the_given_part_of_the_samples_is_lost() {
        let mut sensors = sensors();
        let timing = Timing {
            dropped_samples: 0.2,
            ..Timing::default()
        };
        let kept = (0..10_000).filter(|_| {
            sensors
                .latch(at(0.0), &Sensing::default(), &timing, 1e-3)
                .is_some()
        });
        let lost = 1.0 - kept.count() as f64 / 1e4;
        assert!((lost - 0.2).abs() < 0.02, "{lost}");
    }
}
