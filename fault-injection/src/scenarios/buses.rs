//! Faults of the buses themselves: cables, frames, devices and drives. Each is put into the virtual drives, not into the driver.

use std::time::Duration;

use robot::Robot;
use shm_types::messages::LoopState;
use virtual_drives::{BusFault, EthercatFault, Kind, MoteusFault};

use super::{AtSetUp, BEGIN, LONG_CYCLES, OrderDisturbance, SHORT_CYCLES, Scenario};
use crate::Window;

const MS: u64 = 1_000_000;
/// Longer than any scenario.
const FOR_GOOD_NS: u64 = 3_600_000 * MS;

fn bus(name: &'static str, end: LoopState, cycles: u64, fault: BusFault) -> Scenario {
    Scenario {
        bus: vec![(BEGIN, fault)],
        ..Scenario::new(name, end, cycles)
    }
}

/// The same with an operator who resets half a second after the fault began.
fn then_reset(scenario: Scenario, name: &'static str) -> Scenario {
    let reset = Window {
        from: BEGIN + 750,
        cycles: 1,
        every: 1,
    };
    Scenario {
        name,
        end_state: LoopState::Running,
        orders: vec![(reset, OrderDisturbance::Reset)],
        cycles: SHORT_CYCLES + 1500,
        ..scenario
    }
}

/// Those of a robot's bus of this kind.
pub fn of(kind: Kind, robot: &Robot) -> Vec<Scenario> {
    match kind {
        Kind::Emulator => Vec::new(),
        Kind::Ethercat => ethercat(robot.joints.len() - 1),
        Kind::Moteus => moteus(robot.joints[0].link_encoder_resolution_rad.is_some()),
    }
}

/// Those that the drives may have before a run.
pub fn at_set_up(kind: Kind, robot: &Robot) -> Vec<AtSetUp> {
    let last = robot.joints.len() - 1;
    match kind {
        Kind::Emulator => Vec::new(),
        Kind::Ethercat => {
            let of = |name, fault, refused| AtSetUp {
                name,
                fault: BusFault::Ethercat(fault),
                refused,
            };
            use EthercatFault::{CableOut, MailboxSilent};
            let silent = |for_ns| MailboxSilent {
                slave: last,
                for_ns,
            };
            let cut = |after| CableOut {
                after,
                for_ns: FOR_GOOD_NS,
            };
            vec![
                of(
                    "no SDO of the last slave is answered for 0.5 s",
                    silent(500 * MS),
                    None,
                ),
                of(
                    "no SDO of the last slave is answered",
                    silent(FOR_GOOD_NS),
                    Some("has not answered an SDO"),
                ),
                of("master's cable out", cut(0), Some("no slaves answer")),
            ]
        }
        Kind::Moteus => {
            let of = |name, fault, refused| AtSetUp {
                name,
                fault: BusFault::Moteus(fault, FOR_GOOD_NS),
                refused: Some(refused),
            };
            use MoteusFault::{PtyClosed, Silent};
            vec![
                of("port gone", PtyClosed { bus: 0 }, "the port is gone"),
                of(
                    "a drive's cable out",
                    Silent { id: 1 },
                    "no drive answers to id 1",
                ),
            ]
        }
    }
}

/// `last` is the last slave and its joint.
fn ethercat(last: usize) -> Vec<Scenario> {
    use EthercatFault::*;
    use LoopState::{Running, SafeStop};
    let (short, long) = (SHORT_CYCLES, LONG_CYCLES);
    let bus = |name, end, cycles, fault| bus(name, end, cycles, BusFault::Ethercat(fault));
    let cut = |after, for_ns| CableOut { after, for_ns };
    // Overcurrent (IEC 61800-7-201, error codes).
    let tripped = |for_ns| DriveFault {
        joint: last,
        code: 0x2310,
        for_ns,
    };
    let reset = SlaveReset { slave: last };
    let brown_out = BrownOut {
        slave: last,
        for_ns: 100 * MS,
    };
    vec![
        bus("master's cable out, 5 ms", Running, short, cut(0, 5 * MS)),
        bus(
            "master's cable out, 200 ms",
            SafeStop,
            short,
            cut(0, 200 * MS),
        ),
        then_reset(
            bus("", SafeStop, short, cut(0, 200 * MS)),
            "master's cable out, 200 ms, then reset",
        ),
        bus(
            "master's cable out, for good",
            SafeStop,
            long,
            cut(0, FOR_GOOD_NS),
        ),
        bus(
            "cable before the last slave out, 5 ms",
            Running,
            short,
            cut(last, 5 * MS),
        ),
        bus(
            "cable before the last slave out, 200 ms",
            SafeStop,
            short,
            cut(last, 200 * MS),
        ),
        bus(
            "cable before the last slave out, for good",
            SafeStop,
            long,
            cut(last, FOR_GOOD_NS),
        ),
        bus(
            "bus frame lost, once",
            Running,
            short,
            FrameLost { count: 1 },
        ),
        bus(
            "bus frames lost, 10",
            Running,
            short,
            FrameLost { count: 10 },
        ),
        bus(
            "bus frames doubled, 100",
            Running,
            short,
            FrameDoubled { count: 100 },
        ),
        bus(
            "bus frames late by 1 ms, 10",
            Running,
            short,
            FrameDelayed {
                count: 10,
                by_ns: MS,
            },
        ),
        bus(
            "working counter short, 1 datagram",
            Running,
            short,
            CounterShort {
                slave: last,
                count: 1,
            },
        ),
        bus(
            "working counter short, 1000 datagrams",
            Running,
            short,
            CounterShort {
                slave: last,
                count: 1000,
            },
        ),
        bus("slave starts anew", SafeStop, long, reset),
        bus("drive fault while moving", SafeStop, short, tripped(0)),
        then_reset(
            bus("", SafeStop, short, tripped(0)),
            "drive fault while moving, then reset",
        ),
        then_reset(
            bus("", SafeStop, short, tripped(FOR_GOOD_NS)),
            "drive fault whose cause stays, then reset",
        )
        .ending(SafeStop),
        bus(
            "supply of a slave's axes lost, 100 ms",
            SafeStop,
            short,
            brown_out,
        ),
        bus(
            "SYNC0 of a slave lost, 1 s",
            Running,
            short,
            DcLost {
                slave: last,
                for_ns: 1000 * MS,
            },
        ),
    ]
}

/// With an encoder at the joint a drive knows after power-on where the joint is.
fn moteus(has_link_encoder: bool) -> Vec<Scenario> {
    use LoopState::{Running, SafeStop};
    use MoteusFault::*;
    let (short, long) = (SHORT_CYCLES, LONG_CYCLES);
    let bus =
        |name, end, cycles, kind, for_ns| bus(name, end, cycles, BusFault::Moteus(kind, for_ns));
    // The first joint of every robot is on the first bus.
    let (at, id) = (0, 1);
    // Motor driver fault (moteus, protocol/registers.md, 0x00f).
    let tripped = Drive { id, code: 33 };
    let share = 0.05;
    vec![
        bus(
            "port gone, 5 ms",
            Running,
            short,
            PtyClosed { bus: at },
            5 * MS,
        ),
        bus(
            "port gone, for good",
            SafeStop,
            long,
            PtyClosed { bus: at },
            FOR_GOOD_NS,
        ),
        bus("bus off, 5 ms", Running, short, BusOff { bus: at }, 5 * MS),
        bus(
            "bus off, for good",
            SafeStop,
            short,
            BusOff { bus: at },
            FOR_GOOD_NS,
        ),
        bus(
            "a drive's cable out, 4 ms",
            Running,
            short,
            Silent { id },
            4 * MS,
        ),
        bus(
            "a drive's cable out, 200 ms",
            Running,
            short,
            Silent { id },
            200 * MS,
        ),
        bus(
            "a drive's cable out, for good",
            SafeStop,
            long,
            Silent { id },
            FOR_GOOD_NS,
        ),
        bus(
            "bus frames lost, 5 %",
            Running,
            short,
            Lost { bus: at, share },
            500 * MS,
        ),
        bus(
            "bus frames doubled, 5 %",
            Running,
            short,
            Doubled { bus: at, share },
            500 * MS,
        ),
        bus(
            "bus frames late by 2 ms",
            Running,
            short,
            Delayed {
                bus: at,
                by: Duration::from_millis(2),
            },
            500 * MS,
        ),
        bus(
            "noise on the line, 5 %",
            Running,
            short,
            Noise { bus: at, share },
            500 * MS,
        ),
        bus("drive fault while moving", SafeStop, short, tripped, MS),
        then_reset(
            bus("", SafeStop, short, tripped, MS),
            "drive fault while moving, then reset",
        ),
        then_reset(
            bus("", SafeStop, short, tripped, FOR_GOOD_NS),
            "drive fault whose cause stays, then reset",
        )
        .ending(SafeStop),
        bus(
            "supply of a drive lost, 100 ms",
            if has_link_encoder { Running } else { SafeStop },
            long,
            BrownOut { id },
            100 * MS,
        ),
    ]
}
