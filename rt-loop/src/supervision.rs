//! What the supervisor tells the loop, and whether it lives.

use shm_types::messages::Supervision;

use crate::cycle::Orders;

/// Hears the supervisor's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SupervisorWatch {
    session: u64,
    /// Silence longer than this is the supervisor's end; `None` where nobody has a clock.
    silence_cycles_max: Option<u64>,
    silent_cycles: u64,
    emergency_stop: bool,
    resets: Option<u32>,
}

impl SupervisorWatch {
    /// For the run `session`.
    pub fn new(session: u64, silence_cycles_max: Option<u64>) -> Self {
        Self {
            session,
            silence_cycles_max,
            silent_cycles: 0,
            emergency_stop: false,
            resets: None,
        }
    }

    /// One cycle: takes what has come and says what is asked. A message of another run is not heard.
    pub fn orders(&mut self, messages: impl Iterator<Item = Supervision>) -> Orders {
        self.silent_cycles = self.silent_cycles.saturating_add(1);
        let mut reset = false;
        for message in messages.filter(|message| message.session == self.session) {
            self.silent_cycles = 0;
            self.emergency_stop = message.emergency_stop != 0;
            // The first message tells where the supervisor's count stands.
            reset |= self
                .resets
                .replace(message.resets)
                .is_some_and(|before| before != message.resets);
        }
        Orders {
            emergency_stop: self.emergency_stop,
            reset,
            supervisor_silent: self
                .silence_cycles_max
                .is_some_and(|most| self.silent_cycles > most),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(emergency_stop: u32, resets: u32) -> Supervision {
        Supervision {
            session: 7,
            sent_at_ns: 0,
            emergency_stop,
            resets,
        }
    }

    #[test]
    fn orders_are_taken_once_and_silence_is_noticed() {
        let mut watch = SupervisorWatch::new(7, Some(3));
        assert_eq!(
            watch.orders([message(0, 5)].into_iter()),
            Orders::default(),
            "an old count is no reset"
        );
        let stopped = watch.orders([message(1, 5)].into_iter());
        assert!(stopped.emergency_stop);
        assert!(watch.orders(std::iter::empty()).emergency_stop, "held");
        let reset = watch.orders([message(0, 6)].into_iter());
        assert!(reset.reset && !reset.emergency_stop);
        assert_eq!(watch.orders(std::iter::empty()), Orders::default());
        let foreign = Supervision {
            session: 8,
            ..message(1, 9)
        };
        for _ in 0..2 {
            assert!(!watch.orders([foreign].into_iter()).supervisor_silent);
        }
        let silent = watch.orders([foreign].into_iter());
        assert!(silent.supervisor_silent && !silent.emergency_stop && !silent.reset);
    }
}
