//! What the loop counts and times about itself, in memory set aside at the start.

use hdrhistogram::Histogram;

/// Times of one cycle, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CycleTimes {
    /// Late by this much against the first instant planned after the last cycle: skipped periods are in it.
    pub wakeup_lateness_ns: u64,
    /// Since the last wake-up; 0 in the first cycle.
    pub period_ns: u64,
    /// The loop's own work, waiting not counted.
    pub compute_ns: u64,
    /// From publishing the sample to holding its command; 0 if none came.
    pub command_latency_ns: u64,
    /// Reading from and writing to the drives.
    pub exchange_ns: u64,
    /// From the planned instant to the end of the cycle's work.
    pub finished_after_ns: u64,
}

/// Counters since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Cycles that were run.
    pub cycles: u64,
    /// Periods whose command came after its deadline, whose work ended after the period, or that were skipped.
    pub missed_deadlines: u64,
    /// Periods that were skipped because the loop was late.
    pub skipped_periods: u64,
    /// Cycles without a fresh command after the first one.
    pub stale_commands: u64,
    /// Commands refused because they belong to another run or robot.
    pub foreign_commands: u64,
    /// Commands refused because they answer an older sample.
    pub late_commands: u64,
    /// Commands refused because they answer a sample that was not sent.
    pub future_commands: u64,
    /// Commands refused because a torque or velocity is not a number, or their mode is none.
    pub unusable_commands: u64,
    /// Cycles without a sample from the drives.
    pub drive_faults: u64,
    /// Frames of the bus that did not come back whole, as the driver counts them.
    pub bus_frames_lost: u64,
    /// Commands that the driver could not hand to the drives.
    pub unsent_commands: u64,
    /// Joint commands that a limit changed.
    pub limited_commands: u64,
    /// Page faults of the loop's thread.
    pub page_faults: u64,
    /// Context switches the loop's thread did not ask for.
    pub involuntary_switches: u64,
    /// The longest run of cycles without a fresh command.
    pub longest_command_gap_cycles: u64,
    /// How often the loop left [`shm_types::messages::LoopState::Running`].
    pub command_gaps: u64,
}

impl Counters {
    /// Commands refused for whatever reason.
    pub fn refused_commands(&self) -> u64 {
        self.foreign_commands + self.late_commands + self.future_commands + self.unusable_commands
    }
}

/// A cycle that did not keep its time or came after skipped ones, with what is known about it inside the loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Overrun {
    /// The cycle.
    pub cycle: u64,
    /// Its planned instant.
    pub planned_ns: u64,
    /// Its times.
    pub times: CycleTimes,
    /// Deadlines it cost: its own, and those of the periods skipped for the same reason.
    pub periods: u64,
    /// Page faults of the thread during the cycle.
    pub page_faults: u64,
    /// Involuntary context switches of the thread during the cycle.
    pub involuntary_switches: u64,
    /// Whether the command had come.
    pub command_came: bool,
    /// Whether the drives had answered.
    pub sample_came: bool,
}

/// Histograms, counters and the overruns of a run.
#[derive(Clone, Debug)]
pub struct Statistics {
    /// Late by this much against the planned instant.
    pub wakeup_lateness_ns: Histogram<u64>,
    /// From wake-up to wake-up.
    pub period_ns: Histogram<u64>,
    /// The loop's own work.
    pub compute_ns: Histogram<u64>,
    /// From sample to command.
    pub command_latency_ns: Histogram<u64>,
    /// Reading from and writing to the drives.
    pub exchange_ns: Histogram<u64>,
    /// How far the loop was from where the drives' clock wants it, while both went together.
    pub clock_offset_ns: Histogram<u64>,
    /// Counters.
    pub counters: Counters,
    overruns: Vec<Overrun>,
}

/// Overruns kept with their circumstances; further ones are only counted.
const OVERRUNS_KEPT: usize = 4096;
/// Longest time the histograms tell apart; longer ones count as this.
const HIGHEST_NS: u64 = 10_000_000_000;

impl Default for Statistics {
    fn default() -> Self {
        // Fixed bounds with three digits: 10 s and 1 ns fit, and recording never allocates.
        let histogram = || {
            Histogram::new_with_bounds(1, HIGHEST_NS, 3).expect("the bounds are constants in range")
        };
        Self {
            wakeup_lateness_ns: histogram(),
            period_ns: histogram(),
            compute_ns: histogram(),
            command_latency_ns: histogram(),
            exchange_ns: histogram(),
            clock_offset_ns: histogram(),
            counters: Counters::default(),
            overruns: Vec::with_capacity(OVERRUNS_KEPT),
        }
    }
}

impl Statistics {
    /// Adds one cycle's times.
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    pub fn record(&mut self, times: &CycleTimes) {
        self.counters.cycles += 1;
        self.wakeup_lateness_ns
            .saturating_record(times.wakeup_lateness_ns.max(1));
        self.compute_ns.saturating_record(times.compute_ns.max(1));
        self.exchange_ns.saturating_record(times.exchange_ns.max(1));
        if times.period_ns > 0 {
            self.period_ns.saturating_record(times.period_ns);
        }
        if times.command_latency_ns > 0 {
            self.command_latency_ns
                .saturating_record(times.command_latency_ns);
        }
    }

    /// Counts a cycle that did not keep its time, and keeps its circumstances while there is room.
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    pub fn record_overrun(&mut self, overrun: Overrun) {
        self.counters.missed_deadlines += overrun.periods;
        if self.overruns.len() < OVERRUNS_KEPT {
            self.overruns.push(overrun);
        }
    }

    /// Counts periods that were skipped because the last overrun reached into them.
    pub fn extend_overrun(&mut self, skipped_periods: u64) {
        self.counters.missed_deadlines += skipped_periods;
        if let Some(overrun) = self.overruns.last_mut() {
            overrun.periods += skipped_periods;
        }
    }

    /// The overruns kept, oldest first.
    pub fn overruns(&self) -> &[Overrun] {
        &self.overruns
    }
}
