//! What a law on no list does to a joint, instant by instant.

use std::f64::consts::TAU;

use plant_emulator::{ArmMotion, Disturbance};

use super::Unlisted;

/// Friction that comes from here turns round over this speed.
const TURNING_RAD_S: f64 = 0.005;
/// Slower than this a joint stands, for a contact that ages.
const STANDING_RAD_S: f64 = 0.01;

#[derive(Debug)]
pub(super) struct AtWork {
    law: Unlisted,
    joint: usize,
    nm: f64,
    /// Velocity through one low-pass and through two.
    smooth_rad_s: [f64; 2],
    since_reversal_s: f64,
    direction: f64,
    /// Way since the start, and since the joint last stood.
    travel_rad: [f64; 2],
    stood_s: f64,
    /// What drags along, -1 to 1.
    dragged: f64,
}

impl AtWork {
    pub fn new(law: Unlisted, joint: usize, nm: f64) -> Self {
        Self {
            law,
            joint,
            nm,
            smooth_rad_s: [0.0; 2],
            since_reversal_s: 0.0,
            direction: 0.0,
            travel_rad: [0.0; 2],
            stood_s: 0.0,
            dragged: 0.0,
        }
    }
}

impl Disturbance for AtWork {
    fn torque_nm(&mut self, arm: &ArmMotion<'_>) -> f64 {
        let position_rad = arm.link_position_rad[self.joint];
        let velocity_rad_s = arm.link_velocity_rad_s[self.joint];
        let against = -(velocity_rad_s / TURNING_RAD_S).tanh();
        let shape = match &self.law {
            Unlisted::FrictionBump { at_rad, width_rad } => {
                against * (-0.5 * ((position_rad - at_rad) / width_rad).powi(2)).exp()
            }
            Unlisted::Coupling { joint, speed_rad_s } => {
                -arm.link_velocity_rad_s[*joint] / speed_rad_s
            }
            Unlisted::Jerk {
                jerk_rad_s3,
                smoothing_s,
            } => {
                let [once, twice] = &mut self.smooth_rad_s;
                let share = (arm.step_s / smoothing_s).min(1.0);
                *once += share * (velocity_rad_s - *once);
                *twice += share * (*once - *twice);
                let jerk_rad_s3_now = (velocity_rad_s - 2.0 * *once + *twice) / smoothing_s.powi(2);
                -(jerk_rad_s3_now / jerk_rad_s3).clamp(-5.0, 5.0)
            }
            Unlisted::Vibration {
                frequency_hz,
                phase_rad,
            } => (TAU * frequency_hz * arm.time_s + phase_rad).sin(),
            Unlisted::Wandering { lines } => lines
                .iter()
                .map(|[amplitude, hz, phase_rad]| {
                    amplitude * (TAU * hz * arm.time_s + phase_rad).sin()
                })
                .sum(),
            Unlisted::ReversalGrowth { time_constant_s } => {
                if velocity_rad_s.abs() > TURNING_RAD_S && velocity_rad_s.signum() != self.direction
                {
                    self.direction = velocity_rad_s.signum();
                    self.since_reversal_s = 0.0;
                }
                self.since_reversal_s += arm.step_s;
                against * -(-self.since_reversal_s / time_constant_s).exp_m1()
            }
            Unlisted::Step { at_s, sign } => sign * ((arm.time_s - at_s) / 0.05).clamp(0.0, 1.0),
            Unlisted::Cushion {
                from_rad,
                depth_rad,
                sign,
            } => -sign * (sign * (position_rad - from_rad) / depth_rad).max(0.0),
            Unlisted::Snags { bursts } => bursts
                .iter()
                .map(|[at_s, length_s, sign]| {
                    let inside = (arm.time_s - at_s) / length_s;
                    if (0.0..1.0).contains(&inside) {
                        sign * (TAU / 2.0 * inside).sin()
                    } else {
                        0.0
                    }
                })
                .sum(),
            Unlisted::Detents {
                spacing_rad,
                sharpness,
                phase_rad,
            } => {
                let angle = TAU * position_rad / spacing_rad + phase_rad;
                -angle.sin() * (sharpness * (angle.cos() - 1.0)).exp()
            }
            Unlisted::Ageing {
                time_constant_s,
                memory_rad,
            } => {
                if velocity_rad_s.abs() < STANDING_RAD_S {
                    self.stood_s += arm.step_s;
                    self.travel_rad[1] = 0.0;
                } else {
                    self.travel_rad[1] += velocity_rad_s.abs() * arm.step_s;
                    if self.travel_rad[1] > 5.0 * memory_rad {
                        self.stood_s = 0.0;
                    }
                }
                let aged = (self.stood_s / time_constant_s).ln_1p();
                against * aged * (-self.travel_rad[1] / memory_rad).exp()
            }
            Unlisted::Drape { yield_rad } => {
                let way_rad = velocity_rad_s * arm.step_s;
                self.dragged += (way_rad - way_rad.abs() * self.dragged) / yield_rad;
                -self.dragged
            }
            Unlisted::SpeedRipple {
                cycles,
                speed_rad_s,
                phase_rad,
            } => {
                let speed = (velocity_rad_s / speed_rad_s).powi(2).min(4.0);
                speed * (cycles * position_rad + phase_rad).sin()
            }
            Unlisted::RunningIn { way_rad } => {
                self.travel_rad[0] += velocity_rad_s.abs() * arm.step_s;
                against * (-self.travel_rad[0] / way_rad).exp()
            }
            Unlisted::OneWay {
                from_rad,
                over_rad,
                sign,
            } => {
                let within = 0.5 * (1.0 + ((position_rad - from_rad) / over_rad).tanh());
                0.5 * (against - sign) * within
            }
            Unlisted::CrossLoad {
                joint,
                per_rad,
                phase_rad,
            } => (per_rad * arm.link_position_rad[*joint] + phase_rad).sin(),
            Unlisted::Root { speed_rad_s } => {
                against * (velocity_rad_s.abs() / speed_rad_s).sqrt().min(4.0)
            }
        };
        self.nm * shape
    }
}
