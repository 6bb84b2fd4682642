//! What goes into the plant and what comes out: plain data, one array element a joint.

use joint_model::JOINTS_MAX;

/// What the drives are asked to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlantMode {
    /// Motor torque, in digits of the drive.
    Torque,
    /// Joint velocity, by the drive's own loop.
    Velocity,
    /// Windings short-circuited: no torque but a brake in proportion to velocity.
    Damping,
    /// No torque; the brake holds the shaft.
    #[default]
    Braked,
}

/// One period's command to all drives.
#[derive(Clone, Copy, Debug)]
pub struct PlantCommand {
    /// Whether this command newly arrived; the drives' watchdogs count the periods in which none did.
    pub fresh: bool,
    /// What to do.
    pub mode: PlantMode,
    /// What a joint's drive does instead.
    pub joint_mode: [Option<PlantMode>; JOINTS_MAX],
    /// Used in torque mode; motor side.
    pub motor_torque_nm: [f64; JOINTS_MAX],
    /// Used in velocity mode; joint side.
    pub joint_velocity_rad_s: [f64; JOINTS_MAX],
}

impl Default for PlantCommand {
    /// A fresh command to brake.
    fn default() -> Self {
        Self {
            fresh: true,
            mode: PlantMode::Braked,
            joint_mode: [None; JOINTS_MAX],
            motor_torque_nm: [0.0; JOINTS_MAX],
            joint_velocity_rad_s: [0.0; JOINTS_MAX],
        }
    }
}

impl PlantCommand {
    /// What it asks of each joint.
    pub(crate) fn joints(&self) -> [JointCommand; JOINTS_MAX] {
        core::array::from_fn(|joint| JointCommand {
            mode: self.joint_mode[joint].unwrap_or(self.mode),
            motor_torque_nm: self.motor_torque_nm[joint],
            joint_velocity_rad_s: self.joint_velocity_rad_s[joint],
        })
    }
}

/// One period's command to one joint's drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointCommand {
    /// What to do.
    pub mode: PlantMode,
    /// Used in torque mode; motor side.
    pub motor_torque_nm: f64,
    /// Used in velocity mode; joint side.
    pub joint_velocity_rad_s: f64,
}

/// What a joint's drive does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveState {
    /// Before the first command: the drive holds the shaft where it is.
    #[default]
    Holding,
    /// Follows a torque.
    Torque,
    /// Follows a velocity.
    Velocity,
    /// Brakes in proportion to velocity, as asked.
    Damping,
    /// No torque; the brake holds the shaft, as asked.
    Braked,
    /// Commands stopped coming: brakes as in damping until a fresh `Damping` or `Braked` command acknowledges it.
    Watchdog {
        /// Periods without a command when it tripped.
        missed_cycles: u32,
    },
}

/// The sensors, latched at one instant. What a robot has no sensor for is NaN.
#[derive(Clone, Copy, Debug)]
pub struct PlantSample {
    /// Periods since the start.
    pub cycle: u64,
    /// Joints in use; the rest of each array is NaN.
    pub joint_count: usize,
    /// Before the gear.
    pub motor_position_rad: [f64; JOINTS_MAX],
    /// Before the gear, as the drive reports it.
    pub motor_velocity_rad_s: [f64; JOINTS_MAX],
    /// Motor torque as the drive reports it: current times the nominal torque constant.
    pub motor_torque_nm: [f64; JOINTS_MAX],
    /// After the gear.
    pub link_position_rad: [f64; JOINTS_MAX],
    /// Torque sensor at the gear's output.
    pub joint_torque_nm: [f64; JOINTS_MAX],
    /// False where the joint's sample was lost and the last one is repeated.
    pub fresh: [bool; JOINTS_MAX],
    /// What each drive does.
    pub drive: [DriveState; JOINTS_MAX],
    /// Whether each drive cut the torque asked of it to its limit.
    pub torque_limited: [bool; JOINTS_MAX],
}

impl PlantSample {
    pub(crate) fn empty(joint_count: usize) -> Self {
        Self {
            cycle: 0,
            joint_count,
            motor_position_rad: [f64::NAN; JOINTS_MAX],
            motor_velocity_rad_s: [f64::NAN; JOINTS_MAX],
            motor_torque_nm: [f64::NAN; JOINTS_MAX],
            link_position_rad: [f64::NAN; JOINTS_MAX],
            joint_torque_nm: [f64::NAN; JOINTS_MAX],
            fresh: [true; JOINTS_MAX],
            drive: [DriveState::Holding; JOINTS_MAX],
            torque_limited: [false; JOINTS_MAX],
        }
    }
}

/// What no sensor shows.
#[derive(Clone, Copy, Debug)]
pub struct PlantTruth {
    /// Joints in use.
    pub joint_count: usize,
    /// Before the gear.
    pub motor_position_rad: [f64; JOINTS_MAX],
    /// Before the gear.
    pub motor_velocity_rad_s: [f64; JOINTS_MAX],
    /// Motor torque that really acts, gain, ripple and offset included.
    pub motor_torque_nm: [f64; JOINTS_MAX],
    /// After the gear.
    pub link_position_rad: [f64; JOINTS_MAX],
    /// After the gear.
    pub link_velocity_rad_s: [f64; JOINTS_MAX],
    /// Torque the gear transmits to the link.
    pub joint_torque_nm: [f64; JOINTS_MAX],
    /// Torque spent against friction, joint side, positive with positive velocity.
    pub friction_torque_nm: [f64; JOINTS_MAX],
    /// Kinetic, gravitational and elastic energy of all joints together.
    pub mechanical_energy_j: f64,
}
