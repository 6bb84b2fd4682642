//! What is checked before a message from shared memory or from a drive is used. Another process may write anything there.

use shm_types::messages::{Command, DriveMode, DriveSample, Header, Refusal, is_reading};

use crate::driver::DriveFault;
use crate::statistics::Counters;

/// Whether a command may be used at all: it asks for torque or velocity, and every joint's is a number.
pub fn is_usable(command: &Command, joint_count: usize) -> bool {
    let asked = match DriveMode::from_raw(command.mode) {
        Some(DriveMode::Torque) => &command.motor_torque_nm,
        Some(DriveMode::Velocity) => &command.joint_velocity_rad_s,
        _ => return false,
    };
    asked[..joint_count].iter().all(|value| value.is_finite())
}

/// Whether a command answers `asked` and may be used; one that does not is counted with its reason.
pub fn admits_command(command: &Command, asked: &Header, counters: &mut Counters) -> bool {
    match command.header.answers(asked) {
        Err(Refusal::Session | Refusal::JointCount) => counters.foreign_commands += 1,
        Err(Refusal::OldCycle) => counters.late_commands += 1,
        Err(Refusal::FutureCycle) => counters.future_commands += 1,
        Ok(()) if !is_usable(command, asked.joint_count as usize) => {
            counters.unusable_commands += 1
        }
        Ok(()) => return true,
    }
    false
}

/// Whether a drive sample may be used: it is of this run, robot and cycle, and every joint has a position.
///
/// # Errors
/// [`DriveFault::ForeignSample`], [`DriveFault::StaleSample`], [`DriveFault::InvalidSample`].
pub fn check_sample(
    sample: &DriveSample,
    session: u64,
    cycle: u64,
    joint_count: usize,
) -> Result<(), DriveFault> {
    let asked = Header {
        session,
        cycle,
        measured_at_ns: 0,
        joint_count: joint_count as u64,
    };
    match sample.header.answers(&asked) {
        Ok(()) => (),
        Err(Refusal::OldCycle) => {
            return Err(DriveFault::StaleSample {
                age_cycles: cycle - sample.header.cycle,
            });
        }
        Err(Refusal::Session | Refusal::JointCount | Refusal::FutureCycle) => {
            return Err(DriveFault::ForeignSample);
        }
    }
    let invalid = |position: &f64| !is_reading(*position);
    match sample.readings.motor_position_rad[..joint_count]
        .iter()
        .position(invalid)
    {
        Some(joint) => Err(DriveFault::InvalidSample {
            joint: joint as u32,
        }),
        None => Ok(()),
    }
}
