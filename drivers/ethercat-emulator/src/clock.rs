//! The clock of one slave: a free-running counter that may be off, steered by the bus (distributed clocks), and SYNC0.
//!
//! Source: ETG.1000.4, section 6.5 (distributed clocks). Register numbers are those of [`crate::esc`].

/// Fastest correction of the clock's rate. Crystals are off by 100 ppm at most; this is far above.
const RATE_LIMIT: f64 = 1e-3;
/// Part of an error that one system time from the bus takes away at once.
const PHASE_SHARE: f64 = 0.25;
/// Part of an error that is taken for one of the rate.
const RATE_SHARE: f64 = 0.05;

/// Shortest cycle of SYNC0.
pub const CYCLE_MIN_NS: u32 = 125_000;

/// A slave's clock. `now_ns` is the time outside, the same for all slaves of a segment.
#[derive(Clone, Debug)]
pub struct Clock {
    powered_at_ns: u64,
    /// What the crystal is off by.
    error_ppm: f64,
    /// Steering: added to the counter.
    phase_ns: f64,
    rate: f64,
    steered_at_ns: u64,
    /// Registers 0x0920: from counter to system time.
    pub offset_ns: u64,
    /// Register 0x0928: how long a frame takes from the reference clock.
    pub delay_ns: u32,
    /// Local minus received system time, at the last frame that brought one.
    pub difference_ns: i64,
    sync0: Option<Sync0>,
}

#[derive(Clone, Copy, Debug)]
struct Sync0 {
    /// System time.
    next_ns: u64,
    /// 0: one pulse alone.
    cycle_ns: u64,
}

impl Clock {
    /// A clock that starts at 0 when `powered_at_ns` is now and runs `error_ppm` too fast.
    pub fn new(powered_at_ns: u64, error_ppm: f64) -> Self {
        Self {
            powered_at_ns,
            error_ppm,
            phase_ns: 0.0,
            rate: 0.0,
            steered_at_ns: powered_at_ns,
            offset_ns: 0,
            delay_ns: 0,
            difference_ns: 0,
            sync0: None,
        }
    }

    /// The counter, which frames are stamped with.
    pub fn local_ns(&self, now_ns: u64) -> u64 {
        let run_ns = now_ns.saturating_sub(self.powered_at_ns);
        let off_ns = run_ns as f64 * self.error_ppm * 1e-6;
        let steered_ns =
            self.phase_ns + self.rate * (now_ns.saturating_sub(self.steered_at_ns)) as f64;
        run_ns.wrapping_add((off_ns + steered_ns).round() as i64 as u64)
    }

    /// Time as all slaves and the master agree on it.
    pub fn system_ns(&self, now_ns: u64) -> u64 {
        self.local_ns(now_ns).wrapping_add(self.offset_ns)
    }

    /// A system time came by, from the reference clock or the master.
    pub fn steer(&mut self, now_ns: u64, received_ns: u64) {
        let expected_ns = received_ns.wrapping_add(u64::from(self.delay_ns));
        self.difference_ns = self.system_ns(now_ns).wrapping_sub(expected_ns) as i64;
        let since_ns = now_ns.saturating_sub(self.steered_at_ns).max(1) as f64;
        // A clock far away is moved by its offset, not by steering.
        let error_ns = (-self.difference_ns as f64).clamp(-1e6, 1e6);
        self.phase_ns += self.rate * since_ns + PHASE_SHARE * error_ns;
        self.rate =
            (self.rate + RATE_SHARE * error_ns / since_ns.max(1e5)).clamp(-RATE_LIMIT, RATE_LIMIT);
        self.steered_at_ns = now_ns;
    }

    /// Register 0x092c: how far local is from received time; bit 31 where it is behind.
    pub fn difference_register(&self) -> u32 {
        let size = self.difference_ns.unsigned_abs().min(0x7fff_ffff) as u32;
        size | u32::from(self.difference_ns < 0) << 31
    }

    /// Starts the pulses. A start that has passed is met only when the lower 32 bits of the time come round again, up to
    /// 4.3 s later, as in hardware.
    ///
    /// Pulses faster than [`CYCLE_MIN_NS`] no firmware could follow; they are left out.
    pub fn start_sync0(&mut self, now_ns: u64, start_ns: u64, cycle_ns: u32) {
        if (1..CYCLE_MIN_NS).contains(&cycle_ns) {
            self.sync0 = None;
            return;
        }
        let system_ns = self.system_ns(now_ns);
        // half the range ahead is the future, the rest the past
        let next_ns = if start_ns.wrapping_sub(system_ns) as i64 > 0 {
            start_ns
        } else {
            system_ns.wrapping_add(start_ns.wrapping_sub(system_ns) & 0xffff_ffff)
        };
        self.sync0 = Some(Sync0 {
            next_ns,
            cycle_ns: u64::from(cycle_ns),
        });
    }

    /// Stops the pulses.
    pub fn stop_sync0(&mut self) {
        self.sync0 = None;
    }

    /// Period of SYNC0 while it runs.
    pub fn sync0_cycle_ns(&self) -> Option<u64> {
        self.sync0.map(|sync0| sync0.cycle_ns)
    }

    /// System time of the next pulse.
    pub fn next_sync0_system_ns(&self) -> Option<u64> {
        self.sync0.map(|sync0| sync0.next_ns)
    }

    /// When, by the time outside, the next pulse is due.
    pub fn next_sync0_ns(&self, now_ns: u64) -> Option<u64> {
        let ahead_ns = self.sync0?.next_ns.wrapping_sub(self.system_ns(now_ns)) as i64;
        Some(now_ns.saturating_add_signed(ahead_ns))
    }

    /// Moves system time against the counter. Pulses that it jumps over do not come.
    pub fn set_offset(&mut self, now_ns: u64, offset_ns: u64) {
        if self.offset_ns != offset_ns {
            self.offset_ns = offset_ns;
            self.skip_pulses(now_ns);
        }
    }

    /// Leaves out the pulses up to now, for a time in which nobody was there.
    pub fn skip_pulses(&mut self, now_ns: u64) {
        let system_ns = self.system_ns(now_ns);
        if let Some(sync0) = &mut self.sync0
            && sync0.cycle_ns > 0
        {
            let behind_ns = system_ns.wrapping_sub(sync0.next_ns);
            if behind_ns as i64 > 0 {
                let missed = behind_ns.div_ceil(sync0.cycle_ns);
                sync0.next_ns = sync0
                    .next_ns
                    .wrapping_add(missed.wrapping_mul(sync0.cycle_ns));
            }
        }
    }

    /// The pulse that was due has come.
    pub fn pulse(&mut self) {
        match &mut self.sync0 {
            Some(sync0) if sync0.cycle_ns > 0 => {
                sync0.next_ns = sync0.next_ns.wrapping_add(sync0.cycle_ns);
            }
            _ => self.sync0 = None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steering_takes_away_a_clocks_error() {
        let reference = Clock::new(0, 0.0);
        let mut other = Clock::new(7_000, 80.0);
        let mut now_ns = 1_000_000;
        other.offset_ns = reference
            .local_ns(now_ns)
            .wrapping_sub(other.local_ns(now_ns));
        for _ in 0..20_000 {
            now_ns += 666_667;
            other.steer(now_ns, reference.system_ns(now_ns));
        }
        assert!(other.difference_ns.abs() < 20, "{}", other.difference_ns);
        now_ns += 666_667;
        let apart_ns = other.system_ns(now_ns) as i64 - reference.system_ns(now_ns) as i64;
        assert!(apart_ns.abs() < 20, "{apart_ns}");
    }

    #[test]
    fn an_unsteered_clock_drifts_through_a_period() {
        let clock = Clock::new(0, 20.0);
        let after_ns = 33_400_000_000;
        assert_eq!(clock.local_ns(after_ns) - after_ns, 668_000);
    }

    #[test]
    fn pulses_begin_at_their_start_and_never_before() {
        let mut clock = Clock::new(0, 0.0);
        clock.start_sync0(1_000, 5_000, 200_000);
        assert_eq!(clock.next_sync0_ns(1_000), Some(5_000));
        clock.pulse();
        assert_eq!(clock.next_sync0_ns(5_000), Some(205_000));
        clock.start_sync0(10_000, 9_000, 200_000);
        assert_eq!(clock.next_sync0_ns(10_000), Some(9_000 + (1 << 32)));
    }
}
