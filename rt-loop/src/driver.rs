//! The contract between the loop and the hardware.
//!
//! A [`Driver`] is what a fieldbus master, a CAN stack or an emulator looks like to the loop: one exchange a cycle,
//! command out, sample in. Nothing above this trait knows which one it is.
//!
//! # Bring your own hardware
//! Implement [`Driver`], write a [`DriverEntry`] for it and hand that to `flexspline::main_with`: the small program that
//! comes of it is `flexspline` with one more name for `--driver`. In every cycle the loop calls, always in this order from
//! one thread:
//!
//! 1. [`read`](Driver::read) at the beginning: the sample latched for this cycle;
//! 2. [`write`](Driver::write) once the command computed from that sample is known and checked;
//! 3. [`prepare`](Driver::prepare) when nothing is urgent any more.
//!
//! A bus that sends and receives in one frame (EtherCAT) keeps the command in `write` and does its frame in the next
//! `read`; a bus that talks both ways separately sends in `write`. Either way a command acts from the next latch on
//! (`delay_cycles = 1` in a robot file), or later, and then [`Capabilities::latch_to_act_cycles`] says so.
//!
//! # What an implementation has to keep
//! - **Bounded.** `read` returns by `give_up_at_ns` on the monotonic clock, with what it has or a [`DriveFault`].
//!   `write` never waits.
//! - **Quiet.** No allocation, lock, log or file in `read` and `write`; open everything before.
//! - **Honest.** The sample carries the cycle and the instant of its *latch*. An old sample is a fault, not a sample.
//!   A signal the hardware lacks is NaN.
//! - **Each joint for itself.** One drive that is silent, off or faulted does not cost the sample of the others, and does
//!   not hide in it: its readings are the last ones, [`DriveReport::age_cycles`] says how old, [`DriveReport::state`] and
//!   the codes beside it say what it does. `read` is an error only when there is nothing of any joint. A driver that can
//!   tell none of this leaves the report zero; the loop then goes by the sample's mode alone.
//! - **Emergency stop.** Where the drives have such an input, its state is a bit of every sample.
//! - **SI, joint axis.** `motor_` before the gear, `link_` and `joint_` after it, positive about the joint's axis on both
//!   sides: undo a reversing gear here.
//! - **One clock.** Drives with a clock of their own tell how far the loop is from it
//!   ([`BusReport::clock_offset_ns`](shm_types::drive::BusReport::clock_offset_ns)); the loop's instants follow, by at most a
//!   hundredth of a period in a cycle.
//! - **Safe alone.** If commands stop coming, the drives stop by themselves. Set their watchdog and read it back into
//!   [`JointCapabilities::watchdog`]; the loop cannot stop them once its process is gone.
//!
//! # Life of a drive
//! | when | what the loop does | what the driver does |
//! |---|---|---|
//! | before the first cycle | [`DriverEntry::open`], then [`Capabilities::check`] | finds the drives, configures them, reads back what they are, brings the bus to where it exchanges. May take seconds. Nothing moves, no fault is reset |
//! | `Initialising`, `Ready` | sends [`DriveMode::Braked`] | exchanges; drives still on their way are [`DriveState::NotReady`], which is no fault; then [`DriveState::SwitchedOff`] |
//! | `Enabling`, over as many cycles as it takes | sends a mode that obeys, with [`DriveRequest::Enable`] and set-points to hold the joints where they are | walks every drive to [`DriveState::Enabled`]. Until a drive obeys it gets the set-points it needs for that, such as no torque and its own position; from then on the loop's, which hold the load when the brake opens. `Enabled` is told once the brake is open |
//! | `Running`, `Holding` | sends set-points | obeys |
//! | `Damping` | sends [`DriveMode::Damping`], or a torque that damps | shorts the motors, or commands no velocity; the drive may stay enabled |
//! | `SafeStop`, `Faulted` | sends [`DriveMode::Braked`] with [`DriveRequest::QuickStop`] | stops as fast as the drives can, then brakes close: [`DriveState::SwitchedOff`] |
//! | the operator resets | sends [`DriveRequest::ResetFault`] while a drive is faulted, for a second at most | clears faults. The request is a level; the *rising edge* that bit 7 of a control word wants is made here, again and again while it lasts |
//! | at the end | [`Driver::shutdown`] | brings drives and bus down in their order |
//!
//! # What the loop makes of what is told
//! A drive with a fault of its own, and one that is no longer enabled while it should obey, are a safe stop at once, with the
//! joint and its code. A joint whose readings are older than [`AGE_MAX_CYCLES`], an exchange that failed and a command that was not
//! sent are "nothing fresh": held, then damped, then braked, and the run goes on where it comes back in time. A
//! [latched](DriveFault::is_latched) fault is a safe stop. Warnings stop nothing. A drive that is not enabled within three seconds
//! once all are ready, or within half a second after it was damped, is a safe stop. Motion begins when every drive is enabled.
//!
//! ```
//! use std::time::Duration;
//! use rt_loop::driver::{Capabilities, DriveFault, Driver, JointCapabilities};
//! use shm_types::drive::DriveState;
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
//!     state: DriveState,
//! }
//!
//! impl Driver for FreeMotor {
//!     fn capabilities(&self) -> Capabilities {
//!         Capabilities {
//!             joints: vec![JointCapabilities {
//!                 modes: vec![DriveMode::Torque],
//!                 motor_torque_max_nm: Some(1.0),
//!                 watchdog: Some(Duration::from_millis(10)),
//!                 ..JointCapabilities::default()
//!             }],
//!             ..Capabilities::default()
//!         }
//!     }
//!
//!     fn read(&mut self, cycle: u64, planned_ns: u64, _give_up_at_ns: u64) -> Result<DriveSample, DriveFault> {
//!         self.velocity_rad_s += self.torque_nm / self.inertia_kg_m2 * self.period_s;
//!         self.position_rad += self.velocity_rad_s * self.period_s;
//!         let header = Header { session: self.session, cycle, measured_at_ns: planned_ns, joint_count: 1 };
//!         let mut sample = DriveSample { header, mode: DriveMode::Torque as u32, ..DriveSample::default() };
//!         sample.readings.motor_position_rad[0] = self.position_rad;
//!         sample.readings.motor_torque_nm[0] = self.torque_nm;
//!         sample.drives.state[0] = self.state as u32;
//!         Ok(sample)
//!     }
//!
//!     fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
//!         let obeys = match command.mode_of(0) {
//!             Some(DriveMode::Torque) => true,
//!             Some(DriveMode::Braked | DriveMode::Damping) => false,
//!             _ => return Err(DriveFault::ModeRefused { mode: command.mode }),
//!         };
//!         self.state = if obeys { DriveState::Enabled } else { DriveState::SwitchedOff };
//!         self.torque_nm = if obeys { command.motor_torque_nm[0] } else { 0.0 };
//!         Ok(())
//!     }
//! }
//!
//! let mut motor = FreeMotor {
//!     session: 1, period_s: 1.0 / 1500.0, inertia_kg_m2: 1e-4, position_rad: 0.0, velocity_rad_s: 0.0, torque_nm: 0.0,
//!     state: DriveState::SwitchedOff,
//! };
//! let sample = motor.read(0, 0, 100_000).expect("a motor in memory answers");
//! assert_eq!(sample.readings.motor_position_rad[0], 0.0);
//! let mut command = DriveCommand { header: sample.header, mode: DriveMode::Torque as u32, ..Default::default() };
//! command.motor_torque_nm[0] = 0.1;
//! motor.write(&command).expect("a motor in memory obeys");
//! assert!(motor.read(1, 666_667, 800_000).expect("again").readings.motor_position_rad[0] > 0.0);
//! ```
//!
//! [`DriveMode::Braked`]: shm_types::messages::DriveMode::Braked
//! [`DriveMode::Damping`]: shm_types::messages::DriveMode::Damping
//! [`DriveRequest::Enable`]: shm_types::messages::DriveRequest::Enable
//! [`DriveRequest::QuickStop`]: shm_types::messages::DriveRequest::QuickStop
//! [`DriveRequest::ResetFault`]: shm_types::messages::DriveRequest::ResetFault
//! [`DriveState::NotReady`]: shm_types::drive::DriveState::NotReady
//! [`DriveState::SwitchedOff`]: shm_types::drive::DriveState::SwitchedOff
//! [`DriveState::Enabled`]: shm_types::drive::DriveState::Enabled
//! [`DriveReport::age_cycles`]: shm_types::drive::DriveReport::age_cycles
//! [`DriveReport::state`]: shm_types::drive::DriveReport::state

use std::time::Duration;

use robot::Robot;
use shm_types::bus::Bus;
use shm_types::drive::DriveState;
use shm_types::instance::RunConfig;
use shm_types::messages::{DriveCommand, DriveSample};

pub use crate::capabilities::{Brake, Capabilities, JointCapabilities, Mismatch, QuickStop};

/// Readings of a joint may be so old and still count: its motion is seen through as many repeated samples (`joint_motion`).
pub const AGE_MAX_CYCLES: u32 = 7;

/// What keeps a driver from exchanging, or a drive from obeying.
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
    /// An exchange came back, but not from everybody, and nothing of it can be used.
    WorkingCounter {
        /// What a whole exchange counts.
        expected: u16,
        /// What this one counted.
        received: u16,
    },
    /// A joint's device on the bus has left the state in which it exchanges.
    DeviceState {
        /// The joint.
        joint: u32,
        /// AL status (ETG.1000.6, 5.3.2): the state in its low four bits, bit 4 an error.
        al_status: u16,
        /// AL status code: why; 0 is no reason.
        al_status_code: u16,
    },
    /// Nothing has come from one joint for longer than can be seen through.
    JointSilent {
        /// The joint.
        joint: u32,
        /// Cycles since its readings were latched.
        age_cycles: u32,
    },
    /// A drive is faulted.
    DriveError {
        /// The joint.
        joint: u32,
        /// The drive's own number: CiA 402 object 0x603F, moteus register 0x00f.
        code: u32,
    },
    /// A drive that should obey is switched off, not ready or stopped by itself.
    DriveOff {
        /// The joint.
        joint: u32,
        /// What it says it is.
        state: DriveState,
    },
    /// A drive was not enabled in time.
    NotEnabled {
        /// The joint.
        joint: u32,
        /// What it said it was at the end.
        state: DriveState,
        /// The drive's own status word.
        status_word: u32,
    },
    /// The bus controller has switched itself off.
    BusOff,
    /// The cable, or the first device on it, is gone.
    LinkLost,
}

impl DriveFault {
    /// Whether it stays until somebody who has looked resets it. The others pass by themselves where their cause does.
    pub fn is_latched(self) -> bool {
        match self {
            Self::NoSample
            | Self::StaleSample { .. }
            | Self::ForeignSample
            | Self::InvalidSample { .. }
            | Self::JumpedSample { .. }
            | Self::NotSent
            | Self::WorkingCounter { .. }
            | Self::JointSilent { .. }
            | Self::LinkLost => false,
            Self::ModeRefused { .. }
            | Self::DeviceState { .. }
            | Self::DriveError { .. }
            | Self::DriveOff { .. }
            | Self::NotEnabled { .. }
            | Self::BusOff => true,
        }
    }
}

/// One exchange a cycle with the drives. The module page has the whole contract and an example.
pub trait Driver {
    /// What the drives are and can do, as read back from them when they were opened. Asked once, before the first cycle.
    fn capabilities(&self) -> Capabilities;

    /// The sample latched for `cycle`, which was planned for `planned_ns` on the monotonic clock. Returns by
    /// `give_up_at_ns`.
    ///
    /// # Errors
    /// [`DriveFault`]: the loop then has no measurement of any joint in this cycle.
    fn read(
        &mut self,
        cycle: u64,
        planned_ns: u64,
        give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault>;

    /// Hands over the checked command of this cycle.
    ///
    /// # Errors
    /// [`DriveFault::ModeRefused`], [`DriveFault::NotSent`], [`DriveFault::BusOff`], [`DriveFault::LinkLost`]: the loop
    /// takes it as a cycle in which the drives were not reached.
    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault>;

    /// Called after [`write`](Self::write), outside the time-critical part of the cycle: the place to get ready for
    /// the next one.
    fn prepare(&mut self) {}

    /// The channel beside the cycle, for whoever asks first: SDO, CAN diagnostics. `None` where there is none.
    ///
    /// It is used from another thread while the loop runs, and must never make `read` or `write` wait.
    fn acyclic(&mut self) -> Option<Box<dyn Acyclic>> {
        None
    }

    /// Brings drives and bus down. Called once, after the last cycle, with the brakes told to close; may take a second.
    fn shutdown(&mut self) {}
}

impl<D: Driver + ?Sized> Driver for Box<D> {
    fn capabilities(&self) -> Capabilities {
        (**self).capabilities()
    }

    fn read(
        &mut self,
        cycle: u64,
        planned_ns: u64,
        give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault> {
        (**self).read(cycle, planned_ns, give_up_at_ns)
    }

    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        (**self).write(command)
    }

    fn prepare(&mut self) {
        (**self).prepare();
    }

    fn acyclic(&mut self) -> Option<Box<dyn Acyclic>> {
        (**self).acyclic()
    }

    fn shutdown(&mut self) {
        (**self).shutdown();
    }
}

/// What a drive keeps under a number: a CiA 301 object, a moteus register.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Object {
    /// Index of the object, or number of the register.
    pub index: u16,
    /// Sub-index of the object; 0 where there are none.
    pub sub_index: u8,
}

/// The channel beside the cycle. Every call may take as long as the bus does, and is never made from the loop's thread.
pub trait Acyclic: Send {
    /// Reads an object of a joint's drive into `buffer`, little-endian as on the bus; how many bytes it has.
    ///
    /// # Errors
    /// [`AcyclicError`].
    fn read(
        &mut self,
        joint: usize,
        object: Object,
        buffer: &mut [u8],
    ) -> Result<usize, AcyclicError>;

    /// Writes an object of a joint's drive, little-endian as on the bus.
    ///
    /// # Errors
    /// [`AcyclicError`].
    fn write(&mut self, joint: usize, object: Object, bytes: &[u8]) -> Result<(), AcyclicError>;
}

/// Why an acyclic exchange failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AcyclicError {
    /// There is no such joint.
    #[error("there is no joint {joint}")]
    NoJoint {
        /// As asked for.
        joint: usize,
    },
    /// The drive refused, with its own number (CiA 301 abort code).
    #[error("the drive refused with code {code:#010x}")]
    Refused {
        /// The drive's number.
        code: u32,
    },
    /// The object has more bytes than the buffer.
    #[error("the object has {bytes} bytes, more than the buffer")]
    TooLong {
        /// How many it has.
        bytes: usize,
    },
    /// No answer came in time.
    #[error("the drive did not answer")]
    NoAnswer,
}

/// What stands behind a driver's drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Behind {
    /// Hardware, or whatever else the driver finds by itself.
    Hardware,
    /// The emulator, which the supervisor starts.
    Emulator,
    /// A process that somebody else starts, on the topics of the drives.
    Process,
}

/// A driver that `--driver NAME` can choose.
#[derive(Clone, Copy, Debug)]
pub struct DriverEntry {
    /// What `--driver` takes: lower case, one word.
    pub name: &'static str,
    /// One line for people: what it talks to.
    pub summary: &'static str,
    /// What stands behind it.
    pub behind: Behind,
    /// Opens it: finds the drives, configures them, reads back what they are. May wait; nothing moves.
    pub open: fn(&OpenContext<'_>) -> Result<Box<dyn Driver>, OpenError>,
}

/// What a driver is opened with.
#[derive(Clone, Copy, Debug)]
pub struct OpenContext<'a> {
    /// Session, period and mode of the run.
    pub run: &'a RunConfig,
    /// The robot. Its `drive` table and those of its joints are the driver's: it defines and checks their keys.
    pub robot: &'a Robot,
    /// The instance's shared memory; `None` where the drives are only looked at, without a run.
    pub bus: Option<&'a Bus>,
}

/// Why a driver cannot be opened. One line each: what is wrong, where, and what to change.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// A key of a `drive` table, or something else that was written.
    #[error("{0}")]
    Setting(String),
    /// The bus or a drive.
    #[error("{0}")]
    Hardware(String),
    /// A topic of the instance.
    #[error(transparent)]
    Bus(#[from] shm_types::bus::BusError),
}

/// Longest watchdog of a drive that the loop runs with: as long as it would damp the joints itself. moteus' default
/// (`servo.default_timeout_s`) is the same.
pub const WATCHDOG_MAX: Duration = Duration::from_millis(100);
