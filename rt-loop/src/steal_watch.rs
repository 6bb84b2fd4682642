//! Reads the time that the hypervisor takes, beside the loop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use realtime::clock::monotonic_ns;
use realtime::cores::KeptOff;
use realtime::usage::stolen_ns;

/// How often the time stolen by the hypervisor is read.
const STEAL_POLL: std::time::Duration = std::time::Duration::from_millis(10);

/// Reads the stolen time beside the loop, on an ordinary thread. Of all cores: what is taken from a service or the
/// emulator makes the loop late just as well.
#[derive(Debug)]
pub struct StealWatch {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Vec<(u64, u64)>>,
}

impl StealWatch {
    /// To be started before the caller becomes a real-time thread, whose scheduling its children inherit. It stays off the
    /// loop's core: reading `/proc/stat` takes the kernel longer than a wake-up may be late.
    pub fn start(loop_core: Option<usize>, cores: &[usize]) -> Self {
        let cores = cores.to_vec();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let _kept_off = loop_core.and_then(|core| KeptOff::core(core, &cores));
            let mut log: Vec<(u64, u64)> = Vec::new();
            while !stopped.load(Ordering::Relaxed) {
                let stolen = std::fs::read_to_string("/proc/stat")
                    .ok()
                    .and_then(|text| stolen_ns(&text));
                if let Some(stolen) = stolen
                    && log.last().is_none_or(|&(_, before)| before != stolen)
                {
                    log.push((monotonic_ns(), stolen));
                }
                std::thread::sleep(STEAL_POLL);
            }
            log
        });
        Self { stop, thread }
    }

    /// Ends the reading: when, and how much had been stolen by then.
    pub fn finish(self) -> Vec<(u64, u64)> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap_or_default()
    }
}
