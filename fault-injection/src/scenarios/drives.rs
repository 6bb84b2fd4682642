//! Faults between loop and drives: of frames, and of what is in them.

use shm_types::messages::LoopState;
use virtual_drives::Kind;

use super::{FOR_GOOD, LONG_CYCLES, SHORT_CYCLES, Scenario, now_and_then, window};
use crate::Window;
use crate::drive::DriveDisturbance as Drive;

fn drive(name: &'static str, end: LoopState, cycles: u64, window: Window, what: Drive) -> Scenario {
    Scenario {
        drive: vec![(window, what)],
        ..Scenario::new(name, end, cycles)
    }
}

/// Lost, late, doubled and foreign frames in both directions.
pub fn frames() -> Vec<Scenario> {
    use Drive::*;
    use LoopState::{Running, SafeStop};
    let (short, long) = (SHORT_CYCLES, LONG_CYCLES);
    vec![
        drive("frame lost, once", Running, short, window(1), SampleLost),
        drive(
            "frames lost, 1 in 100",
            Running,
            short,
            now_and_then(100),
            SampleLost,
        ),
        drive(
            "frames lost, 10 cycles",
            Running,
            short,
            window(10),
            SampleLost,
        ),
        drive(
            "frames lost, 100 cycles",
            Running,
            short,
            window(100),
            SampleLost,
        ),
        drive(
            "frames lost, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            SampleLost,
        ),
        drive(
            "frames late by a cycle, 10 cycles",
            Running,
            short,
            window(10),
            SampleDelayed { cycles: 1 },
        ),
        drive(
            "frames late by 3 cycles, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            SampleDelayed { cycles: 3 },
        ),
        drive(
            "frame doubled, 1 in 100",
            Running,
            short,
            now_and_then(100),
            SampleDuplicated,
        ),
        drive(
            "frames change places, 20 cycles",
            Running,
            short,
            window(20),
            SamplesReordered,
        ),
        drive(
            "frame of another run, once",
            Running,
            short,
            window(1),
            ForeignSession,
        ),
        drive(
            "frames of another run, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            ForeignSession,
        ),
        drive(
            "frame claims a later cycle, once",
            Running,
            short,
            window(1),
            FutureCycle,
        ),
        drive(
            "commands do not reach the drives, 2 cycles",
            Running,
            short,
            window(2),
            CommandLost,
        ),
        drive(
            "commands do not reach the drives, 100 cycles",
            Running,
            short,
            window(100),
            CommandLost,
        )
        // its watchdog takes a slave out of OP
        .ending_on(Kind::Ethercat, SafeStop),
        drive(
            "commands do not reach the drives, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            CommandLost,
        ),
    ]
}

/// Encoders and the switch at the drives.
pub fn readings() -> Vec<Scenario> {
    use Drive::*;
    use LoopState::{Faulted, Running, SafeStop};
    let (short, long) = (SHORT_CYCLES, LONG_CYCLES);
    let joint = 0;
    let not_a_number = PositionIs {
        joint,
        value: f64::NAN,
    };
    let infinite = PositionIs {
        joint,
        value: f64::INFINITY,
    };
    let jump = EncoderJumps {
        joint,
        jump_rad: 0.05,
    };
    let small_jump = EncoderJumps {
        joint,
        jump_rad: 0.02,
    };
    vec![
        drive(
            "readings repeated, 1 in 100",
            Running,
            short,
            now_and_then(100),
            ReadingsRepeated,
        ),
        drive(
            "readings repeated, every second",
            Running,
            short,
            now_and_then(2),
            ReadingsRepeated,
        ),
        drive(
            "position is no number, once",
            Running,
            short,
            window(1),
            not_a_number,
        ),
        drive(
            "position is no number, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            not_a_number,
        ),
        drive(
            "position is infinite, once",
            Running,
            short,
            window(1),
            infinite,
        ),
        drive(
            "encoder jumps 50 mrad, once",
            Running,
            short,
            window(1),
            jump,
        ),
        drive(
            "encoder jumps 50 mrad, for good",
            Faulted,
            long,
            window(FOR_GOOD),
            jump,
        ),
        drive(
            "encoder jumps 20 mrad, for good",
            Faulted,
            long,
            window(FOR_GOOD),
            small_jump,
        ),
        drive(
            "encoder stuck, for good",
            Faulted,
            long,
            window(FOR_GOOD),
            EncoderStuck { joint },
        ),
        drive(
            "emergency stop pressed",
            SafeStop,
            short,
            window(10),
            EmergencyStopPressed,
        ),
    ]
}

/// What drives tell of themselves: each joint for itself.
pub fn drives() -> Vec<Scenario> {
    use Drive::*;
    use LoopState::{Running, SafeStop};
    let (short, long) = (SHORT_CYCLES, LONG_CYCLES);
    // The first joint of every robot.
    let joint = 0;
    // Short circuit (CiA 402-2, error codes).
    let tripped = DriveFaulted {
        joint,
        code: 0x2320,
    };
    // Operational asked for, safe-operational with an error given, watchdog of the sync manager (ETG.1000.6).
    let left = DeviceLeft {
        joint,
        status: 0x001b_0014,
    };
    vec![
        drive(
            "command not sent, once",
            Running,
            short,
            window(1),
            CommandNotSent,
        ),
        drive(
            "commands not sent, 100 cycles",
            Running,
            short,
            window(100),
            CommandNotSent,
        )
        .ending_on(Kind::Ethercat, SafeStop),
        drive(
            "one drive silent, 7 cycles",
            Running,
            short,
            window(7),
            JointSilent { joint },
        ),
        drive(
            "one drive silent, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            JointSilent { joint },
        ),
        drive("one drive faulted", SafeStop, short, window(10), tripped),
        drive(
            "one drive switched off",
            SafeStop,
            short,
            window(10),
            DriveOff { joint },
        ),
        drive(
            "one device leaves the exchange",
            SafeStop,
            short,
            window(10),
            left,
        ),
    ]
}
