//! The messages: plain data, no pointers, one layout for every process.
//!
//! SI units. `motor_` is before the gear, `link_` and `joint_` after it; positive about the joint's axis on both
//! sides. Arrays hold [`JOINTS_MAX`] joints, of which the first `joint_count` are meant; a signal a robot does not
//! have is NaN. What arrives was written by another process and is checked before use ([`Header::check`]).

use iceoryx2::prelude::ZeroCopySend;

use crate::JOINTS_MAX;
use crate::drive::{BusReport, DriveReport, NumberPerJoint};

/// One value per joint.
pub type PerJoint = [f64; JOINTS_MAX];

/// A signal no joint has.
pub const ABSENT: PerJoint = [f64::NAN; JOINTS_MAX];

/// What every message begins with: which run and which cycle it belongs to.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("FlexsplineHeader")]
pub struct Header {
    /// The run this message belongs to; a process left over from an earlier run has another.
    pub session: u64,
    /// Control cycle of the measurement the message is based on. Counts every period since the start, skipped ones too.
    pub cycle: u64,
    /// Monotonic clock at that measurement (virtual time in lockstep).
    pub measured_at_ns: u64,
    /// How many joints the arrays hold.
    pub joint_count: u64,
}

/// Why a message cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It belongs to another run.
    Session,
    /// It carries another number of joints.
    JointCount,
    /// It answers an older measurement than the one it should answer.
    OldCycle,
    /// It answers a measurement that has not been made.
    FutureCycle,
}

impl Header {
    /// Checks that a message belongs to this run and robot.
    ///
    /// # Errors
    /// [`Refusal::Session`] or [`Refusal::JointCount`].
    pub fn check(&self, session: u64, joint_count: usize) -> Result<(), Refusal> {
        if self.session != session {
            return Err(Refusal::Session);
        }
        if self.joint_count != joint_count as u64 {
            return Err(Refusal::JointCount);
        }
        Ok(())
    }

    /// Checks that an answer belongs to the measurement of `asked` and no other.
    ///
    /// # Errors
    /// [`Refusal`], the first that applies.
    pub fn answers(&self, asked: &Header) -> Result<(), Refusal> {
        self.check(asked.session, asked.joint_count as usize)?;
        match self.cycle.cmp(&asked.cycle) {
            std::cmp::Ordering::Less => Err(Refusal::OldCycle),
            std::cmp::Ordering::Greater => Err(Refusal::FutureCycle),
            std::cmp::Ordering::Equal => Ok(()),
        }
    }
}

/// What the drives measured, latched at one instant.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineReadings")]
pub struct Readings {
    /// Before the gear.
    pub motor_position_rad: PerJoint,
    /// Before the gear, where the drive measures it itself.
    pub motor_velocity_rad_s: PerJoint,
    /// After the gear.
    pub link_position_rad: PerJoint,
    /// After the gear, where the drive measures it itself.
    pub link_velocity_rad_s: PerJoint,
    /// Torque the drive reports (current times torque constant), motor side.
    pub motor_torque_nm: PerJoint,
    /// A torque sensor at the gear's output.
    pub joint_torque_nm: PerJoint,
    /// Motor current.
    pub motor_current_a: PerJoint,
    /// Motor or gear temperature in degrees Celsius.
    pub temperature_c: PerJoint,
}

/// No sensor measures more than this, in whatever unit. A larger number is none, and no filter would forget it.
pub const READING_MAX: f64 = 1e12;

/// Whether a number can be a measurement.
pub fn is_reading(value: f64) -> bool {
    value.abs() <= READING_MAX
}

impl Readings {
    /// The same without what cannot be a measurement.
    pub fn checked(mut self) -> Self {
        for signal in [
            &mut self.motor_position_rad,
            &mut self.motor_velocity_rad_s,
            &mut self.link_position_rad,
            &mut self.link_velocity_rad_s,
            &mut self.motor_torque_nm,
            &mut self.joint_torque_nm,
            &mut self.motor_current_a,
            &mut self.temperature_c,
        ] {
            for value in signal.iter_mut().filter(|value| !is_reading(**value)) {
                *value = f64::NAN;
            }
        }
        self
    }
}

impl Default for Readings {
    /// No signal at all.
    fn default() -> Self {
        Self {
            motor_position_rad: ABSENT,
            motor_velocity_rad_s: ABSENT,
            link_position_rad: ABSENT,
            link_velocity_rad_s: ABSENT,
            motor_torque_nm: ABSENT,
            joint_torque_nm: ABSENT,
            motor_current_a: ABSENT,
            temperature_c: ABSENT,
        }
    }
}

/// What a drive shall do in the coming period.
#[repr(u32)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveMode {
    /// No torque, brakes closed.
    #[default]
    Braked = 0,
    /// The drive's own damping: motor terminals shorted or an equal law; no commanded torque.
    Damping = 1,
    /// Commanded motor torque (CiA 402 mode 10).
    Torque = 2,
    /// Commanded joint velocity, held by the drive's own loop (CiA 402 mode 9).
    Velocity = 3,
    /// Commanded joint position, held by the drive's own loop, with the commanded motor torque added (CiA 402 mode 8 with
    /// object 0x60B2).
    Position = 4,
    /// Commanded joint position and velocity, held by the drive's own gains times the commanded scales, with the commanded
    /// motor torque added (moteus position mode).
    Impedance = 5,
}

impl DriveMode {
    /// Every mode, in the order of their numbers.
    pub const ALL: [Self; 6] = [
        Self::Braked,
        Self::Damping,
        Self::Torque,
        Self::Velocity,
        Self::Position,
        Self::Impedance,
    ];

    /// The mode a number from shared memory stands for.
    pub fn from_raw(raw: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| *mode as u32 == raw)
    }

    /// Whether the drive obeys a set-point in it.
    pub fn obeys(self) -> bool {
        !matches!(self, Self::Braked | Self::Damping)
    }
}

/// What the loop asks of the drives beside the mode.
#[repr(u32)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveRequest {
    /// Nothing: the mode says it all.
    #[default]
    None = 0,
    /// Get ready to obey, over as many cycles as it takes. Until every joint is enabled the set-points are where to hold.
    Enable = 1,
    /// Stop as fast as the drives can, then close the brakes. Goes with [`DriveMode::Braked`].
    QuickStop = 2,
    /// Clear the drives' faults. Stays as long as one is there; which edge a drive needs is its driver's business.
    ResetFault = 3,
}

impl DriveRequest {
    /// The request a number from shared memory stands for.
    pub fn from_raw(raw: u32) -> Option<Self> {
        [Self::None, Self::Enable, Self::QuickStop, Self::ResetFault]
            .into_iter()
            .find(|request| *request as u32 == raw)
    }
}

/// Loop to drives: what to do from the next latch on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineDriveCommand")]
pub struct DriveCommand {
    /// Cycle of the sample the command was computed from.
    pub header: Header,
    /// A [`DriveMode`] as a number; anything else is refused by the drive.
    pub mode: u32,
    /// A [`DriveRequest`] as a number; anything else is none.
    pub request: u32,
    /// Motor side; for [`DriveMode::Torque`], and added in [`DriveMode::Position`] and [`DriveMode::Impedance`].
    pub motor_torque_nm: PerJoint,
    /// Joint side; for [`DriveMode::Velocity`] and [`DriveMode::Impedance`].
    pub joint_velocity_rad_s: PerJoint,
    /// The mode of each joint, where it differs from `mode`; see [`mode_of`](Self::mode_of).
    pub joint_mode: NumberPerJoint,
    /// Joint side; for [`DriveMode::Position`] and [`DriveMode::Impedance`].
    pub joint_position_rad: PerJoint,
    /// Part of the drive's own position gain, 0 to 1; for [`DriveMode::Impedance`].
    pub position_gain_scale: PerJoint,
    /// Part of the drive's own velocity gain, 0 to 1; for [`DriveMode::Impedance`].
    pub velocity_gain_scale: PerJoint,
}

impl DriveCommand {
    /// What a joint's drive shall do: `mode` where that is braking or damping, or where `joint_mode` is 0; otherwise the
    /// joint's own. `None` for a number that is no mode.
    pub fn mode_of(&self, joint: usize) -> Option<DriveMode> {
        let mode = DriveMode::from_raw(self.mode)?;
        match self.joint_mode.get(joint) {
            Some(&own) if mode.obeys() && own != 0 => DriveMode::from_raw(own),
            _ => Some(mode),
        }
    }
}

/// Drives to loop: what was measured, and how the drives are.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineDriveSample")]
pub struct DriveSample {
    /// Cycle and instant of the latch.
    pub header: Header,
    /// The measurement.
    pub readings: Readings,
    /// Latches in a row for which the drives had no fresh command.
    pub commands_missed: u32,
    /// A [`DriveMode`] as a number: what the drives are really doing.
    pub mode: u32,
    /// Switches wired to the drives, one bit each: [`EMERGENCY_STOP_PRESSED`].
    pub inputs: u32,
    /// Not used; zero.
    pub reserved: u32,
    /// How each drive is.
    pub drives: DriveReport,
    /// How the bus is.
    pub bus: BusReport,
}

/// Bit of [`DriveSample::inputs`]: the emergency stop is pressed.
pub const EMERGENCY_STOP_PRESSED: u32 = 1;

/// What the loop is doing.
#[repr(u32)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LoopState {
    /// Waiting for the drives' first sample; brakes closed.
    #[default]
    Initialising = 0,
    /// Samples flow; waiting for the first command; brakes closed.
    Ready = 1,
    /// A fresh command in every cycle.
    Running = 2,
    /// The command is missing; the last one is held.
    Holding = 3,
    /// The command has been missing for longer; joints are damped without a model, then the brakes close.
    Damping = 4,
    /// Stopped, brakes closed; latched until somebody who has looked resets it.
    SafeStop = 5,
    /// Something is broken; brakes closed until the next start.
    Faulted = 6,
    /// A command came, and the drives are on their way to obeying it; the trajectory has not begun or waits.
    Enabling = 7,
}

impl LoopState {
    /// Every state, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Initialising,
        Self::Ready,
        Self::Running,
        Self::Holding,
        Self::Damping,
        Self::SafeStop,
        Self::Faulted,
        Self::Enabling,
    ];

    /// Whether there has been a command: it can be missed from now on.
    pub fn has_begun(self) -> bool {
        !matches!(self, Self::Initialising | Self::Ready)
    }

    /// Whether the loop stays here by itself, whatever messages come.
    pub fn is_latched(self) -> bool {
        matches!(self, Self::SafeStop | Self::Faulted)
    }

    /// The state a number from shared memory stands for.
    pub fn from_raw(raw: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|state| *state as u32 == raw)
    }
}

/// Loop to services: the measurement of this cycle, to be answered with a [`Command`] of the same cycle.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineSensorSample")]
pub struct SensorSample {
    /// Cycle and instant of the latch.
    pub header: Header,
    /// Where the trajectory stands; it waits while the loop is not running.
    pub motion_time_ns: u64,
    /// How fast the trajectory advances, 0 to 1; reference velocities scale with it.
    pub motion_rate: f64,
    /// A [`LoopState`] as a number.
    pub state: u32,
    /// Not used; zero.
    pub reserved: u32,
    /// The measurement.
    pub readings: Readings,
}

impl SensorSample {
    /// The same without what cannot be a measurement; `None` if a service cannot work with it: it must be of this run and
    /// robot, every joint needs a position, and the trajectory goes forward and no faster than planned.
    pub fn checked(mut self, session: u64, joint_count: usize) -> Option<Self> {
        self.header.check(session, joint_count).ok()?;
        self.readings = self.readings.checked();
        let positions_rad = self.readings.motor_position_rad;
        let usable = (0.0..=1.0).contains(&self.motion_rate)
            && positions_rad
                .iter()
                .take(joint_count)
                .all(|position_rad| position_rad.is_finite());
        usable.then_some(self)
    }
}

/// Feedforward to loop: the torque or velocity for the cycle whose sample it answers, and what it was made of.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineCommand")]
pub struct Command {
    /// Cycle and instant of the sample it was computed from.
    pub header: Header,
    /// [`DriveMode::Torque`] or [`DriveMode::Velocity`] as a number; anything else is refused by the loop.
    pub mode: u32,
    /// Not used; zero.
    pub reserved: u32,
    /// The torque asked for, motor side; for [`DriveMode::Torque`].
    pub motor_torque_nm: PerJoint,
    /// The velocity asked for, joint side; for [`DriveMode::Velocity`].
    pub joint_velocity_rad_s: PerJoint,
    /// Of the torque, what the model gave, motor side.
    pub feedforward_torque_nm: PerJoint,
    /// Of the torque, what the feedback gave, motor side.
    pub feedback_torque_nm: PerJoint,
    /// Where the joint should be, joint side.
    pub reference_position_rad: PerJoint,
    /// How fast it should move, joint side.
    pub reference_velocity_rad_s: PerJoint,
    /// How it should accelerate, joint side.
    pub reference_acceleration_rad_s2: PerJoint,
}

/// Whether an estimator has a torque for a joint.
#[repr(u32)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Validity {
    /// The estimator was not asked for, or the robot file has no parameters for it at this joint.
    #[default]
    Absent = 0,
    /// A signal it needs was not measured: the torque is the last one there was.
    Held = 1,
    /// From this cycle's measurement.
    Valid = 2,
}

impl Validity {
    /// The validity a number from shared memory stands for.
    pub fn from_raw(raw: u32) -> Option<Self> {
        [Self::Absent, Self::Held, Self::Valid]
            .into_iter()
            .find(|validity| *validity as u32 == raw)
    }
}

/// What one estimator says of every joint.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineEstimates")]
pub struct Estimates {
    /// Torque transmitted to the link, joint side; NaN where there never was one.
    pub torque_nm: PerJoint,
    /// One standard deviation of it; NaN where the estimator does not know it.
    pub std_nm: PerJoint,
    /// Cycles since the measurement that the torque comes from.
    pub age_cycles: [u32; JOINTS_MAX],
    /// A [`Validity`] as a number.
    pub validity: [u32; JOINTS_MAX],
}

impl Default for Estimates {
    /// Not there.
    fn default() -> Self {
        Self {
            torque_nm: ABSENT,
            std_nm: ABSENT,
            age_cycles: [0; JOINTS_MAX],
            validity: [Validity::Absent as u32; JOINTS_MAX],
        }
    }
}

impl Estimates {
    /// Torque and its standard deviation from this very cycle's measurement, else NaN.
    pub fn valid_nm(&self, joint: usize) -> [f64; 2] {
        if self.validity[joint] == Validity::Valid as u32 {
            [self.torque_nm[joint], self.std_nm[joint]]
        } else {
            [f64::NAN; 2]
        }
    }
}

/// What pushes the links from outside, as far as torque estimates tell: what neither gear nor rigid bodies explain.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineExternalTorque")]
pub struct ExternalTorque {
    /// About the joint's axis, joint side; NaN where there is none.
    pub torque_nm: PerJoint,
    /// One standard deviation of it, the model's tolerance included.
    pub std_nm: PerJoint,
    /// From this magnitude on it is a contact.
    pub threshold_nm: PerJoint,
    /// Joints in contact, one bit each.
    pub contact_joints: u64,
}

impl Default for ExternalTorque {
    /// Not known.
    fn default() -> Self {
        Self {
            torque_nm: ABSENT,
            std_nm: ABSENT,
            threshold_nm: ABSENT,
            contact_joints: 0,
        }
    }
}

/// Estimator to whoever wants it: joint torque without a torque sensor, by every estimator that was asked for.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineTorqueEstimate")]
pub struct TorqueEstimate {
    /// Cycle and instant of the sample it was computed from.
    pub header: Header,
    /// Motor torque minus the model's friction and rotor inertia.
    pub residual: Estimates,
    /// From the rate of the gear's torsion; needs a link encoder.
    pub structural_damping: Estimates,
    /// From torsion, with the wave generator's by motor torque (Zhang).
    pub compliance: Estimates,
    /// From torsion and torsion rate (Taghirad).
    pub taghirad: Estimates,
    /// From motor torque less calibrated friction (Vassileva).
    pub disturbance_observer: Estimates,
    /// From torsion, corrected by a Gaussian process (Xia).
    pub gaussian_process: Estimates,
    /// From torsion, torsion rate and motor-side momentum together.
    pub fusion: Estimates,
    /// What the fused torque and the rigid bodies leave over.
    pub external: ExternalTorque,
}

/// Loop to observers: how the cycle went. Sent last in every cycle.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineLoopStatus")]
pub struct LoopStatus {
    /// The cycle this is about.
    pub header: Header,
    /// A [`LoopState`] as a number.
    pub state: u32,
    /// Why the loop left [`LoopState::Running`] last, as the loop's fault code; 0 if it never did.
    pub fault: u32,
    /// Joints whose command was limited in this cycle, one bit each.
    pub limited_joints: u64,
    /// Late by this much against the planned instant.
    pub wakeup_lateness_ns: u64,
    /// The loop's own work in this cycle, waiting not counted.
    pub compute_ns: u64,
    /// From publishing the sample to holding its command; 0 if none came.
    pub command_latency_ns: u64,
    /// Reading from and writing to the drives.
    pub exchange_ns: u64,
    /// Cycles so far whose command came after its deadline or whose work ended after the period.
    pub missed_deadlines: u64,
    /// Periods so far that were skipped because the loop was late.
    pub skipped_periods: u64,
    /// Cycles so far without a fresh command.
    pub stale_commands: u64,
    /// Commands so far that were refused: of another session, older, or not finite.
    pub refused_commands: u64,
    /// What was sent to the drives, motor side.
    pub motor_torque_nm: PerJoint,
    /// How each drive was, as its last sample had it.
    pub drives: DriveReport,
    /// How the bus was, as the last sample had it.
    pub bus: BusReport,
}

/// Any process to the supervisor: I am alive.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("FlexsplineHeartbeat")]
pub struct Heartbeat {
    /// The run the process belongs to.
    pub session: u64,
    /// Its process id.
    pub process_id: u64,
    /// Monotonic clock when it was sent.
    pub sent_at_ns: u64,
    /// Last cycle the process has dealt with.
    pub cycle: u64,
}

/// Supervisor to loop: I am alive, and this is what the operator wants.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("FlexsplineSupervision")]
pub struct Supervision {
    /// The run it belongs to.
    pub session: u64,
    /// Monotonic clock when it was sent.
    pub sent_at_ns: u64,
    /// Anything but 0 stops the loop.
    pub emergency_stop: u32,
    /// Counts the operator's resets; one more than before is a reset.
    pub resets: u32,
}

/// What an operator may ask of a running instance.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OperatorOrder {
    /// Close the brakes now.
    EmergencyStop = 1,
    /// Leave the safe stop.
    Reset = 2,
}

impl OperatorOrder {
    /// The order a number from shared memory stands for.
    pub fn from_raw(raw: u32) -> Option<Self> {
        [Self::EmergencyStop, Self::Reset]
            .into_iter()
            .find(|order| *order as u32 == raw)
    }
}

/// Operator to supervisor: an order to be passed on to the loop.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("FlexsplineOperatorRequest")]
pub struct OperatorRequest {
    /// The run it is meant for, as `run.json` and every message of the run have it.
    pub session: u64,
    /// An [`OperatorOrder`] as a number; anything else is ignored.
    pub order: u32,
    /// Not used; zero.
    pub reserved: u32,
}

/// Loop to supervisor after a stop: one of the last cycles before it, as the loop saw them.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineLastCycle")]
pub struct LastCycle {
    /// How the cycle went.
    pub status: LoopStatus,
    /// What was measured; meant only if `has_sample` is 1.
    pub sample: SensorSample,
    /// What was asked for; meant only if `has_command` is 1.
    pub command: Command,
    /// 1 if a usable sample came.
    pub has_sample: u32,
    /// 1 if a usable command came.
    pub has_command: u32,
    /// Which of them this is, from the oldest, 0.
    pub index: u32,
    /// How many there are.
    pub count: u32,
}

/// Emulator to relay: what the plant really does. No estimator or controller may read it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("FlexsplinePlantTruth")]
pub struct PlantTruth {
    /// Cycle and instant it is true for.
    pub header: Header,
    /// After the gear.
    pub link_position_rad: PerJoint,
    /// After the gear.
    pub link_velocity_rad_s: PerJoint,
    /// Transmitted to the link.
    pub joint_torque_nm: PerJoint,
    /// Lost in the gear, joint side, along the motion positive.
    pub friction_torque_nm: PerJoint,
}

// Other languages and stored logs depend on these layouts.
const _: () = {
    assert!(size_of::<Header>() == 32);
    assert!(size_of::<Readings>() == 8 * 128);
    assert!(size_of::<DriveCommand>() == 296 + 64 + 3 * 128);
    assert!(size_of::<DriveSample>() == 1072 + 640 + 40);
    assert!(size_of::<SensorSample>() == 1080);
    assert!(size_of::<Command>() == 936);
    assert!(size_of::<Estimates>() == 384);
    assert!(size_of::<ExternalTorque>() == 392);
    assert!(size_of::<TorqueEstimate>() == 32 + 7 * 384 + 392);
    assert!(size_of::<LoopStatus>() == 240 + 640 + 40);
    assert!(size_of::<Heartbeat>() == 32);
    assert!(size_of::<Supervision>() == 24);
    assert!(size_of::<OperatorRequest>() == 16);
    assert!(size_of::<LastCycle>() == 920 + 1080 + 936 + 16);
    assert!(size_of::<PlantTruth>() == 544);
};

#[cfg(test)]
mod tests {
    use super::*;

    const ASKED: Header = Header {
        session: 7,
        cycle: 100,
        measured_at_ns: 5,
        joint_count: 7,
    };

    #[test]
    fn only_the_answer_to_this_cycle_of_this_run_is_taken() {
        assert_eq!(ASKED.answers(&ASKED), Ok(()));
        assert_eq!(
            Header {
                session: 8,
                ..ASKED
            }
            .answers(&ASKED),
            Err(Refusal::Session)
        );
        assert_eq!(
            Header {
                joint_count: 6,
                ..ASKED
            }
            .answers(&ASKED),
            Err(Refusal::JointCount)
        );
        assert_eq!(
            Header { cycle: 99, ..ASKED }.answers(&ASKED),
            Err(Refusal::OldCycle)
        );
        assert_eq!(
            Header {
                cycle: 101,
                ..ASKED
            }
            .answers(&ASKED),
            Err(Refusal::FutureCycle)
        );
    }

    #[test]
    fn numbers_that_are_no_state_are_not_read_as_one() {
        assert_eq!(LoopState::from_raw(2), Some(LoopState::Running));
        assert_eq!(LoopState::from_raw(8), None);
        assert_eq!(DriveMode::from_raw(6), None);
        assert_eq!(DriveRequest::from_raw(4), None);
        assert_eq!(Validity::from_raw(2), Some(Validity::Valid));
        assert_eq!(Validity::from_raw(3), None);
        assert_eq!(OperatorOrder::from_raw(0), None);
    }
}
