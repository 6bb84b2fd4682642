//! Threads that do nothing but wake up, one a core, above every priority of ours: when one of them is late, the machine held its core,
//! whoever else was late then.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use realtime::clock::{monotonic_ns, sleep_until};
use realtime::cores::usable_cores;
use realtime::grant::{Request, apply};

/// Above the loop's 80.
const PRIORITY: u8 = 95;
const PERIOD_NS: u64 = 100_000;
/// Late by more than this is held up.
const LATE_NS: u64 = 50_000;

/// Watches all cores until it is asked.
pub struct Witness {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<Vec<(u64, u64)>>>,
}

impl Witness {
    pub fn start() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let threads = usable_cores().into_iter().map(|core| {
            let stop = Arc::clone(&stop);
            std::thread::spawn(move || watch(core, &stop))
        });
        let threads = threads.collect();
        Self { stop, threads }
    }

    /// When a core was held: planned and actual instant of each late wake-up.
    pub fn finish(self) -> Held {
        self.stop.store(true, Ordering::Relaxed);
        let logs = self.threads.into_iter().map(JoinHandle::join);
        Held(logs.flat_map(Result::unwrap_or_default).collect())
    }
}

/// Stretches in which a core was held.
pub struct Held(Vec<(u64, u64)>);

impl Held {
    /// Whether a core was held at some time between two instants.
    pub fn between(&self, from_ns: u64, to_ns: u64) -> bool {
        let mut stretches = self.0.iter();
        stretches.any(|&(begun_ns, ended_ns)| begun_ns <= to_ns && ended_ns >= from_ns)
    }
}

fn watch(core: usize, stop: &AtomicBool) -> Vec<(u64, u64)> {
    let (_grant, _held) = apply(&Request {
        fifo_priority: Some(PRIORITY),
        core: Some(core),
        lock_memory: false,
        hold_dma_latency: false,
    });
    let mut held = Vec::with_capacity(100_000);
    let mut due_ns = monotonic_ns() + PERIOD_NS;
    while !stop.load(Ordering::Relaxed) {
        sleep_until(due_ns);
        let woke_ns = monotonic_ns();
        if woke_ns > due_ns + LATE_NS {
            held.push((due_ns, woke_ns));
        }
        due_ns = (due_ns + PERIOD_NS).max(woke_ns);
    }
    held
}
