//! Faults between loop and controller: of commands, and of the torques in them.

use shm_types::messages::LoopState;

use super::{FOR_GOOD, LONG_CYCLES, SHORT_CYCLES, Scenario, now_and_then, window};
use crate::Window;
use crate::service::ServiceDisturbance as Service;

fn service(
    name: &'static str,
    end: LoopState,
    cycles: u64,
    window: Window,
    what: Service,
) -> Scenario {
    Scenario {
        service: vec![(window, what)],
        ..Scenario::new(name, end, cycles)
    }
}

/// Missing, late, foreign and unusable commands.
pub fn commands() -> Vec<Scenario> {
    use LoopState::{Running, SafeStop};
    use Service::*;
    let (short, long) = (SHORT_CYCLES, LONG_CYCLES);
    let torque = |torque_nm| TorqueIs { torque_nm };
    vec![
        service("service silent, once", Running, short, window(1), Silent),
        service(
            "service silent, 10 cycles",
            Running,
            short,
            window(10),
            Silent,
        ),
        service(
            "service silent, 300 cycles",
            Running,
            short,
            window(300),
            Silent,
        ),
        service(
            "service silent, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            Silent,
        ),
        service(
            "service slow by a cycle, 1 in 10",
            Running,
            short,
            now_and_then(10),
            Slow,
        ),
        service(
            "service slow by a cycle, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            Slow,
        ),
        service(
            "service sends NaN, once",
            Running,
            short,
            window(1),
            torque(f64::NAN),
        ),
        service(
            "service sends NaN, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            torque(f64::NAN),
        ),
        service(
            "service sends infinity, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            torque(f64::INFINITY),
        ),
        service(
            "service answers older samples, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            StaleCycle,
        ),
        service(
            "service answers later samples, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            FutureCycle,
        ),
        service(
            "commands of another run, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            ForeignSession,
        ),
        service(
            "commands of another robot, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            WrongJointCount,
        ),
        service(
            "commands of an unknown mode, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            UnknownMode,
        ),
    ]
}

/// Torques that nobody should ask for.
pub fn torques() -> Vec<Scenario> {
    use LoopState::{Faulted, Running};
    use Service::*;
    let (short, long) = (SHORT_CYCLES, LONG_CYCLES);
    let huge = TorqueIs { torque_nm: 1e300 };
    vec![
        service(
            "torque step beyond every limit, once",
            Running,
            short,
            window(1),
            huge,
        ),
        service(
            "torque step beyond every limit, 10 cycles",
            Running,
            short,
            window(10),
            huge,
        ),
        service(
            "torque beyond every limit, for good",
            Faulted,
            long,
            window(FOR_GOOD),
            huge,
        ),
        service(
            "torque reversed, 10 cycles",
            Running,
            short,
            window(10),
            TorqueReversed,
        ),
        service(
            "torque zero, 10 cycles",
            Running,
            short,
            window(10),
            TorqueIs { torque_nm: 0.0 },
        ),
    ]
}
