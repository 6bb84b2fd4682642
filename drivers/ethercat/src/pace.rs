//! The drives' clock seen from the loop's: when SYNC0 was, and how much later the loop should begin. No clock of its own.
//!
//! A frame tells the drives' time at some instant between its sending and its coming back, and nobody tells when. Of its round
//! trip the least that was ever seen is the cable; the rest is somebody who was late, on either leg. The reading is therefore
//! known within half of that rest, either way (as in the clock filter of NTP, RFC 5905, section 10, where the samples of least
//! delay count). Here every frame counts by its bounds: what is known is where all of them meet, widened by how far clocks may
//! drift since. A frame that was late by milliseconds has wide bounds and moves nothing.

use shm_types::drive::ClockState;

/// So many cycles near one another are in step, so many far apart are no longer.
const LOCK_CYCLES: u32 = 200;
const LOSE_CYCLES: u32 = 20;
/// In step is within this part of the period, out of it beyond the other.
const NEAR_PARTS: i64 = 10;
const FAR_PARTS: i64 = 4;
/// SYNC0 comes this part of the period before the loop's instant: inputs are then fresh when they are fetched, and outputs, sent
/// within three quarters of the period, are there before the next.
const AHEAD_PARTS: i64 = 8;
/// How fast the two clocks may part, as a part of the time: 200 ppm, twice what a bad crystal is off.
const DRIFT_PARTS: i64 = 5_000;

/// A frame that came back with the drives' time in it.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// System time at the reference clock.
    pub system_ns: u64,
    /// When the frame was sent, on the loop's clock.
    pub sent_ns: u64,
    /// When it had come back, on the loop's clock.
    pub received_ns: u64,
}

/// What the loop's clock shows more than the drives': somewhere between two numbers.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    least_ns: i64,
    most_ns: i64,
    /// When, on the loop's clock.
    at_ns: u64,
}

impl Bounds {
    /// What is left of both. Where they contradict one another (the drives' clock was set, or the round trip was never as short
    /// as it can be) it is the gap between them: one frame more says where in it.
    fn meet(self, other: Self) -> Self {
        let past_ns = other.at_ns.saturating_sub(self.at_ns);
        let drift_ns = i64::try_from(past_ns).unwrap_or(i64::MAX) / DRIFT_PARTS;
        let low_ns = self.least_ns.saturating_sub(drift_ns).max(other.least_ns);
        let high_ns = self.most_ns.saturating_add(drift_ns).min(other.most_ns);
        Self {
            least_ns: low_ns.min(high_ns),
            most_ns: low_ns.max(high_ns),
            at_ns: other.at_ns,
        }
    }

    fn middle_ns(self) -> i64 {
        self.least_ns.midpoint(self.most_ns)
    }
}

/// Follows the drives' clock.
#[derive(Clone, Debug)]
pub struct Pace {
    period_ns: i64,
    /// System time of a SYNC0.
    sync0_ns: u64,
    /// Shortest round trip so far.
    round_trip_ns: u64,
    bounds: Option<Bounds>,
    offset_ns: i64,
    state: ClockState,
    near_cycles: u32,
    far_cycles: u32,
}

impl Pace {
    /// For SYNC0 at `sync0_ns` and every period from there.
    pub fn new(sync0_ns: u64, period_ns: u64) -> Self {
        Self {
            period_ns: i64::try_from(period_ns).unwrap_or(i64::MAX).max(1),
            sync0_ns,
            round_trip_ns: u64::MAX,
            bounds: None,
            offset_ns: 0,
            state: ClockState::Locking,
            near_cycles: 0,
            far_cycles: 0,
        }
    }

    /// The system time came in the cycle planned for `planned_ns`. The instant of the last SYNC0 before it was read, on the
    /// loop's clock.
    pub fn observe(&mut self, reading: Reading, planned_ns: u64) -> u64 {
        let Reading {
            system_ns,
            sent_ns,
            received_ns,
        } = reading;
        let round_trip_ns = received_ns.saturating_sub(sent_ns);
        self.round_trip_ns = self.round_trip_ns.min(round_trip_ns);
        let half_way_ns = sent_ns + round_trip_ns / 2;
        let ahead_ns = half_way_ns.wrapping_sub(system_ns) as i64;
        let late_ns = ((round_trip_ns - self.round_trip_ns) / 2) as i64;
        let seen = Bounds {
            least_ns: ahead_ns.saturating_sub(late_ns),
            most_ns: ahead_ns.saturating_add(late_ns),
            at_ns: half_way_ns,
        };
        let bounds = self.bounds.map_or(seen, |before| before.meet(seen));
        self.bounds = Some(bounds);
        let since_ns = (system_ns.wrapping_sub(self.sync0_ns) as i64).rem_euclid(self.period_ns);
        let latched_ns = system_ns
            .wrapping_add_signed(bounds.middle_ns())
            .wrapping_sub(since_ns as u64);
        let wanted_ns = latched_ns.wrapping_add_signed(self.period_ns / AHEAD_PARTS);
        self.offset_ns = self.wrapped(wanted_ns.wrapping_sub(planned_ns) as i64);
        self.judge();
        latched_ns.min(received_ns)
    }

    /// Into half a period either way.
    fn wrapped(&self, difference_ns: i64) -> i64 {
        (difference_ns + self.period_ns / 2).rem_euclid(self.period_ns) - self.period_ns / 2
    }

    fn judge(&mut self) {
        let apart_ns = self.offset_ns.abs();
        let near = apart_ns < self.period_ns / NEAR_PARTS;
        let far = apart_ns > self.period_ns / FAR_PARTS;
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

    /// No system time came in this cycle. One that is missing tells nothing; many in a row are clocks that nobody compares.
    pub fn miss(&mut self) {
        self.far_cycles = self.far_cycles.saturating_add(1);
        if self.far_cycles >= LOSE_CYCLES {
            self.near_cycles = 0;
            if self.state == ClockState::Locked {
                self.state = ClockState::Lost;
            }
        }
    }

    /// Whether both go together.
    pub fn state(&self) -> ClockState {
        self.state
    }

    /// By how much the cycle of the last reading should have begun later: how far its planned instant is from its place after
    /// SYNC0, as well as it is known. How late the loop woke has no part in it.
    pub fn offset_ns(&self) -> i64 {
        self.offset_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 666_667;
    /// Least time of a frame each way: what a veth pair takes.
    const LEG_NS: u64 = 15_000;
    /// A frame that takes longer is not waited for.
    const PATIENCE_NS: u64 = PERIOD_NS / 3;
    /// What the loop may be off its place after SYNC0, once both go together.
    const PHASE_MAX_NS: u64 = 20_000;
    /// Forty seconds.
    const CYCLES: u64 = 60_000;

    /// How late a thread of a real-time priority woke in so great a part of all cases: cyclictest on a virtual machine with two
    /// cores (docs/drives.md), in nanoseconds.
    const LATENESS: [(f64, f64); 5] = [
        (0.0, 12e3),
        (0.5, 21e3),
        (0.99, 80e3),
        (0.999, 425e3),
        (1.0, 8e6),
    ];

    /// Seeded, uniform in 0..1 (splitmix64).
    struct Draws(u64);

    impl Draws {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut bits = self.0;
            bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
            (bits ^ bits >> 31) as f64 / u64::MAX as f64
        }

        /// How late somebody is: never less than the least that anybody is.
        fn late_ns(&mut self) -> u64 {
            let part = self.next();
            let at = LATENESS.partition_point(|(upto, _)| *upto < part).max(1);
            let ((from, low_ns), (upto, high_ns)) = (LATENESS[at - 1], LATENESS[at]);
            let share = (part - from) / (upto - from);
            (low_ns * (high_ns / low_ns).powf(share)) as u64
        }
    }

    /// Who delays a frame: the drives' side on the way out, the loop's on the way back.
    #[derive(Clone, Copy, Debug)]
    enum Late {
        Nobody,
        Out,
        Back,
        Both,
        /// Both, twice and three times as much: a busy machine.
        Busy,
    }

    /// What became of a run: how far the loop truly was from its place, and its own opinion from that, after locking.
    #[derive(Debug, Default)]
    struct Found {
        locked_after: Option<u64>,
        off_ns: u64,
        untold_ns: u64,
        lost_cycles: u64,
        state: Option<ClockState>,
    }

    /// A loop that follows as rt-loop's does, and drives whose clock is off.
    fn follow(ppm: f64, late: Late, seed: u64) -> Found {
        let mut draws = Draws(seed);
        let sync0_ns = 5_000_000;
        let mut pace = Pace::new(sync0_ns, PERIOD_NS);
        let system_ns =
            |loop_ns: u64| loop_ns.wrapping_add_signed((loop_ns as f64 * ppm * 1e-6) as i64);
        // how much later than planned the cycle should be
        let wrong_ns = |planned_ns: u64| {
            let period_ns = PERIOD_NS as i64;
            let since_ns = (system_ns(planned_ns) - sync0_ns) as i64 % period_ns;
            let wrong_ns = period_ns / AHEAD_PARTS - since_ns;
            (wrong_ns + period_ns / 2).rem_euclid(period_ns) - period_ns / 2
        };
        let mut planned_ns = 1_000_000_000_u64;
        let mut found = Found::default();
        let mut cycle = 0;
        while cycle < CYCLES {
            let woke_ns = planned_ns + draws.late_ns();
            // periods that were slept through are left out
            let skipped = (woke_ns - planned_ns) / PERIOD_NS;
            planned_ns += skipped * PERIOD_NS;
            let (out_ns, back_ns) = match late {
                Late::Nobody => (0, 0),
                Late::Out => (draws.late_ns(), 0),
                Late::Back => (0, draws.late_ns()),
                Late::Both => (draws.late_ns(), draws.late_ns()),
                Late::Busy => (2 * draws.late_ns(), 3 * draws.late_ns()),
            };
            let read_ns = woke_ns + LEG_NS + out_ns;
            let received_ns = read_ns + LEG_NS + back_ns;
            let mut step_ns = 0;
            if received_ns < planned_ns + PATIENCE_NS {
                let reading = Reading {
                    system_ns: system_ns(read_ns),
                    sent_ns: woke_ns,
                    received_ns,
                };
                let latched_ns = pace.observe(reading, planned_ns);
                assert!(latched_ns <= received_ns && received_ns - latched_ns < 2 * PERIOD_NS);
                step_ns = (pace.offset_ns() / 16).clamp(-6666, 6666);
            } else {
                pace.miss();
                found.lost_cycles += 1;
            }
            if pace.state() == ClockState::Locked {
                found.locked_after.get_or_insert(cycle);
                let truly_ns = wrong_ns(planned_ns);
                found.off_ns = found.off_ns.max(truly_ns.unsigned_abs());
                if received_ns < planned_ns + PATIENCE_NS {
                    let untold_ns = pace.offset_ns().abs_diff(truly_ns);
                    found.untold_ns = found.untold_ns.max(untold_ns);
                }
            }
            planned_ns = (planned_ns + PERIOD_NS).saturating_add_signed(step_ns);
            cycle += 1 + skipped;
        }
        found.state = Some(pace.state());
        found
    }

    #[test]
    fn the_loop_keeps_its_place_whoever_is_late() {
        use Late::{Back, Both, Busy, Nobody, Out};
        for late in [Nobody, Out, Back, Both, Busy] {
            for ppm in [-80.0, -50.0, 0.0, 50.0, 80.0] {
                let mut worst = Found::default();
                for seed in 1..=2 {
                    let found = follow(ppm, late, seed);
                    assert_eq!(found.state, Some(ClockState::Locked), "{ppm} ppm, {late:?}");
                    worst.off_ns = worst.off_ns.max(found.off_ns);
                    worst.untold_ns = worst.untold_ns.max(found.untold_ns);
                    worst.lost_cycles = worst.lost_cycles.max(found.lost_cycles);
                    worst.locked_after = worst.locked_after.max(found.locked_after);
                }
                println!("{late:?}, {ppm} ppm: {worst:?}");
                assert!(
                    worst.off_ns < PHASE_MAX_NS,
                    "{ppm} ppm, {late:?}: {worst:?}"
                );
                assert!(
                    worst.untold_ns < PHASE_MAX_NS,
                    "{ppm} ppm, {late:?}: {worst:?}"
                );
            }
        }
    }

    /// A pace in step, at this planned instant.
    fn in_step(round_trip_ns: u64) -> (Pace, u64) {
        let mut pace = Pace::new(0, PERIOD_NS);
        let planned_ns = 1500 * PERIOD_NS + PERIOD_NS / 8;
        for cycle in 0..300 {
            let planned_ns = planned_ns + cycle * PERIOD_NS;
            pace.observe(at(planned_ns, round_trip_ns, 0), planned_ns);
        }
        assert_eq!(pace.state(), ClockState::Locked);
        (pace, planned_ns + 300 * PERIOD_NS)
    }

    /// A frame sent at an instant, the clocks being the same but for `ahead_ns`, read half way.
    fn at(sent_ns: u64, round_trip_ns: u64, ahead_ns: u64) -> Reading {
        Reading {
            system_ns: sent_ns + round_trip_ns / 2 + ahead_ns,
            sent_ns,
            received_ns: sent_ns + round_trip_ns,
        }
    }

    #[test]
    fn a_frame_that_is_late_moves_nothing() {
        let (mut pace, planned_ns) = in_step(30_000);
        let before_ns = pace.offset_ns();
        // 8 ms on the way back: half of it would be 4 ms off
        let mut late = at(planned_ns, 30_000, 0);
        late.received_ns += 8_000_000;
        let latched_ns = pace.observe(late, planned_ns);
        // by what the clocks may have parted in a few milliseconds, at most
        assert!(pace.offset_ns().abs_diff(before_ns) < 1000);
        assert!(latched_ns.abs_diff(planned_ns - PERIOD_NS / 8) < 1000);
    }

    #[test]
    fn a_clock_that_was_set_is_believed_with_the_second_frame() {
        let (mut pace, mut planned_ns) = in_step(30_000);
        for _ in 0..2 {
            pace.observe(at(planned_ns, 30_000, 100_000), planned_ns);
            planned_ns += PERIOD_NS;
        }
        assert!(
            pace.offset_ns().abs_diff(-100_000) < 200,
            "{}",
            pace.offset_ns()
        );
    }

    #[test]
    fn times_that_cannot_be_are_survived() {
        let (mut pace, planned_ns) = in_step(30_000);
        let ends = [0, 1, planned_ns, u64::MAX / 2, u64::MAX - 1, u64::MAX];
        for system_ns in ends {
            for sent_ns in ends {
                for received_ns in ends {
                    let reading = Reading {
                        system_ns,
                        sent_ns,
                        received_ns,
                    };
                    pace.observe(reading, planned_ns);
                    assert!(pace.offset_ns().unsigned_abs() <= PERIOD_NS / 2 + 1);
                }
            }
        }
    }

    #[test]
    fn a_clock_that_stays_away_is_lost() {
        let (mut pace, _) = in_step(30_000);
        for _ in 0..LOSE_CYCLES {
            pace.miss();
        }
        assert_eq!(pace.state(), ClockState::Lost);
    }
}
