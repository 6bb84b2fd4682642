//! The list of faults, and the state each has to end in.

use rt_loop::cycle::Orders;
use shm_types::messages::LoopState;

use crate::Window;
use crate::bench::orders;
use crate::drive::DriveDisturbance as Drive;
use crate::service::ServiceDisturbance as Service;

/// What comes from operator and supervisor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrderDisturbance {
    /// The operator presses the emergency stop.
    EmergencyStop,
    /// The operator resets.
    Reset,
    /// Nothing comes from the supervisor.
    SupervisorSilent,
}

/// One fault, or several together.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// What a table calls it.
    pub name: &'static str,
    /// The state it has to end in.
    pub end_state: LoopState,
    /// How long it is run.
    pub cycles: u64,
    /// Between loop and drives.
    pub drive: Vec<(Window, Drive)>,
    /// Between loop and controller.
    pub service: Vec<(Window, Service)>,
    /// From operator and supervisor.
    pub orders: Vec<(Window, OrderDisturbance)>,
    /// A cycle after which the loop oversleeps so many periods.
    pub overslept: Option<(u64, u64)>,
}

/// The arm has been moving for a second.
const BEGIN: u64 = 1500;
/// Of a fault that stays: longer than any scenario.
const FOR_GOOD: u64 = u64::MAX;
/// A second after the fault's begin: enough to see whether the run goes on.
const SHORT_CYCLES: u64 = 3000;
/// Holding, damping and a while.
const LONG_CYCLES: u64 = BEGIN + 15 + 4500 + 500;

fn window(cycles: u64) -> Window {
    Window {
        from: BEGIN,
        cycles,
        every: 1,
    }
}

fn now_and_then(every: u64) -> Window {
    Window {
        from: BEGIN,
        cycles: FOR_GOOD,
        every,
    }
}

impl Scenario {
    fn new(name: &'static str, end_state: LoopState, cycles: u64) -> Self {
        Self {
            name,
            end_state,
            cycles,
            drive: Vec::new(),
            service: Vec::new(),
            orders: Vec::new(),
            overslept: None,
        }
    }

    /// First cycle of the fault.
    pub fn begin(&self) -> u64 {
        BEGIN
    }

    pub(crate) fn orders_in(&self, cycle: u64) -> Orders {
        let held = self.orders.iter().filter(|(window, _)| window.holds(cycle));
        orders(held.map(|(_, disturbance)| *disturbance))
    }

    pub(crate) fn skipped_after(&self, cycle: u64) -> u64 {
        match self.overslept {
            Some((after, periods)) if after == cycle => periods,
            _ => 0,
        }
    }
}

fn drive(name: &'static str, end: LoopState, cycles: u64, window: Window, what: Drive) -> Scenario {
    Scenario {
        drive: vec![(window, what)],
        ..Scenario::new(name, end, cycles)
    }
}

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

fn oversleeps(name: &'static str, periods: u64) -> Scenario {
    Scenario {
        overslept: Some((BEGIN, periods)),
        ..Scenario::new(name, LoopState::Running, SHORT_CYCLES + periods)
    }
}

/// Every scenario, in the order of the table.
pub fn all() -> Vec<Scenario> {
    let mut all = vec![Scenario::new("none", LoopState::Running, SHORT_CYCLES)];
    all.extend(frames());
    all.extend(readings());
    all.extend(commands());
    all.extend(torques());
    all.extend(loop_and_operator());
    all
}

fn frames() -> Vec<Scenario> {
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
        ),
        drive(
            "commands do not reach the drives, for good",
            SafeStop,
            long,
            window(FOR_GOOD),
            CommandLost,
        ),
    ]
}

fn readings() -> Vec<Scenario> {
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

fn commands() -> Vec<Scenario> {
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

fn torques() -> Vec<Scenario> {
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

fn loop_and_operator() -> Vec<Scenario> {
    use LoopState::{Running, SafeStop};
    let asked = |name, end_state, orders: &[(u64, u64, OrderDisturbance)]| Scenario {
        orders: orders
            .iter()
            .map(|&(from, cycles, order)| {
                (
                    Window {
                        from,
                        cycles,
                        every: 1,
                    },
                    order,
                )
            })
            .collect(),
        ..Scenario::new(name, end_state, SHORT_CYCLES + 1500)
    };
    let pressed = (BEGIN, 500, OrderDisturbance::EmergencyStop);
    let reset = |at| (at, 1, OrderDisturbance::Reset);
    let silent = (BEGIN, FOR_GOOD, OrderDisturbance::SupervisorSilent);
    vec![
        oversleeps("loop oversleeps a period", 1),
        oversleeps("loop oversleeps 10 periods", 10),
        oversleeps("loop oversleeps 300 periods", 300),
        asked("operator stops", SafeStop, &[pressed]),
        asked(
            "operator stops, resets too early",
            SafeStop,
            &[pressed, reset(BEGIN + 100)],
        ),
        asked(
            "operator stops, then resets",
            Running,
            &[pressed, reset(BEGIN + 600)],
        ),
        asked("supervisor silent, for good", SafeStop, &[silent]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::Bench;

    #[test]
    fn every_fault_ends_in_its_documented_state_within_the_torque_limit() {
        // The PA-10 has its turn in the fault suite of the command line.
        let bench = Bench::new("shd17").expect("a shipped robot");
        for scenario in all() {
            let outcome = bench.run(&scenario).expect("runs");
            let end_state = format!("{:?}", scenario.end_state);
            assert_eq!(
                outcome.end_state, end_state,
                "{}: {outcome:?}",
                scenario.name
            );
            assert!(outcome.torque_max <= 1.0, "{}: {outcome:?}", scenario.name);
        }
    }
}
