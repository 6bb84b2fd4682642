//! Those a loop in lockstep waits for beside the drives and the command.

use realtime::clock::{monotonic_ns, sleep_until};
use shm_types::bus::{Bus, BusError, Listener, Reader};
use shm_types::messages::{Header, Heartbeat, TorqueEstimate};
use shm_types::topics;

/// In lockstep nobody is late: this long without an answer means that somebody is gone for good. Longer than the supervisor
/// takes to notice and to start a service again.
pub const PATIENCE_NS: u64 = 60_000_000_000;
/// How often a waiting loop offers its sample to services that have just been started again.
pub const OFFER_NS: u64 = 20_000_000;
/// How often it looks whether the relay has caught up.
const RELAY_POLL_NS: u64 = 200_000;

/// The estimator, and the relay, which must not lose messages.
#[derive(Debug)]
pub struct LockstepPeers {
    estimate: Reader<TorqueEstimate>,
    estimate_ready: Listener,
    relay_progress: Reader<Heartbeat>,
    relay_cycle: u64,
}

impl LockstepPeers {
    /// Joins their topics. A wake-up that was lost is found `recheck_ns` later.
    ///
    /// # Errors
    /// [`BusError`].
    pub fn open(bus: &Bus, recheck_ns: u64) -> Result<Self, BusError> {
        Ok(Self {
            estimate: bus.reader(&topics::TORQUE_ESTIMATE)?,
            estimate_ready: bus.listener(&topics::TORQUE_ESTIMATE_READY, recheck_ns)?,
            relay_progress: bus.reader(&topics::RELAY_PROGRESS)?,
            relay_cycle: 0,
        })
    }

    /// Waits until the estimator has answered `asked` too and the relay is not about to lose messages. Calls `offer` now
    /// and then, for an estimator that was started again.
    pub fn wait(&mut self, asked: &Header, offer: impl Fn()) {
        let give_up_at_ns = monotonic_ns() + PATIENCE_NS;
        while !self.has_estimate(asked) && monotonic_ns() < give_up_at_ns {
            if !self.estimate_ready.wait(OFFER_NS) {
                offer();
            }
        }
        while self.relay_is_behind(asked) && monotonic_ns() < give_up_at_ns {
            sleep_until(monotonic_ns() + RELAY_POLL_NS);
        }
    }

    fn has_estimate(&self, asked: &Header) -> bool {
        let mut answered = false;
        while let Some(estimate) = self.estimate.take() {
            answered |= estimate.header.answers(asked).is_ok();
        }
        answered
    }

    fn relay_is_behind(&mut self, asked: &Header) -> bool {
        if let Some(progress) = self.relay_progress.take_newest() {
            self.relay_cycle = progress.cycle;
        }
        asked.cycle.saturating_sub(self.relay_cycle) >= topics::RELAY_BUFFER as u64 / 2
    }
}
