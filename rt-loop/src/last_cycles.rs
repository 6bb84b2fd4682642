//! The last cycles before a stop, kept in memory set aside at the start and handed out one a cycle afterwards.

use shm_types::messages::LastCycle;
use shm_types::topics::LAST_CYCLES_KEPT;

/// A ring of cycles that stands still once the loop has stopped.
#[derive(Clone, Debug)]
pub struct LastCycles {
    ring: Vec<LastCycle>,
    /// Where the next cycle goes: the oldest, once the ring is full.
    next: usize,
    /// How many of a stop's cycles were handed out.
    handed_out: Option<usize>,
}

impl Default for LastCycles {
    fn default() -> Self {
        Self {
            ring: Vec::with_capacity(LAST_CYCLES_KEPT),
            next: 0,
            handed_out: None,
        }
    }
}

impl LastCycles {
    /// Keeps a cycle. The one that stops the loop is the last; from then on nothing is kept until all were handed out.
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    pub fn keep(&mut self, cycle: LastCycle, stopped: bool) {
        if self.handed_out.is_some_and(|count| count < self.ring.len()) {
            return;
        }
        if self.handed_out.is_some() {
            if stopped {
                return;
            }
            self.handed_out = None;
            self.ring.clear();
            self.next = 0;
        }
        if self.ring.len() < LAST_CYCLES_KEPT {
            self.ring.push(cycle);
        } else {
            self.ring[self.next] = cycle;
        }
        self.next = (self.next + 1) % LAST_CYCLES_KEPT;
        if stopped {
            self.handed_out = Some(0);
        }
    }

    /// The next of a stop's cycles, oldest first.
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    pub fn hand_out(&mut self) -> Option<LastCycle> {
        let index = self.handed_out.filter(|&index| index < self.ring.len())?;
        self.handed_out = Some(index + 1);
        let count = self.ring.len();
        let oldest = if count < LAST_CYCLES_KEPT {
            0
        } else {
            self.next
        };
        Some(LastCycle {
            index: index as u32,
            count: count as u32,
            ..self.ring[(oldest + index) % count]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycle(number: u64) -> LastCycle {
        let mut cycle = LastCycle::default();
        cycle.status.header.cycle = number;
        cycle
    }

    fn handed_out(last: &mut LastCycles) -> Vec<u64> {
        std::iter::from_fn(|| last.hand_out())
            .map(|cycle| cycle.status.header.cycle)
            .collect()
    }

    #[test]
    fn the_hundred_cycles_up_to_each_stop_come_out_in_order() {
        let mut last = LastCycles::default();
        for number in 0..=250 {
            last.keep(cycle(number), number >= 240);
        }
        assert_eq!(handed_out(&mut last), (141..=240).collect::<Vec<_>>());
        assert_eq!(handed_out(&mut last), Vec::<u64>::new());
        // A reset, then soon another stop.
        for number in 300..330 {
            last.keep(cycle(number), number >= 320);
        }
        assert_eq!(handed_out(&mut last), (300..=320).collect::<Vec<_>>());
    }

    #[test]
    fn a_stop_right_after_a_reset_keeps_the_one_before() {
        let mut last = LastCycles::default();
        last.keep(cycle(0), false);
        last.keep(cycle(1), true);
        assert_eq!(last.hand_out().map(|cycle| cycle.index), Some(0));
        last.keep(cycle(2), false);
        last.keep(cycle(3), true);
        assert_eq!(handed_out(&mut last), [1]);
    }
}
