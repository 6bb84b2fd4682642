//! Faults between the loop and its drives.

use rt_loop::driver::{Capabilities, DriveFault, Driver};
use shm_types::JOINTS_MAX;
use shm_types::drive::DriveState;
use shm_types::messages::{DriveCommand, DriveSample, EMERGENCY_STOP_PRESSED};

use crate::Window;

/// What happens to a frame. Joints are all of the robot's unless one is named.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriveDisturbance {
    /// The drives' frame does not arrive.
    SampleLost,
    /// The frame arrives so many cycles late.
    SampleDelayed {
        /// 1 to 16.
        cycles: usize,
    },
    /// The frame before arrives once more instead.
    SampleDuplicated,
    /// Two frames change places.
    SamplesReordered,
    /// A new frame carries the readings of the one before.
    ReadingsRepeated,
    /// A motor position is this, which is no number.
    PositionIs {
        /// The joint.
        joint: usize,
        /// NaN or infinite.
        value: f64,
    },
    /// A motor encoder reads so much more than before, joint side.
    EncoderJumps {
        /// The joint.
        joint: usize,
        /// Joint side.
        jump_rad: f64,
    },
    /// A motor encoder reads what it read when this began.
    EncoderStuck {
        /// The joint.
        joint: usize,
    },
    /// The frame is of another run.
    ForeignSession,
    /// The frame claims a cycle that is still to come.
    FutureCycle,
    /// The emergency stop is pressed.
    EmergencyStopPressed,
    /// The loop's frame does not reach the drives.
    CommandLost,
    /// The loop's frame cannot be sent.
    CommandNotSent,
    /// Nothing comes from one joint's drive: its readings stay and grow old.
    JointSilent {
        /// The joint.
        joint: usize,
    },
    /// A drive is faulted.
    DriveFaulted {
        /// The joint.
        joint: usize,
        /// The drive's number for it.
        code: u32,
    },
    /// A drive is switched off, as after a short loss of its supply.
    DriveOff {
        /// The joint.
        joint: usize,
    },
    /// A device leaves the state in which it exchanges.
    DeviceLeft {
        /// The joint.
        joint: usize,
        /// AL status in the low half, AL status code in the high one.
        status: u32,
    },
}

/// Frames kept for those that come late.
const KEPT: usize = 16;

/// A driver with faults.
#[derive(Debug)]
pub struct FaultyDriver<D> {
    /// The driver behind it.
    pub inner: D,
    faults: Vec<(Window, DriveDisturbance)>,
    gear_ratios: Vec<f64>,
    /// What the drives sent, newest first.
    sent: [Option<DriveSample>; KEPT],
    stuck_at_rad: [Option<f64>; JOINTS_MAX],
    silent_cycles: [u32; JOINTS_MAX],
    cycle: u64,
}

impl<D: Driver> FaultyDriver<D> {
    /// Puts `faults` around `inner`.
    pub fn new(inner: D, gear_ratios: Vec<f64>, faults: Vec<(Window, DriveDisturbance)>) -> Self {
        Self {
            inner,
            faults,
            gear_ratios,
            sent: [None; KEPT],
            stuck_at_rad: [None; JOINTS_MAX],
            silent_cycles: [0; JOINTS_MAX],
            cycle: 0,
        }
    }

    fn disturb(
        &mut self,
        cycle: u64,
        sample: &mut DriveSample,
        disturbance: DriveDisturbance,
    ) -> Result<(), DriveFault> {
        let earlier = |cycles: usize| self.sent[cycles].ok_or(DriveFault::NoSample);
        let positions_rad = &mut sample.readings.motor_position_rad;
        match disturbance {
            DriveDisturbance::SampleLost => return Err(DriveFault::NoSample),
            DriveDisturbance::SampleDelayed { cycles } => *sample = earlier(cycles.min(KEPT - 1))?,
            DriveDisturbance::SampleDuplicated => *sample = earlier(1)?,
            // The later frame is not there yet when the earlier one should come.
            DriveDisturbance::SamplesReordered if cycle.is_multiple_of(2) => {
                return Err(DriveFault::NoSample);
            }
            DriveDisturbance::SamplesReordered => *sample = earlier(1)?,
            DriveDisturbance::ReadingsRepeated => sample.readings = earlier(1)?.readings,
            DriveDisturbance::PositionIs { joint, value } => positions_rad[joint] = value,
            DriveDisturbance::EncoderJumps { joint, jump_rad } => {
                positions_rad[joint] += jump_rad * self.gear_ratios[joint];
            }
            DriveDisturbance::EncoderStuck { joint } => {
                positions_rad[joint] =
                    *self.stuck_at_rad[joint].get_or_insert(positions_rad[joint]);
            }
            DriveDisturbance::ForeignSession => {
                sample.header.session = sample.header.session.wrapping_add(1);
            }
            DriveDisturbance::FutureCycle => sample.header.cycle = u64::MAX,
            DriveDisturbance::EmergencyStopPressed => sample.inputs |= EMERGENCY_STOP_PRESSED,
            DriveDisturbance::CommandLost | DriveDisturbance::CommandNotSent => (),
            DriveDisturbance::JointSilent { joint } => {
                let age = &mut self.silent_cycles[joint];
                *age += 1;
                sample.drives.age_cycles[joint] = *age;
                positions_rad[joint] =
                    *self.stuck_at_rad[joint].get_or_insert(positions_rad[joint]);
            }
            DriveDisturbance::DriveFaulted { joint, code } => {
                sample.drives.state[joint] = DriveState::Fault as u32;
                sample.drives.error_code[joint] = code;
            }
            DriveDisturbance::DriveOff { joint } => {
                sample.drives.state[joint] = DriveState::SwitchedOff as u32;
            }
            DriveDisturbance::DeviceLeft { joint, status } => {
                sample.drives.device_status[joint] = status;
            }
        }
        Ok(())
    }
}

impl<D: Driver> Driver for FaultyDriver<D> {
    fn capabilities(&self) -> Capabilities {
        self.inner.capabilities()
    }

    fn read(
        &mut self,
        cycle: u64,
        planned_ns: u64,
        give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault> {
        self.cycle = cycle;
        let mut sample = self.inner.read(cycle, planned_ns, give_up_at_ns)?;
        self.sent.rotate_right(1);
        self.sent[0] = Some(sample);
        for index in 0..self.faults.len() {
            let (window, disturbance) = self.faults[index];
            if window.holds(cycle) {
                self.disturb(cycle, &mut sample, disturbance)?;
            }
        }
        Ok(sample)
    }

    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        let happens = |wanted| {
            let mut faults = self.faults.iter();
            faults.any(|(window, disturbance)| *disturbance == wanted && window.holds(self.cycle))
        };
        if happens(DriveDisturbance::CommandNotSent) {
            return Err(DriveFault::NotSent);
        }
        if happens(DriveDisturbance::CommandLost) {
            return Ok(());
        }
        self.inner.write(command)
    }

    fn prepare(&mut self) {
        self.inner.prepare();
    }
}
