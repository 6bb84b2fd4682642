//! What the loop leaves behind for whoever started it.

use std::collections::BTreeMap;

use hdrhistogram::Histogram;
use realtime::grant::Grant;
use serde::{Deserialize, Serialize};

use crate::attribution::{Cause, StealLog, cause};
use crate::statistics::{Overrun, Statistics};

/// File of the loop's report in the instance's directory.
pub const LOOP_REPORT_FILE: &str = "loop-report.json";

/// Quantiles of a time, in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quantiles {
    /// How many times were taken.
    pub count: u64,
    /// Half of them are at most this.
    pub p50_us: f64,
    /// 99 in 100.
    pub p99_us: f64,
    /// 999 in 1000.
    pub p999_us: f64,
    /// The largest.
    pub max_us: f64,
}

impl Quantiles {
    /// Of a histogram in nanoseconds.
    pub fn of(histogram: &Histogram<u64>) -> Self {
        let at = |quantile| histogram.value_at_quantile(quantile) as f64 * 1e-3;
        Self {
            count: histogram.len(),
            p50_us: at(0.5),
            p99_us: at(0.99),
            p999_us: at(0.999),
            max_us: histogram.max() as f64 * 1e-3,
        }
    }
}

/// The loop's account of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoopReport {
    /// Real-time treatment asked for and granted; `None` in lockstep, which asks for none.
    pub grant: Option<Grant>,
    /// State at the end, by name.
    pub final_state: String,
    /// Why the loop last left `Running`, if it did.
    pub last_fault: Option<String>,
    /// Wall-clock time from the first cycle to the last.
    pub wall_s: f64,
    /// Time the cycles stand for.
    pub controlled_s: f64,
    /// Rate asked for.
    pub rate_hz: f64,
    /// Late by this much against the planned instant.
    pub wakeup_lateness: Quantiles,
    /// From wake-up to wake-up.
    pub period: Quantiles,
    /// The loop's own work.
    pub compute: Quantiles,
    /// From publishing a sample to holding its command.
    pub command_latency: Quantiles,
    /// Reading from and writing to the drives.
    pub exchange: Quantiles,
    /// How far the loop was from where the drives' clock wants it, either way, while both went together.
    pub clock_offset: Quantiles,
    /// Counters by name.
    pub counters: BTreeMap<String, u64>,
    /// Missed deadlines by main cause.
    pub overrun_causes: BTreeMap<Cause, u64>,
    /// The cycles that missed them, oldest first, as many as were kept.
    pub overruns: Vec<ExplainedOverrun>,
}

/// A cycle that missed its deadline.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExplainedOverrun {
    /// The cycle.
    pub cycle: u64,
    /// Its planned instant on the monotonic clock.
    pub planned_ns: u64,
    /// Deadlines it cost.
    pub periods: u64,
    /// Why.
    pub cause: Cause,
    /// Late by this much against the first instant planned after the last cycle.
    pub wakeup_lateness_us: f64,
    /// The loop's own work.
    pub compute_us: f64,
    /// From sample to command; 0 if none came.
    pub command_latency_us: f64,
    /// Exchange with the drives.
    pub exchange_us: f64,
    /// From the planned instant to the end of the cycle's work.
    pub finished_after_us: f64,
}

/// Counters under the names they are reported by.
pub fn named_counters(statistics: &Statistics) -> BTreeMap<String, u64> {
    let counters = &statistics.counters;
    [
        ("cycles", counters.cycles),
        ("missed_deadlines", counters.missed_deadlines),
        ("skipped_periods", counters.skipped_periods),
        ("stale_commands", counters.stale_commands),
        ("command_gaps", counters.command_gaps),
        (
            "longest_command_gap_cycles",
            counters.longest_command_gap_cycles,
        ),
        ("refused_foreign_commands", counters.foreign_commands),
        ("refused_late_commands", counters.late_commands),
        ("refused_future_commands", counters.future_commands),
        ("refused_unusable_commands", counters.unusable_commands),
        ("drive_faults", counters.drive_faults),
        ("bus_frames_lost", counters.bus_frames_lost),
        ("unsent_commands", counters.unsent_commands),
        ("limited_commands", counters.limited_commands),
        ("page_faults", counters.page_faults),
        ("involuntary_switches", counters.involuntary_switches),
    ]
    .map(|(name, count)| (name.to_owned(), count))
    .into()
}

/// Missed deadlines counted by main cause.
pub fn overrun_causes(
    statistics: &Statistics,
    steal: &StealLog,
    period_ns: u64,
) -> BTreeMap<Cause, u64> {
    let mut causes = BTreeMap::new();
    for overrun in statistics.overruns() {
        *causes.entry(cause(overrun, steal, period_ns)).or_insert(0) += overrun.periods;
    }
    causes
}

/// The overruns that were kept, each with its main cause.
pub fn explained_overruns(
    statistics: &Statistics,
    steal: &StealLog,
    period_ns: u64,
) -> Vec<ExplainedOverrun> {
    let us = |time_ns: u64| time_ns as f64 * 1e-3;
    let explained = |overrun: &Overrun| ExplainedOverrun {
        cycle: overrun.cycle,
        planned_ns: overrun.planned_ns,
        periods: overrun.periods,
        cause: cause(overrun, steal, period_ns),
        wakeup_lateness_us: us(overrun.times.wakeup_lateness_ns),
        compute_us: us(overrun.times.compute_ns),
        command_latency_us: us(overrun.times.command_latency_ns),
        exchange_us: us(overrun.times.exchange_ns),
        finished_after_us: us(overrun.times.finished_after_ns),
    };
    statistics.overruns().iter().map(explained).collect()
}
