//! The master's side of the CiA 402 power state machine: what the controlword must be next. No clock, no bus.
//!
//! Source: IEC 61800-7-201 (CiA 402-2), section 6: statusword (Table 9), controlword (Table 7), transitions by number.

/// Where an axis says it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are those of the standard")]
pub enum PowerState {
    NotReady,
    SwitchOnDisabled,
    ReadyToSwitchOn,
    SwitchedOn,
    OperationEnabled,
    QuickStopActive,
    FaultReactionActive,
    Fault,
}

impl PowerState {
    /// The state of a statusword; `NotReady` for bits that are no state.
    pub fn of(statusword: u16) -> Self {
        match statusword & 0x6f {
            bits if bits & 0x4f == 0x40 => Self::SwitchOnDisabled,
            bits if bits & 0x4f == 0x0f => Self::FaultReactionActive,
            bits if bits & 0x4f == 0x08 => Self::Fault,
            0x21 => Self::ReadyToSwitchOn,
            0x23 => Self::SwitchedOn,
            0x27 => Self::OperationEnabled,
            0x07 => Self::QuickStopActive,
            _ => Self::NotReady,
        }
    }
}

/// What is wanted of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// No torque.
    Off,
    /// Operation enabled.
    On,
    /// Stopped as its quick stop option says, then without torque.
    QuickStop,
    /// Its fault reset.
    Reset,
}

/// Controlwords (Table 7).
const DISABLE_VOLTAGE: u16 = 0x00;
const QUICK_STOP: u16 = 0x02;
const SHUTDOWN: u16 = 0x06;
const SWITCH_ON: u16 = 0x07;
const ENABLE_OPERATION: u16 = 0x0f;
const FAULT_RESET: u16 = 0x80;

/// Cycles for which each level of the reset bit is held: drives look at the controlword every 4 ms and faster.
const LEVEL_CYCLES: u32 = 8;

/// One axis on its way.
#[derive(Clone, Copy, Debug, Default)]
pub struct Walk {
    resetting_cycles: u32,
}

impl Walk {
    /// The controlword that brings an axis with this statusword nearer to what is wanted. Called once a cycle.
    pub fn controlword(&mut self, statusword: u16, wish: Wish) -> u16 {
        use PowerState::*;
        let state = PowerState::of(statusword);
        if wish == Wish::Reset && state == Fault {
            // A rising edge counts, not the bit: first the low level, and again and again.
            let level = self.resetting_cycles / LEVEL_CYCLES % 2;
            self.resetting_cycles = self.resetting_cycles.wrapping_add(1);
            return if level == 0 {
                DISABLE_VOLTAGE
            } else {
                FAULT_RESET
            };
        }
        self.resetting_cycles = 0;
        match (wish, state) {
            (Wish::On, SwitchOnDisabled) => SHUTDOWN,
            (Wish::On, ReadyToSwitchOn) => SWITCH_ON,
            (Wish::On, SwitchedOn | OperationEnabled) => ENABLE_OPERATION,
            (Wish::QuickStop, OperationEnabled | QuickStopActive) => QUICK_STOP,
            // leaves a quick stop that would stay for ever
            (Wish::Off, OperationEnabled | SwitchedOn) => SHUTDOWN,
            _ => DISABLE_VOLTAGE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATUS: [(u16, PowerState); 8] = [
        (0x0200, PowerState::NotReady),
        (0x0250, PowerState::SwitchOnDisabled),
        (0x0231, PowerState::ReadyToSwitchOn),
        (0x0233, PowerState::SwitchedOn),
        (0x1237, PowerState::OperationEnabled),
        (0x0217, PowerState::QuickStopActive),
        (0x021f, PowerState::FaultReactionActive),
        (0x0218, PowerState::Fault),
    ];

    #[test]
    fn every_statusword_is_read() {
        for (word, state) in STATUS {
            assert_eq!(PowerState::of(word), state, "{word:#06x}");
        }
    }

    #[test]
    fn only_a_wish_to_be_on_switches_on() {
        for (word, _) in STATUS {
            for wish in [Wish::Off, Wish::QuickStop, Wish::Reset] {
                let mut walk = Walk::default();
                for _ in 0..100 {
                    let control = walk.controlword(word, wish);
                    assert_eq!(control & 0x09, 0, "{word:#06x} {wish:?}: {control:#06x}");
                }
            }
        }
    }

    #[test]
    fn a_reset_is_an_edge_again_and_again() {
        let mut walk = Walk::default();
        let words: Vec<u16> = (0..64)
            .map(|_| walk.controlword(0x0218, Wish::Reset))
            .collect();
        assert_eq!(words[0], 0, "the low level comes first");
        let edges = words.windows(2).filter(|two| two[0] == 0 && two[1] == 0x80);
        assert_eq!(edges.count(), 4);
        assert_eq!(walk.controlword(0x0250, Wish::Reset), 0, "done");
    }
}
