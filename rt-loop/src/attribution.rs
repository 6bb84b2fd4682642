//! Why a cycle did not keep its time, as far as the kernel tells. Runs after the run.

use serde::{Deserialize, Serialize};

use crate::statistics::Overrun;

/// The main cause of an overrun.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The hypervisor took a core around that time.
    Stolen,
    /// The loop's thread touched memory that was not there.
    PageFault,
    /// The loop woke late.
    LateWakeup,
    /// The drives' sample came late or not at all.
    Drive,
    /// The command came late or not at all.
    Service,
    /// The loop's own work took too long.
    OwnCompute,
    /// None of these: what was taken is spread over the cycle, or went where no clock was read.
    Unexplained,
}

impl Cause {
    /// For a table.
    pub fn label(self) -> &'static str {
        match self {
            Self::Stolen => "stolen by the hypervisor",
            Self::PageFault => "page fault",
            Self::LateWakeup => "late wake-up",
            Self::Drive => "drive",
            Self::Service => "service",
            Self::OwnCompute => "own compute",
            Self::Unexplained => "unexplained",
        }
    }
}

/// Time stolen from all cores, read now and then: `(monotonic_ns, stolen_ns since boot)`, rising.
pub type StealLog = [(u64, u64)];

/// The kernel counts stolen time in ticks of 10 ms: a theft may show one tick later, or be counted with others.
const STEAL_WINDOW_NS: u64 = 20_000_000;
/// Part of the period that a cause must have taken to be blamed.
const BLAME_PARTS: u64 = 4;

/// The main cause of `overrun`: the first that fits, from outside the process inwards.
pub fn cause(overrun: &Overrun, steal: &StealLog, period_ns: u64) -> Cause {
    let times = &overrun.times;
    let blame_ns = period_ns / BLAME_PARTS;
    let end_ns = overrun.planned_ns + times.finished_after_ns;
    if stolen_between(
        steal,
        overrun.planned_ns.saturating_sub(STEAL_WINDOW_NS),
        end_ns + STEAL_WINDOW_NS,
    ) > 0
    {
        Cause::Stolen
    } else if overrun.page_faults > 0 {
        Cause::PageFault
    } else if times.wakeup_lateness_ns > blame_ns {
        Cause::LateWakeup
    } else if !overrun.sample_came || times.exchange_ns > blame_ns {
        Cause::Drive
    } else if !overrun.command_came || times.command_latency_ns > blame_ns {
        Cause::Service
    } else if times.compute_ns > blame_ns {
        Cause::OwnCompute
    } else {
        Cause::Unexplained
    }
}

fn stolen_between(steal: &StealLog, from_ns: u64, to_ns: u64) -> u64 {
    let at = |instant_ns: u64| {
        let index = steal.partition_point(|&(time_ns, _)| time_ns <= instant_ns);
        steal
            .get(index.saturating_sub(1))
            .map_or(0, |&(_, stolen_ns)| stolen_ns)
    };
    at(to_ns).saturating_sub(at(from_ns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::CycleTimes;

    const PERIOD_NS: u64 = 666_667;

    fn overrun(times: CycleTimes) -> Overrun {
        Overrun {
            cycle: 1,
            planned_ns: 1_000_000_000,
            times,
            command_came: true,
            sample_came: true,
            ..Overrun::default()
        }
    }

    #[test]
    fn each_cause_is_found_where_it_is_the_only_one() {
        let late = overrun(CycleTimes {
            wakeup_lateness_ns: 500_000,
            ..CycleTimes::default()
        });
        assert_eq!(cause(&late, &[], PERIOD_NS), Cause::LateWakeup);
        let faulted = Overrun {
            page_faults: 1,
            ..late
        };
        assert_eq!(cause(&faulted, &[], PERIOD_NS), Cause::PageFault);
        let no_command = Overrun {
            command_came: false,
            ..overrun(CycleTimes::default())
        };
        assert_eq!(cause(&no_command, &[], PERIOD_NS), Cause::Service);
        let no_sample = Overrun {
            sample_came: false,
            ..no_command
        };
        assert_eq!(cause(&no_sample, &[], PERIOD_NS), Cause::Drive);
        let slow = overrun(CycleTimes {
            compute_ns: 700_000,
            ..CycleTimes::default()
        });
        assert_eq!(cause(&slow, &[], PERIOD_NS), Cause::OwnCompute);
        let little_of_each = overrun(CycleTimes {
            wakeup_lateness_ns: 160_000,
            exchange_ns: 160_000,
            command_latency_ns: 160_000,
            compute_ns: 160_000,
            ..CycleTimes::default()
        });
        assert_eq!(cause(&little_of_each, &[], PERIOD_NS), Cause::Unexplained);
    }

    #[test]
    fn theft_counts_only_near_the_overrun() {
        let late = overrun(CycleTimes {
            wakeup_lateness_ns: 500_000,
            ..CycleTimes::default()
        });
        let near = [(900_000_000, 0), (1_010_000_000, 10_000_000)];
        let far = [
            (100_000_000, 0),
            (110_000_000, 10_000_000),
            (2_000_000_000, 20_000_000),
        ];
        assert_eq!(cause(&late, &near, PERIOD_NS), Cause::Stolen);
        assert_eq!(cause(&late, &far, PERIOD_NS), Cause::LateWakeup);
    }
}
