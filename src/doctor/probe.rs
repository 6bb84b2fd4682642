//! The jitter probe: a thread treated as the loop's own is, that only wakes up and looks at the clock.

use std::time::Duration;

use hdrhistogram::Histogram;
use realtime::clock::{monotonic_ns, sleep_until};
use realtime::grant::{Grant, apply};
use rt_loop::process::treatment;
use rt_loop::report::Quantiles;
use serde::Serialize;

use super::finding::{Finding, Rule, Verdict};

/// What the probe saw.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Probe {
    /// What the thread was granted, read back.
    pub grant: Grant,
    /// Between two planned wake-ups.
    pub period_ns: u64,
    /// Late by this much against the planned instant.
    pub wakeup_lateness: Quantiles,
}

/// Wakes up every `period_ns` for as long as `duration`, on a thread that asks for what the loop's asks for.
///
/// # Errors
/// The system's, if no thread can be started.
pub fn probe(duration: Duration, period_ns: u64, core: Option<usize>) -> std::io::Result<Probe> {
    let wakeups = duration.as_nanos() as u64 / period_ns;
    let thread = std::thread::Builder::new().spawn(move || {
        let mut lateness_ns = empty_histogram();
        let (grant, _held) = apply(&treatment(core));
        let mut due_ns = monotonic_ns() + period_ns;
        for _ in 0..wakeups {
            sleep_until(due_ns);
            let late_ns = monotonic_ns().saturating_sub(due_ns);
            lateness_ns.saturating_record(late_ns.max(1));
            // Like the loop: periods slept through are skipped, and the phase is kept.
            due_ns += period_ns * (1 + late_ns / period_ns);
        }
        (grant, lateness_ns)
    })?;
    let (grant, lateness_ns) = thread
        .join()
        .map_err(|_| std::io::Error::other("the probe's thread ended early"))?;
    Ok(Probe {
        grant,
        period_ns,
        wakeup_lateness: Quantiles::of(&lateness_ns),
    })
}

/// Up to 10 s, three digits, as the loop's own.
fn empty_histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, 10_000_000_000, 3).expect("the bounds are constants in range")
}

const GRANTED: Rule = Rule {
    about: "granted to the loop's thread",
    wanted: "everything it asks for",
    mend: "mend what is missing above",
    cost: "see above; every run says it again in its report",
};

/// What the kernel really gave.
pub fn granted(grant: &Grant) -> Finding {
    let refused = match grant.refused.as_slice() {
        [] => String::new(),
        refused => format!("; refused: {}", refused.join("; ")),
    };
    GRANTED.finds_good_if(
        grant.refused.is_empty(),
        Verdict::Missing,
        format!("{grant}{refused}"),
    )
}

const JITTER: Rule = Rule {
    about: "wake-up",
    wanted: "99.9 % less late than a quarter of the period",
    mend: "mend the lines above; then see which interrupts (/proc/interrupts) and processes (ps -eLo psr,rtprio,comm) \
           share the loop's core",
    cost: "a cycle that begins late has less time for its command: missed deadlines, and in the end a safe stop",
};

/// Part of the period by which a wake-up may be late: the loop blames missed deadlines on more.
const LATE_PARTS: f64 = 4.0;

/// How late the thread woke.
pub fn jitter(probe: &Probe) -> Finding {
    let lateness = &probe.wakeup_lateness;
    let allowed_us = probe.period_ns as f64 * 1e-3 / LATE_PARTS;
    let verdict = if lateness.p99_us > allowed_us {
        Verdict::Missing
    } else if lateness.p999_us > allowed_us {
        Verdict::Weak
    } else {
        Verdict::Good
    };
    JITTER.finds(
        verdict,
        format!(
            "late by {:.0} µs in the median, {:.0} µs at 99 %, {:.0} µs at 99.9 %, {:.0} µs at most, of {} wake-ups",
            lateness.p50_us, lateness.p99_us, lateness.p999_us, lateness.max_us, lateness.count
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn probe_of(p99_us: f64, p999_us: f64) -> Probe {
        Probe {
            grant: Grant {
                fifo_priority: None,
                core: Some(1),
                memory_locked: false,
                dma_latency_held: false,
                refused: vec!["SCHED_FIFO priority 80: not permitted".to_owned()],
            },
            period_ns: 666_667,
            wakeup_lateness: Quantiles {
                count: 3000,
                p50_us: 10.0,
                p99_us,
                p999_us,
                max_us: 5000.0,
            },
        }
    }

    #[test]
    fn the_largest_delay_alone_is_no_reason() {
        assert_eq!(jitter(&probe_of(30.0, 100.0)).verdict, Verdict::Good);
        assert_eq!(jitter(&probe_of(30.0, 200.0)).verdict, Verdict::Weak);
        assert_eq!(jitter(&probe_of(170.0, 200.0)).verdict, Verdict::Missing);
    }

    #[test]
    fn what_was_refused_is_said_with_the_kernels_reason() {
        let found = granted(&probe_of(1.0, 1.0).grant);
        assert_eq!(found.verdict, Verdict::Missing);
        assert_eq!(
            found.is,
            "ordinary scheduler, core 1, memory not locked, deep sleep possible; \
             refused: SCHED_FIFO priority 80: not permitted"
        );
    }

    #[test]
    fn every_planned_wake_up_is_counted() {
        let probe = probe(Duration::from_millis(20), 1_000_000, None).expect("a thread");
        assert_eq!(probe.wakeup_lateness.count, 20);
    }
}
