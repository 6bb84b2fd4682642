//! The power state machine of one CiA 402 axis: controlword in, statusword out.
//!
//! Source: IEC 61800-7-201 (CiA 402-2), section 6: states, transitions by their numbers, bits of controlword (Table 7) and
//! statusword (Table 9). One transition at most is made a step, as drives do.

/// Where an axis stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PowerState {
    /// Testing itself after power-up.
    #[default]
    NotReady,
    /// Waiting; no high voltage.
    SwitchOnDisabled,
    /// High voltage may come.
    ReadyToSwitchOn,
    /// High voltage is there, no torque.
    SwitchedOn,
    /// Follows its target.
    OperationEnabled,
    /// Stops, or has stopped and holds.
    QuickStopActive,
    /// Stops because of a fault.
    FaultReactionActive,
    /// Without torque until the fault is reset.
    Fault,
}

impl PowerState {
    /// Bits 0 to 3, 5 and 6 of the statusword.
    pub fn status_bits(self) -> u16 {
        match self {
            Self::NotReady => 0x0000,
            Self::SwitchOnDisabled => 0x0040,
            Self::ReadyToSwitchOn => 0x0021,
            Self::SwitchedOn => 0x0023,
            Self::OperationEnabled => 0x0027,
            Self::QuickStopActive => 0x0007,
            Self::FaultReactionActive => 0x000f,
            Self::Fault => 0x0008,
        }
    }

    /// Whether the axis makes torque.
    pub fn has_torque(self) -> bool {
        matches!(
            self,
            Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive
        )
    }
}

/// Bits of the controlword.
const SWITCH_ON: u16 = 0x01;
const ENABLE_VOLTAGE: u16 = 0x02;
const NO_QUICK_STOP: u16 = 0x04;
const ENABLE_OPERATION: u16 = 0x08;
const FAULT_RESET: u16 = 0x80;

/// What else decides a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Conditions {
    /// High voltage is there.
    pub voltage: bool,
    /// The self-test is over.
    pub tested: bool,
    /// A fault has come up.
    pub fault: bool,
    /// What caused the fault is still there.
    pub fault_persists: bool,
    /// The axis stands after a quick stop or a fault reaction.
    pub stopped: bool,
    /// After a quick stop the axis goes on holding (quick stop option 5 to 8) instead of switching off.
    pub stays_in_quick_stop: bool,
}

/// The state machine.
#[derive(Clone, Copy, Debug, Default)]
pub struct PowerMachine {
    state: PowerState,
    controlword: u16,
}

impl PowerMachine {
    /// Where it stands.
    pub fn state(&self) -> PowerState {
        self.state
    }

    /// One step with the newest controlword; the transition's number where one was made.
    pub fn step(&mut self, controlword: u16, conditions: Conditions) -> Option<u8> {
        use PowerState::*;
        let reset = controlword & FAULT_RESET != 0 && self.controlword & FAULT_RESET == 0;
        self.controlword = controlword;
        let set = |bits: u16| controlword & bits == bits;
        let voltage_disabled = !set(ENABLE_VOLTAGE) || !conditions.voltage;
        let quick_stop = set(ENABLE_VOLTAGE) && !set(NO_QUICK_STOP);
        let shutdown = set(ENABLE_VOLTAGE | NO_QUICK_STOP) && !set(SWITCH_ON);
        let switch_on = set(SWITCH_ON | ENABLE_VOLTAGE | NO_QUICK_STOP);
        let enable = switch_on && set(ENABLE_OPERATION);
        let no_reset_held = !set(FAULT_RESET);

        let (number, next) = match self.state {
            FaultReactionActive if conditions.stopped => (14, Fault),
            Fault if reset && !conditions.fault_persists => (15, SwitchOnDisabled),
            FaultReactionActive | Fault => return None,
            state if conditions.fault => {
                let reacts = matches!(state, OperationEnabled | QuickStopActive);
                (13, if reacts { FaultReactionActive } else { Fault })
            }
            NotReady if conditions.tested => (1, SwitchOnDisabled),
            NotReady => return None,
            SwitchOnDisabled if shutdown && conditions.voltage && no_reset_held => {
                (2, ReadyToSwitchOn)
            }
            SwitchOnDisabled => return None,
            ReadyToSwitchOn if voltage_disabled || quick_stop => (7, SwitchOnDisabled),
            ReadyToSwitchOn if switch_on => (3, SwitchedOn),
            ReadyToSwitchOn => return None,
            SwitchedOn if voltage_disabled || quick_stop => (10, SwitchOnDisabled),
            SwitchedOn if shutdown => (6, ReadyToSwitchOn),
            SwitchedOn if enable => (4, OperationEnabled),
            SwitchedOn => return None,
            OperationEnabled if voltage_disabled => (9, SwitchOnDisabled),
            OperationEnabled if quick_stop => (11, QuickStopActive),
            OperationEnabled if shutdown => (8, ReadyToSwitchOn),
            OperationEnabled if !enable => (5, SwitchedOn),
            OperationEnabled => return None,
            QuickStopActive if voltage_disabled => (12, SwitchOnDisabled),
            QuickStopActive if conditions.stopped && !conditions.stays_in_quick_stop => {
                (12, SwitchOnDisabled)
            }
            QuickStopActive if enable && conditions.stays_in_quick_stop => (16, OperationEnabled),
            QuickStopActive => return None,
        };
        self.state = next;
        Some(number)
    }
}

#[cfg(test)]
mod tests {
    use super::PowerState::*;
    use super::*;

    const READY: Conditions = Conditions {
        voltage: true,
        tested: true,
        fault: false,
        fault_persists: false,
        stopped: false,
        stays_in_quick_stop: false,
    };

    fn walk(machine: &mut PowerMachine, words: &[u16]) -> Vec<PowerState> {
        words
            .iter()
            .map(|word| {
                machine.step(*word, READY);
                machine.state()
            })
            .collect()
    }

    fn enabled() -> PowerMachine {
        let mut machine = PowerMachine::default();
        walk(&mut machine, &[0, 6, 7, 15]);
        machine
    }

    #[test]
    fn the_walk_to_operation_takes_every_state() {
        let mut machine = PowerMachine::default();
        assert_eq!(
            walk(&mut machine, &[0, 6, 7, 15]),
            [
                SwitchOnDisabled,
                ReadyToSwitchOn,
                SwitchedOn,
                OperationEnabled
            ]
        );
    }

    #[test]
    fn every_way_down() {
        let cases = [
            (0x0007, SwitchedOn),
            (0x0006, ReadyToSwitchOn),
            (0x0000, SwitchOnDisabled),
            (0x0002, QuickStopActive),
        ];
        for (word, state) in cases {
            let mut machine = enabled();
            machine.step(word, READY);
            assert_eq!(machine.state(), state, "{word:#06x}");
        }
    }

    #[test]
    fn a_held_reset_bit_resets_nothing() {
        let mut machine = enabled();
        machine.step(0x8f, READY);
        assert_eq!(
            machine.state(),
            OperationEnabled,
            "the bit alone does nothing"
        );
        machine.step(
            0x8f,
            Conditions {
                fault: true,
                ..READY
            },
        );
        machine.step(
            0x8f,
            Conditions {
                stopped: true,
                ..READY
            },
        );
        assert_eq!(machine.state(), Fault);
        for _ in 0..1000 {
            machine.step(0x80, READY);
        }
        assert_eq!(machine.state(), Fault, "held since before the fault");
        machine.step(0x00, READY);
        machine.step(0x80, READY);
        assert_eq!(machine.state(), SwitchOnDisabled);
    }

    #[test]
    fn a_fault_whose_cause_stays_is_not_reset() {
        let mut machine = enabled();
        machine.step(
            15,
            Conditions {
                fault: true,
                ..READY
            },
        );
        machine.step(
            15,
            Conditions {
                stopped: true,
                ..READY
            },
        );
        let stays = Conditions {
            fault_persists: true,
            ..READY
        };
        machine.step(0, stays);
        machine.step(0x80, stays);
        assert_eq!(machine.state(), Fault);
    }

    #[test]
    fn a_quick_stop_ends_as_its_option_says() {
        let stopped = Conditions {
            stopped: true,
            ..READY
        };
        let mut machine = enabled();
        machine.step(2, READY);
        machine.step(2, stopped);
        assert_eq!(machine.state(), SwitchOnDisabled);
        let stays = Conditions {
            stays_in_quick_stop: true,
            ..stopped
        };
        let mut machine = enabled();
        machine.step(2, READY);
        machine.step(2, stays);
        assert_eq!(machine.state(), QuickStopActive);
        machine.step(15, stays);
        assert_eq!(machine.state(), OperationEnabled);
    }

    #[test]
    fn without_voltage_nothing_is_switched_on() {
        let mut machine = PowerMachine::default();
        for word in [0, 6, 7, 15] {
            machine.step(
                word,
                Conditions {
                    voltage: false,
                    ..READY
                },
            );
        }
        assert_eq!(machine.state(), SwitchOnDisabled);
    }
}
