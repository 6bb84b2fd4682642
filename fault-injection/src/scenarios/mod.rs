//! The list of faults, and the state each has to end in.

mod buses;
mod drives;
mod operator;
mod services;

use robot::Robot;
use rt_loop::cycle::Orders;
use shm_types::messages::LoopState;
use virtual_drives::{BusFault, Kind};

use crate::Window;
use crate::bench::orders;
use crate::drive::DriveDisturbance;
use crate::service::ServiceDisturbance;

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
    /// Where drives of a kind have another one.
    pub end_states: Vec<(Kind, LoopState)>,
    /// How long it is run.
    pub cycles: u64,
    /// Between loop and drives.
    pub drive: Vec<(Window, DriveDisturbance)>,
    /// Between loop and controller.
    pub service: Vec<(Window, ServiceDisturbance)>,
    /// On the bus, with the cycle in which each begins.
    pub bus: Vec<(u64, BusFault)>,
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
            end_states: Vec::new(),
            cycles,
            drive: Vec::new(),
            service: Vec::new(),
            bus: Vec::new(),
            orders: Vec::new(),
            overslept: None,
        }
    }

    /// Nothing is broken.
    pub(crate) fn calm() -> Self {
        Self::new("none", LoopState::Running, SHORT_CYCLES)
    }

    /// The same with another end.
    fn ending(self, end_state: LoopState) -> Self {
        Self { end_state, ..self }
    }

    /// The same with another end on drives of a kind.
    fn ending_on(mut self, kind: Kind, end_state: LoopState) -> Self {
        self.end_states.push((kind, end_state));
        self
    }

    /// The state it has to end in on drives of a kind.
    pub fn end_state_on(&self, kind: Kind) -> LoopState {
        let of_kind = self.end_states.iter().find(|(of, _)| *of == kind);
        of_kind.map_or(self.end_state, |(_, end_state)| *end_state)
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

/// Faults of a robot's bus of drives of a kind.
pub fn of_bus(kind: Kind, robot: &Robot) -> Vec<Scenario> {
    buses::of(kind, robot)
}

/// Something that is broken when the drives are looked for, before there is a loop.
#[derive(Clone, Copy, Debug)]
pub struct AtSetUp {
    /// For people.
    pub name: &'static str,
    /// What is broken.
    pub fault: BusFault,
    /// Part of the line with which the driver has to refuse the drives; `None` where it has to open them.
    pub refused: Option<&'static str>,
}

/// What may be broken when the drives of a kind are looked for.
pub fn at_set_up(kind: Kind, robot: &Robot) -> Vec<AtSetUp> {
    buses::at_set_up(kind, robot)
}

/// Every scenario that any drives can have, in the order of the table.
pub fn all() -> Vec<Scenario> {
    let mut all = vec![Scenario::calm()];
    all.extend(drives::frames());
    all.extend(drives::readings());
    all.extend(drives::drives());
    all.extend(services::commands());
    all.extend(services::torques());
    all.extend(operator::loop_and_operator());
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::Bench;

    #[test]
    fn every_fault_ends_in_its_documented_state_within_the_torque_limit() {
        // The PA-10 has its turn in the fault suite of the command line.
        for kind in Kind::ALL {
            let bench = Bench::new("shd17", kind).expect("a shipped robot");
            for scenario in all().into_iter().chain(of_bus(kind, bench.robot())) {
                let outcome = bench.run(&scenario).expect("runs");
                assert!(
                    outcome.is_as_documented(&scenario, kind),
                    "{} on {}: {outcome:?}",
                    scenario.name,
                    kind.name()
                );
                assert!(outcome.torque_max <= 1.0, "{}: {outcome:?}", scenario.name);
            }
        }
    }
}
