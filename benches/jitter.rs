//! How late the loop wakes up, beside `cyclictest` on the same core with the same priority, period and latency setting, in turn,
//! so that both share the machine's moods. One command, one table; nothing is asserted. As root: without real-time rights
//! neither side is worth comparing.
//!
//! ```sh
//! cargo bench --bench jitter               # or with -- ROUNDS SECONDS FOLDER; cyclictest is in Debian's rt-tests
//! ```
//! `FOLDER` (target/jitter) gets a `.hgrm` file for each second of the loop, and one for all, for HdrHistogram's plotters.
#![allow(missing_docs, reason = "a program, not a library")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use realtime::grant::{Request, apply, usable_cores};
use realtime::process::user_id;
use rt_loop::process::FIFO_PRIORITY;
use serde_json::Value;
use shm_types::bus::Bus;
use shm_types::instance::{Instance, core_of};
use shm_types::topics::{self, Role};

const PROGRAM: &str = env!("CARGO_BIN_EXE_flexspline");
const PERIOD_US: u64 = 667;
/// Cyclictest counts up to here; what is later is counted as its maximum.
const CYCLICTEST_MAX_US: usize = 20_000;
/// One `.hgrm` file for so much of the run.
const INTERVAL: Duration = Duration::from_secs(1);

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| word != "--bench")
        .collect();
    let number = |index: usize, default: u64| {
        words
            .get(index)
            .and_then(|word| word.parse().ok())
            .unwrap_or(default)
    };
    let (rounds, seconds) = (number(0, 3), number(1, 20));
    let folder = PathBuf::from(words.get(2).map_or("target/jitter", String::as_str));
    fs::create_dir_all(&folder).expect("a folder");
    let core = core_of(Role::Loop, &usable_cores()).unwrap_or(0);
    println!(
        "{rounds} rounds of {seconds} s each, core {core}, SCHED_FIFO {FIFO_PRIORITY}, {PERIOD_US} µs\n"
    );
    println!("| µs | round | p50 | p99 | p99.9 | max |\n|---|---|---|---|---|---|");
    let mut ratios = Vec::new();
    let mut causes: BTreeMap<String, u64> = BTreeMap::new();
    let mut loop_all = empty();
    for round in 1..=rounds {
        let yardstick = cyclictest(core, seconds);
        let (own, report) = flexspline(seconds, &folder, round);
        if let Some(yardstick) = &yardstick {
            println!("{}", row("cyclictest", round, yardstick));
            ratios.push([0.5, 0.99, 0.999].map(|quantile| {
                own.value_at_quantile(quantile) as f64
                    / yardstick.value_at_quantile(quantile) as f64
            }));
        }
        println!("{}", row("loop, late at wake-up", round, &own));
        loop_all += &own;
        for (cause, count) in report["timing"]["overrun_causes"]
            .as_object()
            .into_iter()
            .flatten()
        {
            *causes.entry(cause.clone()).or_default() += count.as_u64().unwrap_or(0);
        }
        let missed = report["timing"]["counters"]["missed_deadlines"].as_u64();
        *causes.entry("all missed deadlines".to_owned()).or_default() += missed.unwrap_or(0);
    }
    write_hgrm(&folder.join("all.hgrm"), &loop_all);
    println!(
        "\nloop over cyclictest, p50 / p99 / p99.9 of each round: {}",
        listed(&ratios)
    );
    println!(
        "missed deadlines of {} cycles by cause: {causes:?}",
        loop_all.len()
    );
    println!("{} holds the histograms", folder.display());
}

fn listed(ratios: &[[f64; 3]]) -> String {
    let rounds: Vec<String> = ratios
        .iter()
        .map(|[p50, p99, p999]| format!("{p50:.2} / {p99:.2} / {p999:.2}"))
        .collect();
    match rounds.is_empty() {
        true => "no cyclictest here: install rt-tests".to_owned(),
        false => rounds.join(", "),
    }
}

/// In nanoseconds, up to 10 s.
fn empty() -> Histogram<u64> {
    Histogram::new_with_bounds(1, 10_000_000_000, 3).expect("the bounds are in range")
}

fn row(name: &str, round: u64, histogram: &Histogram<u64>) -> String {
    let at = |quantile| histogram.value_at_quantile(quantile) as f64 * 1e-3;
    format!(
        "| {name} | {round} | {:.1} | {:.1} | {:.1} | {:.0} |",
        at(0.5),
        at(0.99),
        at(0.999),
        histogram.max() as f64 * 1e-3
    )
}

/// Its histogram, in steps of 1 µs; none where it is not installed.
fn cyclictest(core: usize, seconds: u64) -> Option<Histogram<u64>> {
    let mut command = Command::new("cyclictest");
    command.args(["-q", "-m", "-t", "1"]);
    command.args(["-p", &FIFO_PRIORITY.to_string(), "-a", &core.to_string()]);
    command.args(["-i", &PERIOD_US.to_string(), "-D", &seconds.to_string()]);
    command.args(["-h", &CYCLICTEST_MAX_US.to_string()]);
    let output = command.stderr(Stdio::inherit()).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut histogram = empty();
    let mut count_late = |late_us: u64, count: u64| {
        // Counting none would still raise the maximum.
        if count > 0 {
            histogram.saturating_record_n((late_us * 1000).max(1), count);
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
    count_late(
        number_after(&text, "# Max Latencies:").unwrap_or(0),
        overflows,
    );
    (!histogram.is_empty()).then_some(histogram)
}

fn number_after(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().parse().ok()
}

/// A run, watched from the relay: the lateness of every cycle, and its report.
fn flexspline(seconds: u64, folder: &Path, round: u64) -> (Histogram<u64>, Value) {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let name = format!("jitter-{}", std::process::id());
    let mut run = Command::new(PROGRAM);
    run.current_dir(directory.path())
        .args([
            "run",
            "--instance",
            &name,
            "--record",
            "run.mcap",
            "--json",
            "run.json",
            "--duration",
        ])
        .arg(format!("{seconds}s"))
        .stdout(Stdio::null());
    let mut run = run.spawn().expect("the program starts");
    let watched = std::thread::scope(|scope| {
        let watch = scope.spawn(|| watch(&mut run, &name, folder, round));
        watch.join().expect("the run was watched")
    });
    let text = fs::read(directory.path().join("run.json")).expect("the run wrote its report");
    let report = serde_json::from_slice(&text).expect("the report is JSON");
    (watched, report)
}

/// Hears every cycle until the run ends. Off the loop's core, as any good observer.
fn watch(run: &mut Child, name: &str, folder: &Path, round: u64) -> Histogram<u64> {
    apply(&Request {
        fifo_priority: None,
        core: usable_cores().first().copied(),
        lock_memory: false,
        hold_dma_latency: false,
    });
    std::thread::sleep(Duration::from_millis(500));
    let instance = Instance::new(name, user_id()).expect("a good name");
    let bus = Bus::join(&instance).expect("the instance is ours");
    let statuses = bus.reader(&topics::OBSERVED_STATUS).expect("a place");
    let (mut all, mut part) = (empty(), empty());
    let (mut begun, mut parts) = (Instant::now(), 0);
    while run.try_wait().expect("our own process").is_none() {
        while let Some(status) = statuses.take() {
            part.saturating_record(status.wakeup_lateness_ns.max(1));
        }
        if begun.elapsed() >= INTERVAL && !part.is_empty() {
            parts += 1;
            write_hgrm(&folder.join(format!("round{round}-{parts:03}.hgrm")), &part);
            all += &part;
            part.reset();
            begun = Instant::now();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    all += &part;
    all
}

/// HdrHistogram's table of percentiles, in microseconds.
fn write_hgrm(path: &Path, histogram: &Histogram<u64>) {
    let mut text = String::from("       Value     Percentile TotalCount 1/(1-Percentile)\n\n");
    for step in histogram.iter_quantiles(5) {
        let quantile = step.quantile_iterated_to();
        let count = histogram.count_between(0, step.value_iterated_to());
        let value_us = step.value_iterated_to() as f64 * 1e-3;
        text += &match quantile < 1.0 {
            true => format!(
                "{value_us:12.3} {quantile:2.12} {count:10} {:14.2}\n",
                1.0 / (1.0 - quantile)
            ),
            false => format!("{value_us:12.3} {quantile:2.12} {count:10}            inf\n"),
        };
    }
    text += &format!(
        "#[Mean    = {:12.3}, StdDeviation   = {:12.3}]\n#[Max     = {:12.3}, Total count    = {:12}]\n",
        histogram.mean() * 1e-3,
        histogram.stdev() * 1e-3,
        histogram.max() as f64 * 1e-3,
        histogram.len()
    );
    fs::write(path, text).expect("the folder is ours");
}
