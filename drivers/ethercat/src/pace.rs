//! The drives' clock seen from the loop's: when SYNC0 was, and how much later the loop should begin. No clock of its own.

use shm_types::drive::ClockState;

/// Part of a new difference that counts: frames are late by chance, clocks drift slowly.
const SHARE: f64 = 1.0 / 32.0;
/// So many cycles near one another are in step, so many far apart are no longer.
const LOCK_CYCLES: u32 = 200;
const LOSE_CYCLES: u32 = 20;
/// In step is within this part of the period, out of it beyond the other.
const NEAR_PARTS: i64 = 10;
const FAR_PARTS: i64 = 4;
/// SYNC0 comes this part of the period before the loop's instant: inputs are then fresh when they are fetched, and outputs, sent
/// within three quarters of the period, are there before the next.
const AHEAD_PARTS: i64 = 8;

/// Follows the drives' clock.
#[derive(Clone, Debug)]
pub struct Pace {
    period_ns: i64,
    /// System time of a SYNC0.
    sync0_ns: u64,
    offset_ns: Option<f64>,
    state: ClockState,
    near_cycles: u32,
    far_cycles: u32,
}

impl Pace {
    /// For SYNC0 at `sync0_ns` and every period from there.
    pub fn new(sync0_ns: u64, period_ns: u64) -> Self {
        Self {
            period_ns: period_ns.max(1) as i64,
            sync0_ns,
            offset_ns: None,
            state: ClockState::Locking,
            near_cycles: 0,
            far_cycles: 0,
        }
    }

    /// A frame read the system time when it was `half_way_ns` on the loop's clock, in the cycle planned for `planned_ns`. The
    /// instant of the last SYNC0 before it, on the loop's clock.
    pub fn observe(&mut self, system_ns: u64, half_way_ns: u64, planned_ns: u64) -> u64 {
        let since_ns = (system_ns.wrapping_sub(self.sync0_ns) as i64).rem_euclid(self.period_ns);
        let latched_ns = half_way_ns.saturating_sub(since_ns as u64);
        let wanted_ns = latched_ns as i64 + self.period_ns / AHEAD_PARTS;
        let late_ns = self.wrapped(wanted_ns.wrapping_sub(planned_ns as i64));
        let offset_ns = match self.offset_ns {
            None => late_ns as f64,
            Some(before_ns) => {
                let step_ns = self.wrapped(late_ns - before_ns as i64);
                before_ns + SHARE * step_ns as f64
            }
        };
        self.offset_ns = Some(self.wrapped(offset_ns as i64) as f64);
        self.judge(late_ns);
        latched_ns
    }

    /// Into half a period either way.
    fn wrapped(&self, difference_ns: i64) -> i64 {
        (difference_ns + self.period_ns / 2).rem_euclid(self.period_ns) - self.period_ns / 2
    }

    fn judge(&mut self, late_ns: i64) {
        let near = late_ns.abs() < self.period_ns / NEAR_PARTS;
        let far = late_ns.abs() > self.period_ns / FAR_PARTS;
        self.near_cycles = if near {
            self.near_cycles.saturating_add(1)
        } else {
            0
        };
        self.far_cycles = if far {
            self.far_cycles.saturating_add(1)
        } else {
            0
        };
        if self.near_cycles >= LOCK_CYCLES {
            self.state = ClockState::Locked;
        } else if self.state == ClockState::Locked && self.far_cycles >= LOSE_CYCLES {
            self.state = ClockState::Lost;
        }
    }

    /// No system time came in this cycle.
    pub fn miss(&mut self) {
        self.near_cycles = 0;
        self.far_cycles = self.far_cycles.saturating_add(1);
        if self.state == ClockState::Locked && self.far_cycles >= LOSE_CYCLES {
            self.state = ClockState::Lost;
        }
    }

    /// Whether both go together.
    pub fn state(&self) -> ClockState {
        self.state
    }

    /// By how much the loop's cycles should begin later.
    pub fn offset_ns(&self) -> i64 {
        self.offset_ns.unwrap_or(0.0) as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 666_667;

    /// A loop that follows, and drives whose clock is off.
    fn follow(ppm: f64, cycles: u64) -> (Pace, i64) {
        let mut pace = Pace::new(5_000_000, PERIOD_NS);
        let mut planned_ns = 1_000_000_000_u64;
        let mut apart_ns = 0;
        for cycle in 0..cycles {
            let noise_ns = (cycle * 7919 % 40_000) + 20_000;
            let half_way_ns = planned_ns + noise_ns;
            let system_ns = half_way_ns + (half_way_ns as f64 * ppm * 1e-6) as u64;
            let latched_ns = pace.observe(system_ns, half_way_ns, planned_ns);
            assert!(latched_ns <= half_way_ns && half_way_ns - latched_ns < PERIOD_NS);
            // a sixteenth of what is asked for, each cycle
            planned_ns = planned_ns.saturating_add_signed(pace.offset_ns() / 16) + PERIOD_NS;
            apart_ns = planned_ns as i64 - PERIOD_NS as i64 - latched_ns as i64;
        }
        (pace, apart_ns)
    }

    #[test]
    fn a_loop_that_follows_comes_into_step_and_stays() {
        for ppm in [-80.0, 0.0, 20.0, 80.0] {
            let (pace, apart_ns) = follow(ppm, 6000);
            assert_eq!(pace.state(), ClockState::Locked, "{ppm} ppm");
            let ahead_ns = PERIOD_NS as i64 / AHEAD_PARTS;
            assert!(
                (apart_ns - ahead_ns).abs() < 20_000,
                "{ppm} ppm: {apart_ns}"
            );
        }
    }

    #[test]
    fn a_clock_that_jumps_is_lost() {
        let (mut pace, _) = follow(0.0, 6000);
        for _ in 0..LOSE_CYCLES {
            pace.miss();
        }
        assert_eq!(pace.state(), ClockState::Lost);
    }
}
