//! The operator's orders: taken from whoever attaches to give them, passed on to the loop with a sign of life.
//!
//! Operators come and go; the loop hears the supervisor alone, so none of them touches its timing.

use realtime::clock::monotonic_ns;
use shm_types::bus::{Bus, BusError, Reader, Writer};
use shm_types::messages::{OperatorOrder, OperatorRequest, Supervision};
use shm_types::topics;

/// Hears operators, tells the loop.
pub struct Operator {
    session: u64,
    requests: Reader<OperatorRequest>,
    orders: Writer<Supervision>,
    emergency_stop: bool,
    resets: u32,
}

impl std::fmt::Debug for Operator {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Operator")
            .field("emergency_stop", &self.emergency_stop)
            .finish_non_exhaustive()
    }
}

impl Operator {
    /// Opens both topics of the run `session`.
    ///
    /// # Errors
    /// [`BusError`].
    pub fn open(bus: &Bus, session: u64) -> Result<Self, BusError> {
        Ok(Self {
            session,
            requests: bus.reader(&topics::OPERATOR_REQUEST)?,
            orders: bus.writer(&topics::SUPERVISION)?,
            emergency_stop: false,
            resets: 0,
        })
    }

    /// Orders a stop from here on, until an operator resets it.
    pub fn emergency_stop(&mut self) {
        self.emergency_stop = true;
    }

    /// Takes what operators ask for and tells the loop.
    pub fn pass_on(&mut self) {
        while let Some(request) = self.requests.take() {
            if request.session != self.session {
                continue;
            }
            match OperatorOrder::from_raw(request.order) {
                Some(OperatorOrder::EmergencyStop) => self.emergency_stop = true,
                Some(OperatorOrder::Reset) => {
                    self.emergency_stop = false;
                    self.resets = self.resets.wrapping_add(1);
                }
                None => (),
            }
        }
        self.orders.send_and_prepare(Supervision {
            session: self.session,
            sent_at_ns: monotonic_ns(),
            emergency_stop: u32::from(self.emergency_stop),
            resets: self.resets,
        });
    }
}
