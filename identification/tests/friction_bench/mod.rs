//! A joint of the shipped PA-10 on a virtual test bench: recordings with known friction.
#![allow(
    dead_code,
    clippy::unwrap_used,
    reason = "every test file uses a part of it; a test may"
)]

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use joint_model::friction::{PeriodicFriction, SteadyFriction, StribeckCurve, StribeckRow};
use rand_core::{RngCore, SeedableRng};
use rand_pcg::Pcg64;
use recording::{JointColumns, Recording, Signal};
use robot::Robot;

pub const RATE_HZ: f64 = 250.0;

/// PA10-05, Table II, joint 2, the negative row as magnitudes.
pub const JOINT_2: StribeckCurve = StribeckCurve {
    positive: StribeckRow {
        f0_nm: 39.9709,
        fv_nm_s_rad: 35.3200,
        fs_nm: 6.2713,
        vc_rad_s: 0.0685,
    },
    negative: StribeckRow {
        f0_nm: 41.3113,
        fv_nm_s_rad: 35.8947,
        fs_nm: 5.9018,
        vc_rad_s: 0.0709,
    },
};

/// The speeds of PA10-05.
pub const SPEEDS_RAD_S: [f64; 8] = [0.02, 0.04, 0.06, 0.08, 0.1, 0.2, 0.3, 0.4];

/// Where the joints stand that do not move: no pose without gravity torque.
const POSE_RAD: [f64; 7] = [0.3, 0.5, -0.4, 0.9, 0.2, -0.7, 0.1];

/// Numbers of a standard normal distribution.
pub struct Noise(Pcg64);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(Pcg64::seed_from_u64(seed))
    }

    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Box and Muller's method.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }
}

/// What a joint is like, and how it is measured.
pub struct Bench {
    pub robot: Robot,
    pub joint: usize,
    pub friction: SteadyFriction,
    /// Standard deviation of the torque in each row, motor side.
    pub torque_noise_nm: f64,
    /// Standard deviation from trial to trial, joint side.
    pub trial_scatter_nm: f64,
    pub noise: Noise,
}

impl Bench {
    pub fn joint_2(seed: u64) -> Self {
        Self {
            robot: robot::load("pa10").unwrap(),
            joint: 1,
            friction: SteadyFriction {
                curve: Some(JOINT_2),
                ..SteadyFriction::default()
            },
            torque_noise_nm: 0.01,
            trial_scatter_nm: 0.1,
            noise: Noise::new(seed),
        }
    }

    pub fn add_harmonic(&mut self, amplitude_nm: f64, cycles_per_motor_rev: f64, phase_rad: f64) {
        self.friction.periodic.push(PeriodicFriction {
            amplitude_nm,
            cycles_per_motor_rev,
            phase_rad,
        });
    }

    pub fn name(&self) -> &str {
        &self.robot.joints[self.joint].name
    }

    /// Back and forth once at every speed, at rest in between; enough for a motor revolution at each.
    pub fn trial(&mut self, speeds_rad_s: &[f64]) -> Recording {
        let moves: Vec<(f64, f64)> = speeds_rad_s
            .iter()
            .flat_map(|&speed| {
                let duration_s = 0.6 + 0.15 / speed;
                [
                    (speed, duration_s),
                    (0.0, 0.2),
                    (-speed, duration_s),
                    (0.0, 0.2),
                ]
            })
            .collect();
        self.record(&moves)
    }

    /// Moves of a velocity and a duration each.
    pub fn record(&mut self, moves: &[(f64, f64)]) -> Recording {
        let mut columns = Columns::default();
        let mut position_rad = POSE_RAD[self.joint];
        for &(velocity_rad_s, duration_s) in moves {
            let offset_nm = self.trial_scatter_nm * self.noise.normal();
            for _ in 0..(duration_s * RATE_HZ) as usize {
                position_rad += velocity_rad_s / RATE_HZ;
                let torque_nm = self.motor_torque_nm(position_rad, velocity_rad_s, offset_nm);
                columns.reference_rad_s.push(velocity_rad_s);
                columns.position_rad.push(position_rad);
                columns.motor_torque_nm.push(torque_nm);
            }
        }
        self.recording(&columns)
    }

    fn motor_torque_nm(&mut self, position_rad: f64, velocity_rad_s: f64, offset_nm: f64) -> f64 {
        let gear_ratio = self.robot.joints[self.joint].gear_ratio;
        let mut pose_rad = POSE_RAD;
        pose_rad[self.joint] = position_rad;
        let mut gravity_nm = [0.0; 7];
        self.robot.chain.gravity_torque(&pose_rad, &mut gravity_nm);
        let load_nm = gravity_nm[self.joint];
        let drag_nm =
            self.friction
                .drag_nm(velocity_rad_s, load_nm, position_rad * gear_ratio, 0.0);
        (drag_nm + load_nm + offset_nm) / gear_ratio + self.torque_noise_nm * self.noise.normal()
    }

    fn recording(&self, columns: &Columns) -> Recording {
        let rows = columns.position_rad.len();
        let still = |index: usize| {
            let motor_rad = POSE_RAD[index] * self.robot.joints[index].gear_ratio;
            BTreeMap::from([(Signal::MotorPositionRad, vec![motor_rad; rows])])
        };
        let gear_ratio = self.robot.joints[self.joint].gear_ratio;
        let motor_rad = columns
            .position_rad
            .iter()
            .map(|q| q * gear_ratio)
            .collect();
        let moving = BTreeMap::from([
            (
                Signal::ReferenceVelocityRadS,
                columns.reference_rad_s.clone(),
            ),
            (Signal::MotorTorqueNm, columns.motor_torque_nm.clone()),
            (Signal::MotorPositionRad, motor_rad),
        ]);
        Recording {
            time_s: (0..rows).map(|row| row as f64 / RATE_HZ).collect(),
            segment: None,
            joints: (0..7)
                .map(|index| JointColumns {
                    name: self.robot.joints[index].name.clone(),
                    signals: if index == self.joint {
                        moving.clone()
                    } else {
                        still(index)
                    },
                })
                .collect(),
            sample_rate_hz: RATE_HZ,
            metadata: BTreeMap::new(),
            truncated: false,
        }
    }
}

#[derive(Default)]
struct Columns {
    reference_rad_s: Vec<f64>,
    position_rad: Vec<f64>,
    motor_torque_nm: Vec<f64>,
}

/// The column of a signal, to spoil it.
pub fn column(recording: &mut Recording, joint: usize, signal: Signal) -> &mut Vec<f64> {
    recording.joints[joint].signals.get_mut(&signal).unwrap()
}
