//! Torques that are on no list: what a name takes of one, beyond what that name's own law has in common with it, is told wrongly.
//!
//! There are two halves. Seeds that are even draw from the first and odd ones from the second, so that laws with which a diagnosis was
//! developed are not those by which it is judged.

mod at_work;

use std::f64::consts::TAU;

use plant_emulator::Disturbance;
use serde::{Deserialize, Serialize};

use crate::random::Random;
use crate::sizes::Sizes;

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
    /// Detents: it is drawn into places along its way that are no part of a motor turn.
    Detents {
        /// From one to the next.
        spacing_rad: f64,
        /// How narrow: 0 is a sine.
        sharpness: f64,
        /// Where they begin.
        phase_rad: f64,
    },
    /// A contact that grows stronger with the time it stands and is worn off on the way.
    Ageing {
        /// Standing so long makes it `nm` times the logarithm of two.
        time_constant_s: f64,
        /// Way on which it falls to 1/e.
        memory_rad: f64,
    },
    /// A cable that drapes: it drags behind and turns round over a good part of the way.
    Drape {
        /// Way on which it comes along.
        yield_rad: f64,
    },
    /// A ripple that grows with the square of the speed.
    SpeedRipple {
        /// Waves per radian of the joint, times 2π.
        cycles: f64,
        /// Speed at which it is `nm`.
        speed_rad_s: f64,
        /// At zero.
        phase_rad: f64,
    },
    /// Friction that is run in.
    RunningIn {
        /// Way after which 1/e of it is left.
        way_rad: f64,
    },
    /// Drag in one direction, in a part of the way.
    OneWay {
        /// From here on.
        from_rad: f64,
        /// It sets in over this way.
        over_rad: f64,
        /// Direction of motion.
        sign: f64,
    },
    /// A torque by where another joint stands, or this one, as a link that the model lacks would make it.
    CrossLoad {
        /// Its index.
        joint: usize,
        /// Angle of the torque's wave per angle of that joint.
        per_rad: f64,
        /// At zero.
        phase_rad: f64,
    },
    /// Drag by the root of the speed.
    Root {
        /// Speed at which it is `nm`.
        speed_rad_s: f64,
    },
}

/// Laws of each half: even seeds, odd seeds.
const HALVES: [usize; 2] = [9, 8];

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
            Self::Detents { .. } => "detents",
            Self::Ageing { .. } => "ageing contact",
            Self::Drape { .. } => "drape",
            Self::SpeedRipple { .. } => "ripple by speed",
            Self::RunningIn { .. } => "running in",
            Self::OneWay { .. } => "one-way drag",
            Self::CrossLoad { .. } => "cross load",
            Self::Root { .. } => "root of the speed",
        }
    }

    /// The law of that number in a seed's half, as it suits a joint.
    pub(crate) fn draw(
        seed: u64,
        law: usize,
        joint: usize,
        joints: usize,
        sizes: &Sizes,
        duration_s: f64,
        random: &mut Random,
    ) -> Self {
        let [low_rad, high_rad] = sizes.position_rad;
        let span_rad = high_rad - low_rad;
        let half = usize::from(seed % 2 == 1);
        let law = law % HALVES[half] + if half == 1 { HALVES[0] } else { 0 };
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
            8 => Self::Snags {
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
            9 => Self::Detents {
                spacing_rad: span_rad * random.between(0.08, 0.3),
                sharpness: random.between(0.0, 3.0),
                phase_rad: random.between(0.0, TAU),
            },
            10 => Self::Ageing {
                time_constant_s: random.magnitude(0.02, 0.2),
                memory_rad: span_rad * random.between(0.02, 0.08),
            },
            11 => Self::Drape {
                yield_rad: span_rad * random.between(0.05, 0.3),
            },
            12 => Self::SpeedRipple {
                cycles: TAU / (span_rad * random.between(0.08, 0.4)),
                speed_rad_s: 0.5 * sizes.speed_rad_s,
                phase_rad: random.between(0.0, TAU),
            },
            13 => Self::RunningIn {
                way_rad: span_rad * random.between(1.0, 5.0),
            },
            14 => Self::OneWay {
                from_rad: low_rad + span_rad * random.between(0.3, 0.7),
                over_rad: 0.05 * span_rad,
                sign: random.sign(),
            },
            15 => Self::CrossLoad {
                joint: (joint + random.index(joints)) % joints,
                per_rad: random.between(2.0, 5.0),
                phase_rad: random.between(0.0, TAU),
            },
            _ => Self::Root {
                speed_rad_s: 0.5 * sizes.speed_rad_s,
            },
        }
    }

    /// How often it repeats in a turn of the motor, if it repeats with the joint's angle.
    pub(crate) fn waves_per_motor_rev(&self, gear_ratio: f64) -> Option<f64> {
        let per_joint_rev = match self {
            Self::Detents { spacing_rad, .. } => TAU / spacing_rad,
            Self::SpeedRipple { cycles, .. } => *cycles,
            _ => return None,
        };
        Some(per_joint_rev / gear_ratio)
    }

    /// The law at work on a joint, as strong as this.
    pub(crate) fn at(&self, joint: usize, nm: f64) -> Box<dyn Disturbance> {
        Box::new(at_work::AtWork::new(self.clone(), joint, nm))
    }
}
