//! Faults of the loop's own time, of operator and supervisor.

use shm_types::messages::LoopState;
use virtual_drives::Kind;

use super::{BEGIN, FOR_GOOD, OrderDisturbance, SHORT_CYCLES, Scenario};
use crate::Window;

fn oversleeps(name: &'static str, periods: u64) -> Scenario {
    Scenario {
        overslept: Some((BEGIN, periods)),
        ..Scenario::new(name, LoopState::Running, SHORT_CYCLES + periods)
    }
}

/// A loop that oversleeps, stops and resets, a silent supervisor.
pub fn loop_and_operator() -> Vec<Scenario> {
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
        // a slave's watchdog takes it out of OP meanwhile
        oversleeps("loop oversleeps 300 periods", 300).ending_on(Kind::Ethercat, SafeStop),
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
