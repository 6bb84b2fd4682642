//! What the drives are sent in each state: the command, what was sent last, damping, or closed brakes.

use shm_types::JOINTS_MAX;
use shm_types::messages::{Command, DriveMode, PerJoint};

use crate::cycle::CycleConfig;
use crate::limits::{JointMotion, allowed_torques_nm, allowed_velocities_rad_s};

/// A sample shows what the drives made of a command at most this many cycles after it was sent.
const DRIVE_ANSWER_CYCLES: u64 = 3;

/// What the drives are sent while they obey `command`.
pub fn asked_mode(command: &Command) -> DriveMode {
    match DriveMode::from_raw(command.mode) {
        Some(DriveMode::Velocity) => DriveMode::Velocity,
        _ => DriveMode::Torque,
    }
}

/// What was sent last.
#[derive(Clone, Debug, PartialEq)]
pub struct Sending {
    /// What the drives were asked to do.
    pub mode: DriveMode,
    /// Motor side; zero but in torque mode.
    pub torque_nm: PerJoint,
    /// Joint side; zero but in velocity mode.
    pub velocity_rad_s: PerJoint,
    /// What a command that is held was about: torque or velocity.
    held_mode: DriveMode,
    /// Cycles in a row in which the drives were sent a torque or a velocity.
    moving_cycles: u64,
    /// Cycles in a row with this mode, since the brakes were last told to close.
    same_mode_cycles: u64,
}

impl Default for Sending {
    fn default() -> Self {
        Self {
            mode: DriveMode::Braked,
            torque_nm: [0.0; JOINTS_MAX],
            velocity_rad_s: [0.0; JOINTS_MAX],
            held_mode: DriveMode::Torque,
            moving_cycles: 0,
            same_mode_cycles: 0,
        }
    }
}

impl Sending {
    /// Whether the drives have been sent torque or velocity for so long that their samples must show it.
    pub fn must_show_motion(&self) -> bool {
        self.moving_cycles > DRIVE_ANSWER_CYCLES
    }

    /// Whether the drives have been sent `mode` for so long that their samples must show it. Until then a sample can show them
    /// as they were, and a drive that takes another mode shows the old one for a while.
    pub fn must_show(&self, mode: DriveMode) -> bool {
        self.mode == mode && self.same_mode_cycles > DRIVE_ANSWER_CYCLES
    }

    /// Cycles in a row with the same mode.
    #[cfg(test)]
    pub fn same_mode_cycles(&self) -> u64 {
        self.same_mode_cycles
    }

    /// Cycles in a row in which the drives were sent a torque or a velocity.
    #[cfg(test)]
    pub fn moving_cycles(&self) -> u64 {
        self.moving_cycles
    }

    /// Closes the brakes.
    pub fn brake(&mut self) {
        *self = Self::default();
    }

    /// Sends what the command asks for, within the limits; returns the joints that were limited, one bit each.
    pub fn obey(
        &mut self,
        config: &CycleConfig,
        motions: &[JointMotion; JOINTS_MAX],
        command: &Command,
    ) -> u64 {
        if asked_mode(command) == DriveMode::Velocity {
            self.held_mode = DriveMode::Velocity;
            self.send_velocity(config, motions, &command.joint_velocity_rad_s)
        } else {
            // Brakes open with this torque: from zero, the rate limit would let the arm sag first.
            if self.mode == DriveMode::Braked {
                self.torque_nm = command.motor_torque_nm;
            }
            self.held_mode = DriveMode::Torque;
            self.send_torque(config, motions, &command.motor_torque_nm)
        }
    }

    /// Sends what was sent last, within the limits; returns the joints that were limited, one bit each.
    pub fn hold(&mut self, config: &CycleConfig, motions: &[JointMotion; JOINTS_MAX]) -> u64 {
        if self.held_mode == DriveMode::Velocity {
            let held_rad_s = self.velocity_rad_s;
            self.send_velocity(config, motions, &held_rad_s)
        } else {
            let held_nm = self.torque_nm;
            self.send_torque(config, motions, &held_nm)
        }
    }

    /// Brakes in proportion to velocity: with the loop's own torque where the motion is known and the drives obey, otherwise
    /// by the drives themselves.
    pub fn damp(
        &mut self,
        config: &CycleConfig,
        motions: &[JointMotion; JOINTS_MAX],
        by_torque: bool,
    ) {
        self.velocity_rad_s = [0.0; JOINTS_MAX];
        self.held_mode = DriveMode::Torque;
        self.torque_nm = [0.0; JOINTS_MAX];
        if by_torque {
            for (joint, limits) in config.joints.iter().enumerate() {
                self.torque_nm[joint] = limits.damping_torque_nm(motions[joint]);
            }
        }
        self.enter(match by_torque {
            true => DriveMode::Torque,
            false => DriveMode::Damping,
        });
    }

    fn send_torque(
        &mut self,
        config: &CycleConfig,
        motions: &[JointMotion; JOINTS_MAX],
        asked_nm: &PerJoint,
    ) -> u64 {
        let (torque_nm, limited_joints) = allowed_torques_nm(
            &config.joints,
            asked_nm,
            &self.torque_nm,
            motions,
            config.period_s(),
        );
        self.torque_nm = torque_nm;
        self.velocity_rad_s = [0.0; JOINTS_MAX];
        self.enter(DriveMode::Torque);
        limited_joints
    }

    fn send_velocity(
        &mut self,
        config: &CycleConfig,
        motions: &[JointMotion; JOINTS_MAX],
        asked_rad_s: &PerJoint,
    ) -> u64 {
        let (velocity_rad_s, limited_joints) = allowed_velocities_rad_s(
            &config.joints,
            asked_rad_s,
            &self.velocity_rad_s,
            motions,
            config.period_s(),
        );
        self.velocity_rad_s = velocity_rad_s;
        self.torque_nm = [0.0; JOINTS_MAX];
        self.enter(DriveMode::Velocity);
        limited_joints
    }

    fn enter(&mut self, mode: DriveMode) {
        self.same_mode_cycles = match mode == self.mode {
            true => self.same_mode_cycles + 1,
            false => 1,
        };
        self.mode = mode;
        self.moving_cycles = match mode.obeys() {
            true => self.moving_cycles + 1,
            false => 0,
        };
    }
}
