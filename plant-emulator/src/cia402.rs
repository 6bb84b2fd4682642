//! The state machine of an emulated drive and its brake: CiA 402 (IEC 61800-7-201, "finite state automaton").
//!
//! One transition a cycle, as a drive makes one for each control word. What a master would do, the walk up, the edge of a fault
//! reset, the acknowledgement of a watchdog, is done here too: the loop only says what it wants.

use shm_types::drive::DriveState;

/// What the loop asks of a drive in a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Asked {
    /// A mode that obeys a set-point.
    pub obeys: bool,
    /// The drive's own damping.
    pub damps: bool,
    /// Get enabled.
    pub enable: bool,
    /// Clear a fault.
    pub reset: bool,
}

/// What the drive does to its motor until the next cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    /// No torque, brake closed.
    Brake,
    /// Holds the shaft with its own loop while the brake closes.
    Hold,
    /// Damps.
    Damp,
    /// What the command says.
    Obey,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    SwitchOnDisabled,
    ReadyToSwitchOn,
    SwitchedOn,
    /// The brake is open after so many more cycles.
    OperationEnabled {
        release_cycles: u32,
    },
    /// Told to brake: the brake is closed after so many more cycles.
    Closing {
        engage_cycles: u32,
    },
    QuickStopActive,
    FaultReactionActive,
    Fault,
}

/// How long a brake takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct BrakeCycles {
    pub release: u32,
    pub engage: u32,
}

/// One drive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Machine {
    state: State,
    brake: BrakeCycles,
    error_code: u16,
    /// Cycles until the cause of the fault is gone.
    cause_cycles: u64,
}

impl Machine {
    pub fn new(brake: BrakeCycles) -> Self {
        Self {
            state: State::SwitchOnDisabled,
            brake,
            error_code: 0,
            cause_cycles: 0,
        }
    }

    /// Something fails: the drive's number for it, and cycles until its cause is gone.
    pub fn trip(&mut self, error_code: u16, cause_cycles: u64) {
        self.state = State::FaultReactionActive;
        self.error_code = error_code;
        self.cause_cycles = cause_cycles;
    }

    /// One cycle. `has_stopped`: the servo's watchdog has run out.
    pub fn advance(&mut self, asked: Asked, has_stopped: bool) -> Action {
        self.cause_cycles = self.cause_cycles.saturating_sub(1);
        self.state = self.next(asked, has_stopped);
        match self.state {
            State::OperationEnabled { release_cycles: 0 } if asked.damps => Action::Damp,
            State::OperationEnabled { release_cycles: 0 } => Action::Obey,
            State::Closing { .. } => Action::Hold,
            State::QuickStopActive | State::FaultReactionActive => Action::Damp,
            _ => Action::Brake,
        }
    }

    fn next(&mut self, asked: Asked, has_stopped: bool) -> State {
        match self.state {
            State::SwitchOnDisabled => State::ReadyToSwitchOn,
            State::ReadyToSwitchOn => State::SwitchedOn,
            State::SwitchedOn if asked.obeys && asked.enable => State::OperationEnabled {
                release_cycles: self.brake.release,
            },
            State::OperationEnabled { .. } if has_stopped => State::QuickStopActive,
            State::OperationEnabled { .. } if !asked.obeys && !asked.damps => self.closing(),
            State::OperationEnabled { release_cycles } => State::OperationEnabled {
                release_cycles: release_cycles.saturating_sub(1),
            },
            State::Closing { engage_cycles: 0 } => State::SwitchedOn,
            State::Closing { engage_cycles } => State::Closing {
                engage_cycles: engage_cycles - 1,
            },
            // The brake is open still: what damped goes on, once its watchdog has been acknowledged by damping for a cycle.
            State::QuickStopActive if asked.obeys && asked.enable && !has_stopped => {
                State::OperationEnabled { release_cycles: 0 }
            }
            State::QuickStopActive if !asked.obeys && !asked.damps => self.closing(),
            State::FaultReactionActive => State::Fault,
            State::Fault if asked.reset && self.cause_cycles == 0 => {
                self.error_code = 0;
                State::SwitchOnDisabled
            }
            state => state,
        }
    }

    fn closing(&self) -> State {
        match self.brake.engage {
            0 => State::SwitchedOn,
            engage => State::Closing {
                engage_cycles: engage,
            },
        }
    }

    /// As the loop is told it.
    pub fn state(&self) -> DriveState {
        match self.state {
            State::SwitchOnDisabled | State::ReadyToSwitchOn | State::SwitchedOn => {
                DriveState::SwitchedOff
            }
            State::OperationEnabled { release_cycles: 0 } => DriveState::Enabled,
            State::OperationEnabled { .. } => DriveState::Enabling,
            State::Closing { .. } | State::QuickStopActive => DriveState::QuickStop,
            State::FaultReactionActive => DriveState::FaultReaction,
            State::Fault => DriveState::Fault,
        }
    }

    /// Whether set-points act.
    pub fn is_obeying(&self) -> bool {
        self.state == State::OperationEnabled { release_cycles: 0 }
    }

    /// Object 0x6041: the state's bits (CiA 402-2, table of the status word), voltage enabled and remote.
    pub fn status_word(&self) -> u32 {
        const VOLTAGE_AND_REMOTE: u32 = 0x0210;
        let state = match self.state {
            State::SwitchOnDisabled => 0x0040,
            State::ReadyToSwitchOn => 0x0021,
            State::SwitchedOn => 0x0023,
            State::OperationEnabled { .. } => 0x0027,
            State::Closing { .. } | State::QuickStopActive => 0x0007,
            State::FaultReactionActive => 0x000f,
            State::Fault => 0x0008,
        };
        VOLTAGE_AND_REMOTE | state
    }

    /// Object 0x603F.
    pub fn error_code(&self) -> u32 {
        u32::from(self.error_code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENABLE: Asked = Asked {
        obeys: true,
        enable: true,
        damps: false,
        reset: false,
    };
    const OBEY: Asked = Asked {
        enable: false,
        ..ENABLE
    };
    const BRAKE: Asked = Asked {
        obeys: false,
        enable: false,
        damps: false,
        reset: false,
    };
    const RESET: Asked = Asked {
        reset: true,
        ..BRAKE
    };

    fn walk(machine: &mut Machine, asked: Asked, cycles: usize) -> Vec<(DriveState, Action)> {
        let step = |_| {
            let action = machine.advance(asked, false);
            (machine.state(), action)
        };
        (0..cycles).map(step).collect()
    }

    #[test]
    fn it_walks_up_with_its_brake_and_down_again() {
        use DriveState::{Enabled, Enabling, QuickStop, SwitchedOff};
        let mut machine = Machine::new(BrakeCycles {
            release: 2,
            engage: 1,
        });
        assert_eq!(machine.status_word() & 0x4f, 0x40);
        let up = walk(&mut machine, ENABLE, 6);
        assert_eq!(
            up,
            [
                (SwitchedOff, Action::Brake),
                (SwitchedOff, Action::Brake),
                (Enabling, Action::Brake),
                (Enabling, Action::Brake),
                (Enabled, Action::Obey),
                (Enabled, Action::Obey)
            ]
        );
        assert_eq!(machine.status_word() & 0x6f, 0x27);
        let down = walk(&mut machine, BRAKE, 4);
        assert_eq!(
            down[..3],
            [
                (QuickStop, Action::Hold),
                (QuickStop, Action::Hold),
                (SwitchedOff, Action::Brake)
            ]
        );
        // Without being asked to enable, a set-point alone does nothing.
        assert_eq!(
            walk(&mut machine, OBEY, 3).last(),
            Some(&(SwitchedOff, Action::Brake))
        );
    }

    #[test]
    fn a_fault_stays_until_it_is_reset_and_its_cause_is_gone() {
        let mut machine = Machine::new(BrakeCycles::default());
        walk(&mut machine, ENABLE, 5);
        machine.trip(0x2310, 4);
        assert_eq!(
            (machine.state(), machine.error_code()),
            (DriveState::FaultReaction, 0x2310)
        );
        let reset = walk(&mut machine, RESET, 3);
        assert_eq!(reset[2], (DriveState::Fault, Action::Brake));
        assert_eq!(
            walk(&mut machine, BRAKE, 3)[2].0,
            DriveState::Fault,
            "nobody resets"
        );
        assert_eq!(walk(&mut machine, RESET, 1)[0].0, DriveState::SwitchedOff);
        assert_eq!(machine.error_code(), 0);
    }

    #[test]
    fn a_watchdog_is_a_quick_stop_and_enabling_goes_on() {
        let mut machine = Machine::new(BrakeCycles::default());
        walk(&mut machine, ENABLE, 5);
        assert_eq!(machine.advance(OBEY, true), Action::Damp);
        assert_eq!(machine.state(), DriveState::QuickStop);
        assert_eq!(machine.advance(ENABLE, true), Action::Damp, "acknowledged");
        assert_eq!(machine.advance(ENABLE, false), Action::Obey);
        assert_eq!(machine.state(), DriveState::Enabled);
    }
}
