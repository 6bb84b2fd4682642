//! A run of the program, watched from its relay.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use realtime::cores::{stay_on, usable_cores};
use realtime::process::user_id;
use serde_json::Value;
use shm_types::bus::Bus;
use shm_types::instance::{Instance, core_of};
use shm_types::topics::{self, Role};

use crate::histograms::{Times, empty, write_hgrm};

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_flexspline");
/// One `.hgrm` file for so much of the run.
const INTERVAL: Duration = Duration::from_secs(1);

/// What a run came to.
pub struct Run {
    /// Late at wake-up, every cycle that was heard of; empty if nobody watched.
    pub lateness: Times,
    /// `run --json`.
    pub report: Value,
    /// What it recorded for each joint and in all, signals.
    pub signals: usize,
}

impl Run {
    /// Quantiles of a time in the report, in microseconds.
    pub fn quantiles_us(&self, time: &str) -> [f64; 3] {
        ["p50_us", "p99_us", "p999_us"].map(|name| {
            self.report["timing"][time][name]
                .as_f64()
                .unwrap_or(f64::NAN)
        })
    }

    pub fn max_us(&self, time: &str) -> f64 {
        self.report["timing"][time]["max_us"]
            .as_f64()
            .unwrap_or(f64::NAN)
    }

    pub fn counter(&self, name: &str) -> u64 {
        self.report["timing"]["counters"][name]
            .as_u64()
            .unwrap_or(0)
    }
}

/// Runs for `seconds` with more arguments. `log` is folder and name of the `.hgrm` files; without it nobody watches.
pub fn flexspline(arguments: &[&str], seconds: u64, log: Option<(&Path, &str)>) -> Run {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let instance = instance_name();
    let mut command = Command::new(PROGRAM);
    command
        .current_dir(directory.path())
        .args(["run", "--instance", &instance, "--record", "run.mcap"])
        .args(["--json", "run.json", "--duration", &format!("{seconds}s")])
        .args(arguments)
        .stdout(Stdio::null());
    let mut child = command.spawn().expect("the program starts");
    let lateness = match log {
        None => empty(),
        // A thread of its own, because it stays on a core.
        Some((folder, name)) => std::thread::scope(|scope| {
            let watching = scope.spawn(|| watch(&mut child, &instance, folder, name));
            watching.join().expect("the run was watched")
        }),
    };
    child.wait().expect("our own process");
    let text = std::fs::read(directory.path().join("run.json")).unwrap_or_default();
    let recorded = recording::read(&directory.path().join("run.mcap"));
    let signals = recorded.map_or(0, |recorded| {
        recorded
            .joints
            .iter()
            .map(|joint| joint.signals.len())
            .sum()
    });
    Run {
        lateness,
        report: serde_json::from_slice(&text).unwrap_or(Value::Null),
        signals,
    }
}

/// The instance of the runs of this program.
pub fn instance_name() -> String {
    format!("timing-{}", std::process::id())
}

/// Keeps the calling thread off `core`.
pub fn stay_off(core: usize) {
    let others: Vec<usize> = usable_cores()
        .into_iter()
        .filter(|&other| other != core)
        .collect();
    // On one core there is no other.
    let _ = stay_on(&others);
}

/// Hears every cycle until the run ends. Off the loop's core, as any good observer.
fn watch(run: &mut Child, name: &str, folder: &Path, log: &str) -> Times {
    std::thread::sleep(Duration::from_millis(700));
    let instance = Instance::new(name, user_id()).expect("a good name");
    if let Ok(config) = instance.run_config()
        && let Some(core) = core_of(Role::Loop, &config.cores)
    {
        stay_off(core);
    }
    let (mut all, mut part) = (empty(), empty());
    let Ok(bus) = Bus::join(&instance) else {
        return all;
    };
    let statuses = bus.reader(&topics::OBSERVED_STATUS).expect("a place");
    let (mut begun, mut parts) = (Instant::now(), 0);
    while run.try_wait().expect("our own process").is_none() {
        while let Some(status) = statuses.take() {
            part.saturating_record(status.wakeup_lateness_ns.max(1));
        }
        if begun.elapsed() >= INTERVAL && !part.is_empty() {
            parts += 1;
            write_hgrm(&folder.join(format!("{log}-{parts:03}.hgrm")), &part);
            all += &part;
            part.reset();
            begun = Instant::now();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    all += &part;
    all
}
