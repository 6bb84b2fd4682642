//! The operator's way to the supervisor, and whether what he asked for has happened.

use shm_types::bus::{Bus, Writer};
use shm_types::messages::{OperatorOrder, OperatorRequest};
use shm_types::topics;

/// An order that has not shown in the loop's state after so long has not been followed.
const PATIENCE_NS: u64 = 500_000_000;

/// Sends orders; one monitor at a time may.
pub struct Console {
    session: u64,
    /// None where another monitor has it.
    requests: Option<Writer<OperatorRequest>>,
    last: Option<Asked>,
}

/// An order and what became of it at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Asked {
    order: OperatorOrder,
    at_ns: u64,
    sent: Sent,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sent {
    Yes,
    No,
    NotOurs,
}

impl Console {
    /// Becomes the one that gives orders, if there is none.
    pub fn join(bus: &Bus, session: u64) -> Self {
        Self {
            session,
            requests: bus.writer(&topics::OPERATOR_REQUEST).ok(),
            last: None,
        }
    }

    /// Passes an order on.
    pub fn order(&mut self, order: OperatorOrder, at_ns: u64) {
        let request = OperatorRequest {
            session: self.session,
            order: order as u32,
            reserved: 0,
        };
        let sent = self
            .requests
            .as_mut()
            .map(|requests| requests.send_and_prepare(request));
        let sent = match sent {
            None => Sent::NotOurs,
            Some(true) => Sent::Yes,
            Some(false) => Sent::No,
        };
        self.last = Some(Asked { order, at_ns, sent });
    }

    /// What has become of the last order, where the loop is in `state` at `now_ns`.
    pub fn outcome(&self, state: &str, now_ns: u64) -> &'static str {
        self.last.map_or("", |asked| asked.outcome(state, now_ns))
    }
}

impl Asked {
    fn outcome(self, state: &str, now_ns: u64) -> &'static str {
        let stopped = ["SafeStop", "Faulted"].contains(&state);
        let waiting = now_ns.saturating_sub(self.at_ns) < PATIENCE_NS;
        match (self.sent, self.order) {
            (Sent::NotOurs, _) => {
                "NOT SENT: another monitor gives the orders; use that one, or the switch at the robot"
            }
            (Sent::No, _) => "NOT SENT: use the switch at the robot",
            (Sent::Yes, OperatorOrder::EmergencyStop) if stopped => "stopped",
            (Sent::Yes, OperatorOrder::EmergencyStop) if waiting => "stop asked for",
            (Sent::Yes, OperatorOrder::EmergencyStop) => "NOT STOPPED: use the switch at the robot",
            (Sent::Yes, OperatorOrder::Reset) if !stopped => "reset",
            (Sent::Yes, OperatorOrder::Reset) if waiting => "reset asked for",
            (Sent::Yes, OperatorOrder::Reset) => {
                "not reset: only a safe stop can be, and only once its cause is gone"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_counts_as_followed_only_once_the_state_shows_it() {
        let asked = |order, sent| Asked {
            order,
            at_ns: 0,
            sent,
        };
        let stop = asked(OperatorOrder::EmergencyStop, Sent::Yes);
        assert_eq!(stop.outcome("Running", 1), "stop asked for");
        assert_eq!(stop.outcome("SafeStop", 1), "stopped");
        assert!(
            stop.outcome("Running", PATIENCE_NS)
                .starts_with("NOT STOPPED")
        );
        let reset = asked(OperatorOrder::Reset, Sent::Yes);
        assert_eq!(reset.outcome("SafeStop", 1), "reset asked for");
        assert_eq!(reset.outcome("Ready", 1), "reset");
        assert!(
            reset
                .outcome("Faulted", PATIENCE_NS)
                .starts_with("not reset")
        );
        for sent in [Sent::No, Sent::NotOurs] {
            let lost = asked(OperatorOrder::EmergencyStop, sent);
            assert!(lost.outcome("Running", 1).starts_with("NOT SENT"));
        }
    }
}
