//! Which state follows which: a table, and how what happened in a cycle is sorted into its columns.
//!
//! ```text
//! Initialising ──sample──► Ready ──command──► Enabling ──drives enabled──► Running ◄──command── Holding ◄─┐
//!                            ▲                   ▲                           │ ▲                  │       │
//!                            │                   └─── drives are off ─────── │ └────command── Damping     │
//!                          reset                     and a command comes     └── nothing fresh ──────────►┘ → Damping ─┐
//!                            └──────────────────────────────────────────────────────────────────────────── SafeStop ◄─┘
//! any state ── emergency stop, silent supervisor, drive fault ──► SafeStop (latched until reset)
//! any state ── a joint ran away or does not follow ──► Faulted (latched until the next start)
//! ```

use shm_types::messages::LoopState;

/// What a cycle brought, the gravest first. Exactly one applies to a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Something is broken: a joint ran away or does not follow its reference.
    Broken,
    /// Somebody or something asks for a stop.
    Stop,
    /// The operator has looked and wants to go on; nothing asks for a stop, and the drives answer.
    Reset,
    /// Sample and command came, but the drives damp although a torque should have reached them by now.
    DrivesStopped,
    /// Sample and command came, but a drive is still starting up.
    DrivesNotReady,
    /// Sample and command came, but not every drive is enabled.
    DrivesNotEnabled,
    /// Sample and command came, and the drives obey.
    Fresh,
    /// Only a sample came, for no longer than the last command may be held.
    CommandMissing,
    /// No sample came or the last command was not sent, for no longer than the last command may be held.
    SampleMissing,
    /// Either has been missing for longer than that.
    MissingForLonger,
    /// Either has been missing for longer than joints may be damped.
    MissingForTooLong,
}

impl Event {
    /// Every event.
    pub const ALL: [Self; 11] = [
        Self::Broken,
        Self::Stop,
        Self::Reset,
        Self::DrivesStopped,
        Self::DrivesNotReady,
        Self::DrivesNotEnabled,
        Self::Fresh,
        Self::CommandMissing,
        Self::SampleMissing,
        Self::MissingForLonger,
        Self::MissingForTooLong,
    ];
}

/// The state after `event` in `state`. The whole state machine; docs/reliability.md has it as a table.
pub const fn next(state: LoopState, event: Event) -> LoopState {
    use LoopState::{Damping, Enabling, Faulted, Holding, Initialising, Ready, Running, SafeStop};
    match (state, event) {
        (Faulted, _) | (_, Event::Broken) => Faulted,
        (SafeStop, Event::Reset) => Ready,
        (SafeStop, _) | (_, Event::Stop) => SafeStop,
        // Nobody waits for a reset here.
        (state, Event::Reset) => state,
        (Initialising, Event::CommandMissing | Event::DrivesNotReady) => Ready,
        (Initialising | Ready | Enabling | Damping, Event::DrivesNotEnabled) => Enabling,
        (Initialising | Ready | Enabling | Running | Holding | Damping, Event::Fresh) => Running,
        // Before the first command nothing moves, and nothing can be missed.
        (Initialising | Ready, _) => state,
        (Enabling, Event::CommandMissing | Event::SampleMissing) => Enabling,
        (Enabling, Event::DrivesStopped) => Damping,
        // Nothing moves yet: the brakes close, and the next command begins anew.
        (Enabling, Event::DrivesNotReady | Event::MissingForLonger | Event::MissingForTooLong) => {
            Ready
        }
        (Running | Holding | Damping, Event::DrivesNotReady) => Damping,
        (Running | Holding, Event::DrivesNotEnabled) => Damping,
        (Running | Holding, Event::CommandMissing | Event::SampleMissing) => Holding,
        (Damping, Event::CommandMissing | Event::SampleMissing) => Damping,
        (Running | Holding | Damping, Event::DrivesStopped | Event::MissingForLonger) => Damping,
        (Running | Holding | Damping, Event::MissingForTooLong) => SafeStop,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Event::*;

    /// The table of docs/reliability.md: a row for every state, columns as [`Event::ALL`].
    const TABLE: [(LoopState, [LoopState; 11]); 8] = {
        use LoopState::*;
        #[rustfmt::skip]
        let table = [
            (Initialising, [Faulted, SafeStop, Initialising, Initialising, Ready, Enabling, Running, Ready, Initialising, Initialising, Initialising]),
            (Ready, [Faulted, SafeStop, Ready, Ready, Ready, Enabling, Running, Ready, Ready, Ready, Ready]),
            (Running, [Faulted, SafeStop, Running, Damping, Damping, Damping, Running, Holding, Holding, Damping, SafeStop]),
            (Holding, [Faulted, SafeStop, Holding, Damping, Damping, Damping, Running, Holding, Holding, Damping, SafeStop]),
            (Damping, [Faulted, SafeStop, Damping, Damping, Damping, Enabling, Running, Damping, Damping, Damping, SafeStop]),
            (SafeStop, [Faulted, SafeStop, Ready, SafeStop, SafeStop, SafeStop, SafeStop, SafeStop, SafeStop, SafeStop, SafeStop]),
            (Faulted, [Faulted; 11]),
            (Enabling, [Faulted, SafeStop, Enabling, Damping, Ready, Enabling, Running, Enabling, Enabling, Ready, Ready]),
        ];
        table
    };

    #[test]
    fn the_state_machine_is_its_table() {
        assert_eq!(TABLE.map(|(state, _)| state), LoopState::ALL);
        for (state, row) in TABLE {
            for (event, after) in Event::ALL.into_iter().zip(row) {
                assert_eq!(next(state, event), after, "{state:?}, {event:?}");
            }
        }
    }

    #[test]
    fn the_documented_table_is_this_one() {
        let page = include_str!("../../docs/reliability.md");
        for (state, row) in TABLE {
            let cells = row.map(|after| match after == state {
                true => "–".to_owned(),
                false => format!("`{after:?}`"),
            });
            let line = format!("| `{state:?}` | {} |", cells.join(" | "));
            assert!(page.contains(&line), "docs/reliability.md lacks: {line}");
        }
    }

    #[test]
    fn only_a_fresh_command_leads_to_running_and_a_stop_is_left_by_a_reset_alone() {
        for state in LoopState::ALL {
            for event in Event::ALL {
                let after = next(state, event);
                if after == LoopState::Running && state != after {
                    assert_eq!(event, Fresh);
                }
                if state == LoopState::SafeStop && !after.is_latched() {
                    assert_eq!((event, after), (Reset, LoopState::Ready));
                }
            }
        }
    }
}
