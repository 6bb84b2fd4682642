//! Torques that are on no list, for which `unknown` is the only right answer.

use std::f64::consts::TAU;

use plant_emulator::{ArmMotion, Disturbance};
use serde::{Deserialize, Serialize};

use crate::random::Random;
use crate::sizes::Sizes;

/// Friction that comes from here turns round over this speed.
const TURNING_RAD_S: f64 = 0.005;

/// A law on no list; its strength is torque of the size of `nm`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "law", rename_all = "snake_case")]
pub enum Unlisted {
    /// More friction about one place of the joint.
    FrictionBump {
        /// There.
        at_rad: f64,
        /// As wide as a normal distribution's deviation.
        width_rad: f64,
    },
    /// Drag by another joint's speed.
    Coupling {
        /// Its index.
        joint: usize,
        /// Speed at which the torque is `nm`.
        speed_rad_s: f64,
    },
    /// Against the jerk and in proportion to it.
    Jerk {
        /// Jerk at which the torque is `nm`.
        jerk_rad_s3: f64,
        /// Time constant of the low-passes that acceleration and jerk are seen through.
        smoothing_s: f64,
    },
    /// A shaking from outside.
    Vibration {
        /// Its frequency.
        frequency_hz: f64,
        /// At the start.
        phase_rad: f64,
    },
    /// A torque that wanders slowly and without reason.
    Wandering {
        /// Amplitude, frequency and phase of what it is made of.
        lines: Vec<[f64; 3]>,
    },
    /// Friction that grows with time since the last reversal.
    ReversalGrowth {
        /// Until two thirds of it are there.
        time_constant_s: f64,
    },
    /// A torque that comes at one instant and stays.
    Step {
        /// When.
        at_s: f64,
        /// Plus or minus one.
        sign: f64,
    },
    /// A cushion that the joint runs into at one end of its way.
    Cushion {
        /// Where it begins.
        from_rad: f64,
        /// Torque is `nm` so far in.
        depth_rad: f64,
        /// Plus for the upper end.
        sign: f64,
    },
    /// Something that catches and lets go again.
    Snags {
        /// When, how long, and with which sign.
        bursts: Vec<[f64; 3]>,
    },
}

/// How many laws there are.
pub(crate) const LAWS: usize = 9;

impl Unlisted {
    /// In a word or two.
    pub fn name(&self) -> &'static str {
        match self {
            Self::FrictionBump { .. } => "friction bump",
            Self::Coupling { .. } => "coupling",
            Self::Jerk { .. } => "jerk",
            Self::Vibration { .. } => "vibration",
            Self::Wandering { .. } => "wandering torque",
            Self::ReversalGrowth { .. } => "growth since reversal",
            Self::Step { .. } => "step",
            Self::Cushion { .. } => "cushion",
            Self::Snags { .. } => "snags",
        }
    }

    /// The law of that number, as it suits a joint.
    pub(crate) fn draw(
        law: usize,
        joint: usize,
        joints: usize,
        sizes: &Sizes,
        duration_s: f64,
        random: &mut Random,
    ) -> Self {
        let [low_rad, high_rad] = sizes.position_rad;
        let span_rad = high_rad - low_rad;
        match law {
            0 => Self::FrictionBump {
                at_rad: low_rad + span_rad * random.between(0.25, 0.75),
                width_rad: span_rad * random.between(0.04, 0.12),
            },
            1 if joints > 1 => Self::Coupling {
                joint: (joint + 1 + random.index(joints - 1)) % joints,
                speed_rad_s: 0.5,
            },
            1 | 2 => Self::Jerk {
                jerk_rad_s3: 20.0,
                smoothing_s: random.between(0.01, 0.03),
            },
            3 => Self::Vibration {
                frequency_hz: random.between(1.5, 10.0),
                phase_rad: random.between(0.0, TAU),
            },
            4 => Self::Wandering {
                lines: (0..8)
                    .map(|_| {
                        [
                            random.between(0.2, 0.6),
                            random.magnitude(0.02, 0.4),
                            random.between(0.0, TAU),
                        ]
                    })
                    .collect(),
            },
            5 => Self::ReversalGrowth {
                time_constant_s: random.between(0.3, 1.5),
            },
            6 => Self::Step {
                at_s: duration_s * random.between(0.3, 0.7),
                sign: random.sign(),
            },
            7 => {
                let sign = random.sign();
                let depth_rad = span_rad * random.between(0.1, 0.25);
                Self::Cushion {
                    from_rad: if sign > 0.0 {
                        high_rad - depth_rad
                    } else {
                        low_rad + depth_rad
                    },
                    depth_rad,
                    sign,
                }
            }
            _ => Self::Snags {
                bursts: (0..6 + random.index(8))
                    .map(|_| {
                        [
                            duration_s * random.between(0.05, 0.95),
                            random.between(0.15, 0.6),
                            random.sign(),
                        ]
                    })
                    .collect(),
            },
        }
    }

    /// The law at work on a joint, as strong as this.
    pub(crate) fn at(&self, joint: usize, nm: f64) -> Box<dyn Disturbance> {
        Box::new(AtWork {
            law: self.clone(),
            joint,
            nm,
            smooth_rad_s: [0.0; 2],
            since_reversal_s: 0.0,
            direction: 0.0,
        })
    }
}

#[derive(Debug)]
struct AtWork {
    law: Unlisted,
    joint: usize,
    nm: f64,
    /// Velocity through one low-pass and through two.
    smooth_rad_s: [f64; 2],
    since_reversal_s: f64,
    direction: f64,
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
        };
        self.nm * shape
    }
}
