//! The contract between the loop and the hardware.
//!
//! A [`Driver`] is what a fieldbus master, a CAN stack or an emulator looks like to the loop: one exchange a cycle,
//! command out, sample in. Nothing above this trait knows which one it is.
//!
//! # Bring your own hardware
//! Implement [`Driver`], name it in [`crate::process`]'s list of drivers, start with `--driver NAME`. The loop calls,
//! in every cycle and always in this order from one thread:
//!
//! 1. [`read`](Driver::read) at the beginning: the sample latched for this cycle;
//! 2. [`write`](Driver::write) once the command computed from that sample is known and checked.
//!
//! A bus that sends and receives in one frame (EtherCAT) keeps the command in `write` and does its frame in the next
//! `read`; a bus that talks both ways separately sends in `write`. Either way a command acts from the next latch on
//! (`delay_cycles = 1` in a robot file).
//!
//! What an implementation has to keep:
//! - **Bounded.** `read` returns by `give_up_at_ns` on the monotonic clock, with what it has or a [`DriveFault`].
//!   `write` never waits.
//! - **Quiet.** No allocation, lock, log or file in `read` and `write`; open everything before.
//! - **Honest.** The sample carries the cycle and the instant of its *latch*. An old sample is a fault, not a sample.
//!   A signal the hardware lacks is NaN.
//! - **Emergency stop.** Where the drives have such an input, its state is a bit of every sample.
//! - **SI, joint axis.** `motor_` before the gear, `link_` after it, positive about the joint's axis on both sides:
//!   undo a reversing gear here.
//! - **Safe alone.** If commands stop coming, the drives stop by themselves. Set their watchdog; the loop cannot do it
//!   for them once its process is gone.
//!
//! ```
//! use rt_loop::driver::{DriveFault, Driver};
//! use shm_types::messages::{DriveCommand, DriveMode, DriveSample, Header};
//!
//! /// One motor without friction or load: the velocity follows the torque, the drive latches once a period.
//! struct FreeMotor {
//!     session: u64,
//!     period_s: f64,
//!     inertia_kg_m2: f64,
//!     position_rad: f64,
//!     velocity_rad_s: f64,
//!     torque_nm: f64,
//! }
//!
//! impl Driver for FreeMotor {
//!     fn read(&mut self, cycle: u64, planned_ns: u64, _give_up_at_ns: u64) -> Result<DriveSample, DriveFault> {
//!         self.velocity_rad_s += self.torque_nm / self.inertia_kg_m2 * self.period_s;
//!         self.position_rad += self.velocity_rad_s * self.period_s;
//!         let header = Header { session: self.session, cycle, measured_at_ns: planned_ns, joint_count: 1 };
//!         let mut sample = DriveSample { header, mode: DriveMode::Torque as u32, ..DriveSample::default() };
//!         sample.readings.motor_position_rad[0] = self.position_rad;
//!         sample.readings.motor_torque_nm[0] = self.torque_nm;
//!         Ok(sample)
//!     }
//!
//!     fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
//!         let mode = DriveMode::from_raw(command.mode).ok_or(DriveFault::ModeRefused { mode: command.mode })?;
//!         self.torque_nm = if mode == DriveMode::Torque { command.motor_torque_nm[0] } else { 0.0 };
//!         Ok(())
//!     }
//! }
//!
//! let mut motor = FreeMotor {
//!     session: 1, period_s: 1.0 / 1500.0, inertia_kg_m2: 1e-4, position_rad: 0.0, velocity_rad_s: 0.0, torque_nm: 0.0,
//! };
//! let sample = motor.read(0, 0, 100_000).expect("a motor in memory answers");
//! assert_eq!(sample.readings.motor_position_rad[0], 0.0);
//! let mut command = DriveCommand { header: sample.header, mode: DriveMode::Torque as u32, ..Default::default() };
//! command.motor_torque_nm[0] = 0.1;
//! motor.write(&command).expect("a motor in memory obeys");
//! assert!(motor.read(1, 666_667, 800_000).expect("again").readings.motor_position_rad[0] > 0.0);
//! ```

use shm_types::messages::{DriveCommand, DriveSample};

/// What keeps a driver from exchanging.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveFault {
    /// No sample came in time.
    NoSample,
    /// Only a sample of an earlier cycle is there.
    StaleSample {
        /// How many cycles ago it was latched.
        age_cycles: u64,
    },
    /// A sample came that is not of this run or robot.
    ForeignSample,
    /// A position that every robot has is missing or not finite.
    InvalidSample {
        /// The joint.
        joint: u32,
    },
    /// A position is further from the last one than the joint can have moved.
    JumpedSample {
        /// The joint.
        joint: u32,
    },
    /// The drives do not know the mode asked for.
    ModeRefused {
        /// As sent.
        mode: u32,
    },
    /// The command could not be handed over.
    NotSent,
}

/// One exchange a cycle with the drives. The module page has the whole contract and an example.
pub trait Driver {
    /// The sample latched for `cycle`, which was planned for `planned_ns` on the monotonic clock. Returns by
    /// `give_up_at_ns`.
    ///
    /// # Errors
    /// [`DriveFault`]: the loop then has no measurement in this cycle.
    fn read(
        &mut self,
        cycle: u64,
        planned_ns: u64,
        give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault>;

    /// Hands over the checked command of this cycle.
    ///
    /// # Errors
    /// [`DriveFault::ModeRefused`], [`DriveFault::NotSent`].
    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault>;

    /// Called after [`write`](Self::write), outside the time-critical part of the cycle: the place to get ready for
    /// the next one.
    fn prepare(&mut self) {}
}
