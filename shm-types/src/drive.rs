//! How each drive is: state, codes, freshness and warnings per joint, and the bus that joins them.
//!
//! Part of every drive sample and of the loop's status, so that one drive that is off, faulted or silent neither hides in the
//! sample of the others nor costs it. All zero says nothing at all: a driver that knows no more than the readings sends that.

use iceoryx2::prelude::ZeroCopySend;

use crate::JOINTS_MAX;
use crate::messages::PerJoint;

/// A number per joint.
pub type NumberPerJoint = [u32; JOINTS_MAX];

/// Where one drive stands. The order of CiA 402 (IEC 61800-7-201, "FSA"), with its names where they say the same.
#[repr(u32)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveState {
    /// The driver does not tell; the sample's mode is all there is.
    #[default]
    Unknown = 0,
    /// Starting up, or its bus is: no fault, and nothing to be done but wait (CiA 402 "not ready to switch on").
    NotReady = 1,
    /// No torque, brake closed, ready to be enabled (CiA 402 "switch on disabled" to "switched on").
    SwitchedOff = 2,
    /// On its way: powering up, or obeying while its brake opens. Set-points may act, motion cannot be asked for.
    Enabling = 3,
    /// Obeys, its brake is open (CiA 402 "operation enabled").
    Enabled = 4,
    /// Stops or has stopped by itself, because it was told to or its watchdog ran out; enabling it again goes on.
    QuickStop = 5,
    /// Stops because of a fault (CiA 402 "fault reaction active").
    FaultReaction = 6,
    /// Faulted, no torque, brake closed, until it is reset (CiA 402 "fault").
    Fault = 7,
}

impl DriveState {
    /// Every state, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Unknown,
        Self::NotReady,
        Self::SwitchedOff,
        Self::Enabling,
        Self::Enabled,
        Self::QuickStop,
        Self::FaultReaction,
        Self::Fault,
    ];

    /// The state a number from shared memory stands for.
    pub fn from_raw(raw: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|state| *state as u32 == raw)
    }

    /// Whether the drive has a fault of its own.
    pub fn is_faulted(self) -> bool {
        matches!(self, Self::FaultReaction | Self::Fault)
    }

    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::NotReady => "not ready",
            Self::SwitchedOff => "switched off",
            Self::Enabling => "enabling",
            Self::Enabled => "enabled",
            Self::QuickStop => "quick stop",
            Self::FaultReaction => "fault reaction",
            Self::Fault => "fault",
        }
    }
}

/// Whether the drives' clock and the loop's go together.
#[repr(u32)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockState {
    /// The drives have no clock of their own: they act when a frame comes.
    #[default]
    None = 0,
    /// The drives have one, and it is not in step yet.
    Locking = 1,
    /// In step: the offset is what the loop is still away.
    Locked = 2,
    /// It was in step and is no longer.
    Lost = 3,
}

impl ClockState {
    /// The state a number from shared memory stands for.
    pub fn from_raw(raw: u32) -> Option<Self> {
        [Self::None, Self::Locking, Self::Locked, Self::Lost]
            .into_iter()
            .find(|state| *state as u32 == raw)
    }
}

/// Bits of [`DriveReport::warnings`]. Nothing stops because of one; people are told.
pub mod warning {
    /// The drive or its motor is nearly too hot.
    pub const TEMPERATURE: u32 = 1;
    /// Supply voltage near its limits.
    pub const VOLTAGE: u32 = 1 << 1;
    /// Torque or current is limited by the drive itself.
    pub const LIMITED: u32 = 1 << 2;
    /// The drive's own position limit is reached.
    pub const END_STOP: u32 = 1 << 3;
    /// The drive follows its set-point worse than it was told to.
    pub const FOLLOWING: u32 = 1 << 4;
    /// A warning that has no bit of its own.
    pub const OTHER: u32 = 1 << 31;
}

/// Bits of [`DriveReport::position_validity`]. All zero: the driver does not tell.
pub mod position {
    /// The bits below are meant.
    pub const KNOWN: u32 = 1;
    /// The position is that of the joint: homed, or absolute with its offset applied.
    pub const HOMED: u32 = 1 << 1;
    /// The encoder knows its position after power-on.
    pub const ABSOLUTE: u32 = 1 << 2;
    /// It also knows how many turns it has made.
    pub const MULTI_TURN: u32 = 1 << 3;
}

/// Bits of [`BusReport::faults`].
pub mod bus_fault {
    /// The bus controller has switched itself off.
    pub const BUS_OFF: u32 = 1;
    /// The cable, or a device on the way, is gone.
    pub const LINK_LOST: u32 = 1 << 1;
}

/// Every drive, in the robot's order of joints.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineDriveReport")]
pub struct DriveReport {
    /// A [`DriveState`] as a number.
    pub state: NumberPerJoint,
    /// A [`DriveMode`](crate::messages::DriveMode) as a number: what this drive is really doing.
    pub mode: NumberPerJoint,
    /// As the drive has it: CiA 402 object 0x6041, moteus register 0x000. For people; the loop does not read it.
    pub status_word: NumberPerJoint,
    /// The drive's own fault number: CiA 402 object 0x603F, moteus register 0x00f; 0 is none. Meant with a faulted state.
    pub error_code: NumberPerJoint,
    /// The device on the bus, where it is not as it must be: its AL status in the low half, its AL status code in the high
    /// one (ETG.1000.6, 5.3.2); 0 while it is operational, and on buses that have none.
    pub device_status: NumberPerJoint,
    /// Cycles since this joint's readings were latched; 0 is fresh.
    pub age_cycles: NumberPerJoint,
    /// Bits of [`warning`].
    pub warnings: NumberPerJoint,
    /// Bits of [`position`].
    pub position_validity: NumberPerJoint,
    /// Supply of the drive; NaN or 0 where it is not measured.
    pub supply_voltage_v: PerJoint,
}

impl DriveReport {
    /// State of a joint's drive; a number that is none reads as unknown.
    pub fn state_of(&self, joint: usize) -> DriveState {
        let raw = self.state.get(joint).copied().unwrap_or_default();
        DriveState::from_raw(raw).unwrap_or_default()
    }

    /// The first of so many joints whose drive is in a state like that.
    pub fn find(&self, joints: usize, wanted: impl Fn(DriveState) -> bool) -> Option<usize> {
        (0..joints.min(JOINTS_MAX)).find(|&joint| wanted(self.state_of(joint)))
    }
}

/// The bus behind the drives.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("FlexsplineBusReport")]
pub struct BusReport {
    /// A [`ClockState`] as a number.
    pub clock: u32,
    /// Bits of [`bus_fault`].
    pub faults: u32,
    /// What a whole exchange counts (EtherCAT's working counter; elsewhere answers expected); 0 where nothing is counted.
    pub working_counter_expected: u32,
    /// What the last one counted.
    pub working_counter: u32,
    /// By how much the loop's cycles should begin later for the drives' clock, in nanoseconds; negative is earlier. Meant
    /// while the clock is [locked](ClockState::Locked).
    pub clock_offset_ns: i64,
    /// Frames so far that did not come back whole.
    pub frames_lost: u64,
    /// Largest deviation of an exchange from its instant since the sample before.
    pub jitter_ns: u64,
}

// Other languages and stored logs depend on these layouts.
const _: () = {
    assert!(size_of::<DriveReport>() == 8 * 64 + 128);
    assert!(size_of::<BusReport>() == 40);
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_no_state_are_unknown() {
        for state in DriveState::ALL {
            assert_eq!(DriveState::from_raw(state as u32), Some(state));
        }
        let mut report = DriveReport::default();
        report.state[1] = 99;
        assert_eq!(report.state_of(1), DriveState::Unknown);
        assert_eq!(report.state_of(JOINTS_MAX), DriveState::Unknown);
        report.state[2] = DriveState::Fault as u32;
        assert_eq!(report.find(3, DriveState::is_faulted), Some(2));
        assert_eq!(report.find(2, DriveState::is_faulted), None);
        assert_eq!(ClockState::from_raw(4), None);
    }
}
