//! What each cycle adds to the loop's statistics, and which of them missed its deadline.

use realtime::usage::{ThreadUsage, thread_usage};
use shm_types::drive::{BusReport, ClockState};

use crate::statistics::{CycleTimes, Overrun, Statistics};

/// What happened in one cycle, to be counted.
#[derive(Clone, Copy, Debug)]
pub struct CycleFacts {
    /// The cycle.
    pub cycle: u64,
    /// Its planned instant.
    pub planned_ns: u64,
    /// Periods that had passed before it.
    pub skipped: u64,
    /// Its times.
    pub times: CycleTimes,
    /// Whether the drives had answered.
    pub sample_came: bool,
    /// Whether its command had come.
    pub command_came: bool,
    /// Whether the loop was in `Running` before.
    pub was_running: bool,
    /// Whether there has been a command in this run.
    pub started: bool,
    /// Cycles in a row without a fresh command.
    pub cycles_without_command: u64,
    /// Joints whose command was limited, one bit each.
    pub limited_joints: u64,
}

/// Statistics of the loop and what it takes to keep them.
#[derive(Debug, Default)]
pub struct Accounts {
    /// What was counted so far.
    pub statistics: Statistics,
    usage: ThreadUsage,
    /// Whether the last cycle's work ended after its period: it then has to answer for the periods skipped next.
    overran: bool,
}

impl Accounts {
    /// From here on the thread's page faults and context switches count.
    pub fn begin(&mut self) {
        self.usage = thread_usage();
    }

    /// Counts what a sample told of the bus.
    pub fn count_bus(&mut self, bus: &BusReport) {
        self.statistics.counters.bus_frames_lost = bus.frames_lost;
        if ClockState::from_raw(bus.clock) == Some(ClockState::Locked) {
            let offset_ns = bus.clock_offset_ns.unsigned_abs().max(1);
            self.statistics.clock_offset_ns.saturating_record(offset_ns);
        }
    }

    /// Counts one cycle. `deadline_ns` is how long its work may take; `None` where nobody has a clock.
    pub fn count(&mut self, facts: &CycleFacts, deadline_ns: Option<u64>) {
        let usage = thread_usage();
        let page_faults = usage.page_faults - self.usage.page_faults;
        let involuntary_switches = usage.involuntary_switches - self.usage.involuntary_switches;
        self.usage = usage;
        self.statistics.record(&facts.times);
        let counters = &mut self.statistics.counters;
        counters.page_faults += page_faults;
        counters.involuntary_switches += involuntary_switches;
        counters.drive_faults += u64::from(!facts.sample_came);
        counters.limited_commands += u64::from(facts.limited_joints.count_ones());
        counters.longest_command_gap_cycles = counters
            .longest_command_gap_cycles
            .max(facts.cycles_without_command);
        if facts.started && !facts.command_came {
            counters.stale_commands += 1;
            counters.command_gaps += u64::from(facts.was_running);
        }
        counters.skipped_periods += facts.skipped;
        let late = deadline_ns.is_some_and(|most_ns| facts.times.finished_after_ns > most_ns);
        let overslept = if self.overran {
            self.statistics.extend_overrun(facts.skipped);
            0
        } else {
            facts.skipped
        };
        self.overran = facts.started && late;
        let periods = overslept + u64::from(late || !facts.command_came);
        if facts.started && periods > 0 {
            self.statistics.record_overrun(Overrun {
                cycle: facts.cycle,
                planned_ns: facts.planned_ns,
                times: facts.times,
                periods,
                page_faults,
                involuntary_switches,
                command_came: facts.command_came,
                sample_came: facts.sample_came,
            });
        }
    }
}
