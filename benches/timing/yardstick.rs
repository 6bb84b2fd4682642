//! `cyclictest`, and the load of `stress-ng`.

use std::process::{Child, Command, Stdio};

use rt_loop::process::FIFO_PRIORITY;

use crate::histograms::{Times, empty};

pub const PERIOD_US: u64 = 667;
/// Cyclictest counts up to here; what is later is counted as its maximum.
const CYCLICTEST_MAX_US: usize = 20_000;

/// Its histogram, in steps of 1 µs; none where it is not installed.
pub fn cyclictest(core: usize, seconds: u64) -> Option<Times> {
    let mut command = Command::new("cyclictest");
    command.args(["-q", "-m", "-t", "1"]);
    command.args(["-p", &FIFO_PRIORITY.to_string(), "-a", &core.to_string()]);
    command.args(["-i", &PERIOD_US.to_string(), "-D", &seconds.to_string()]);
    command.args(["-h", &CYCLICTEST_MAX_US.to_string()]);
    let output = command.stderr(Stdio::inherit()).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut times = empty();
    let mut count_late = |late_us: u64, count: u64| {
        // Counting none would still raise the maximum.
        if count > 0 {
            times.saturating_record_n((late_us * 1000).max(1), count);
        }
    };
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let numbers: Vec<u64> = line
            .split_whitespace()
            .map_while(|word| word.parse().ok())
            .collect();
        if let [late_us, count] = numbers[..] {
            count_late(late_us, count);
        }
    }
    let overflows = number_after(&text, "# Histogram Overflows:").unwrap_or(0);
    let latest_us = number_after(&text, "# Max Latencies:").unwrap_or(0);
    count_late(latest_us, overflows);
    (!times.is_empty()).then_some(times)
}

fn number_after(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().parse().ok()
}

/// Every core at work, and memory, while it lives.
pub struct Load(Option<Child>);

impl Load {
    pub fn none() -> Self {
        Self(None)
    }

    /// None where `stress-ng` is not installed.
    pub fn start() -> Option<Self> {
        let mut command = Command::new("stress-ng");
        command.args(["--quiet", "--cpu", "0", "--vm", "1", "--vm-bytes", "64M"]);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        Some(Self(Some(command.spawn().ok()?)))
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        if let Some(load) = &mut self.0 {
            // Asked, it ends its own processes.
            realtime::process::send_signal(load.id(), libc::SIGTERM);
            let _ = load.wait();
        }
    }
}
