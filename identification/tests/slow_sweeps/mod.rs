//! Recordings of slow sweeps as an ideal velocity loop would make them, with friction and noise as the test asks.
#![allow(dead_code, reason = "each test uses a part of it")]

use std::collections::BTreeMap;

use joint_model::friction::SteadyFriction;
use joint_model::rigid_body::Chain;
use rand_core::{RngCore, SeedableRng};
use rand_pcg::Pcg64;
use recording::{JointColumns, Recording, Signal};
use robot::Robot;

pub const RATE_HZ: f64 = 50.0;

/// The arm that is recorded.
pub struct Plant {
    pub robot: Robot,
    pub chain: Chain,
    pub friction: Vec<SteadyFriction>,
    /// Standard deviation, joint side.
    pub noise_nm: f64,
}

impl Plant {
    pub fn of(robot: &Robot, noise_nm: f64) -> Self {
        let joints = robot.joints.iter();
        Self {
            robot: robot.clone(),
            chain: robot.chain.clone(),
            friction: joints.map(|joint| joint.steady_friction()).collect(),
            noise_nm,
        }
    }

    /// The arm at these angles, one row each; the velocity is that between rows.
    pub fn record(&self, path_rad: &[Vec<f64>], seed: u64) -> Recording {
        let count = self.robot.joints.len();
        let mut noise = Noise(Pcg64::seed_from_u64(seed));
        let mut motor_rad = vec![Vec::new(); count];
        let mut motor_nm = vec![Vec::new(); count];
        let mut gravity_nm = vec![0.0; count];
        for (row, pose_rad) in path_rad.iter().enumerate() {
            self.chain.gravity_torque(pose_rad, &mut gravity_nm);
            let other = &path_rad[if row == 0 { 1 } else { row - 1 }];
            let sign = if row == 0 { -1.0 } else { 1.0 };
            for joint in 0..count {
                let gear_ratio = self.robot.joints[joint].gear_ratio;
                let angle_rad = pose_rad[joint];
                let velocity_rad_s = sign * (angle_rad - other[joint]) * RATE_HZ;
                let drag_nm = self.friction[joint].drag_nm(
                    velocity_rad_s,
                    gravity_nm[joint],
                    angle_rad * gear_ratio,
                    0.0,
                );
                let torque_nm = gravity_nm[joint] + drag_nm + self.noise_nm * noise.normal();
                motor_rad[joint].push(angle_rad * gear_ratio);
                motor_nm[joint].push(torque_nm / gear_ratio);
            }
        }
        let columns = motor_rad.into_iter().zip(motor_nm);
        let joints = columns
            .zip(&self.robot.joints)
            .map(|((rad, nm), joint)| JointColumns {
                name: joint.name.clone(),
                signals: [(Signal::MotorPositionRad, rad), (Signal::MotorTorqueNm, nm)].into(),
            });
        Recording {
            time_s: (0..path_rad.len())
                .map(|row| row as f64 / RATE_HZ)
                .collect(),
            segment: None,
            joints: joints.collect(),
            sample_rate_hz: RATE_HZ,
            metadata: BTreeMap::new(),
            truncated: false,
        }
    }
}

/// Straight lines through these poses, the fastest joint at this speed.
pub fn path_rad(poses_rad: &[Vec<f64>], speed_rad_s: f64) -> Vec<Vec<f64>> {
    let mut path = Vec::new();
    for pair in poses_rad.windows(2) {
        let apart = pair[0]
            .iter()
            .zip(&pair[1])
            .map(|(from, to)| (to - from).abs());
        let rows = (apart.fold(0.0, f64::max) / speed_rad_s * RATE_HZ)
            .ceil()
            .max(1.0);
        path.extend((0..rows as usize).map(|row| {
            let share = row as f64 / rows;
            let pairs = pair[0].iter().zip(&pair[1]);
            pairs
                .map(|(from, to)| from + share * (to - from))
                .collect::<Vec<f64>>()
        }));
    }
    path.extend(poses_rad.last().cloned());
    path
}

pub struct Noise(pub Pcg64);

impl Noise {
    /// Uniform from 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        f64::from(self.0.next_u32()) / f64::from(u32::MAX)
    }

    /// Mean 0, standard deviation 1: twelve uniform numbers add up to nearly that.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}
