//! What the kernel counts about this thread and this machine.

/// Counters of the calling thread since it started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ThreadUsage {
    /// Page faults, served from memory or from disk.
    pub page_faults: u64,
    /// Context switches the thread did not ask for.
    pub involuntary_switches: u64,
}

/// Reads the calling thread's counters: one system call, no file.
pub fn thread_usage() -> ThreadUsage {
    // SAFETY: an all-zero rusage is a valid value of this plain C struct.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: `usage` is valid for writing; RUSAGE_THREAD is a valid selector, so the call cannot fail.
    unsafe { libc::getrusage(libc::RUSAGE_THREAD, &mut usage) };
    ThreadUsage {
        page_faults: (usage.ru_minflt + usage.ru_majflt) as u64,
        involuntary_switches: usage.ru_nivcsw as u64,
    }
}

/// Time the hypervisor took from all cores together, from the text of `/proc/stat`, in nanoseconds since boot.
///
/// The kernel counts in ticks of 10 ms, so a shorter theft may show only later. `None` if the text is another.
pub fn stolen_ns(proc_stat: &str) -> Option<u64> {
    let line = proc_stat.lines().find(|line| line.starts_with("cpu "))?;
    let ticks: u64 = line.split_whitespace().nth(8)?.parse().ok()?;
    Some(ticks * 10_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steal_is_the_eighth_counter_of_all_cores() {
        let text =
            "cpu  1 2 3 4 5 6 7 80 9 10\ncpu0 1 2 3 4 5 6 7 8 9 10\ncpu1 1 2 3 4 5 6 7 72 0 0\n";
        assert_eq!(stolen_ns(text), Some(800_000_000));
        assert_eq!(stolen_ns("intr 5"), None);
    }
}
