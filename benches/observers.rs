//! What observers cost the loop: the same run with nobody looking on, and with all that may happen at its relay. One command,
//! one table, all cases in turn so that they share the machine's moods. Nothing is asserted: it reports.
//!
//! ```sh
//! cargo bench --bench observers            # or with -- ROUNDS SECONDS
//! ```
#![allow(missing_docs, reason = "a program, not a library")]

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use realtime::cores::usable_cores;
use realtime::grant::{Request, apply};
use realtime::process::user_id;
use serde_json::Value;
use shm_types::bus::Bus;
use shm_types::instance::Instance;
use shm_types::topics;

const PROGRAM: &str = env!("CARGO_BIN_EXE_flexspline");
/// Told to a copy of this program that plays a reader.
const READER: &str = "--reader-of";

/// What happens beside the loop.
#[derive(Clone, Copy)]
enum Case {
    Nobody,
    Starts,
    Monitors,
    NeverRead,
    Crash,
}

const CASES: [(Case, &str); 5] = [
    (Case::Nobody, "nobody"),
    (Case::Starts, "100 processes that do nothing"),
    (Case::Monitors, "100 monitors join and leave"),
    (Case::NeverRead, "7 readers that never read"),
    (Case::Crash, "100 readers killed"),
];

/// Attachments in a run.
const ATTACHMENTS: u32 = 100;
/// Readers a topic has room for beside the supervisor's.
const READERS: usize = topics::OBSERVED_STATUS.readers_max - 1;

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| word != "--bench")
        .collect();
    if let [flag, name] = words.as_slice()
        && flag == READER
    {
        return never_read(name);
    }
    let number = |index: usize, default: u64| {
        words
            .get(index)
            .and_then(|word| word.parse().ok())
            .unwrap_or(default)
    };
    let (rounds, seconds) = (number(0, 3), number(1, 20));
    println!(
        "{rounds} rounds of {seconds} s each, every case once a round; µs: median of the rounds' quantiles, largest maximum"
    );
    let mut results = CASES.map(|_| Vec::new());
    for _ in 0..rounds {
        for ((case, _), results) in CASES.iter().zip(&mut results) {
            results.push(run_beside(*case, seconds));
        }
    }
    println!(
        "| beside the loop | late at wake-up p50 | p99 | p99.9 | max | own compute p50 | p99 | p99.9 | missed deadlines |\n\
         |---|---|---|---|---|---|---|---|---|"
    );
    for ((_, name), results) in CASES.iter().zip(&results) {
        println!("{}", row(name, results));
    }
}

fn row(name: &str, reports: &[Value]) -> String {
    let all = |time: &str, quantile: &str| -> Vec<f64> {
        let values = reports
            .iter()
            .filter_map(|report| report["timing"][time][quantile].as_f64());
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let median = |time, quantile| {
        all(time, quantile)
            .get(reports.len() / 2)
            .copied()
            .unwrap_or(f64::NAN)
    };
    let max = all("wakeup_lateness", "max_us")
        .last()
        .copied()
        .unwrap_or(f64::NAN);
    let missed: Vec<String> = reports
        .iter()
        .map(|report| report["timing"]["counters"]["missed_deadlines"].to_string())
        .collect();
    format!(
        "| {name} | {:.1} | {:.1} | {:.1} | {max:.0} | {:.1} | {:.1} | {:.1} | {} |",
        median("wakeup_lateness", "p50_us"),
        median("wakeup_lateness", "p99_us"),
        median("wakeup_lateness", "p999_us"),
        median("compute", "p50_us"),
        median("compute", "p99_us"),
        median("compute", "p999_us"),
        missed.join(" / ")
    )
}

/// One run with `case` beside it: what it reported.
fn run_beside(case: Case, seconds: u64) -> Value {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let name = format!("bench-{}", std::process::id());
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
    let beside = std::thread::spawn(move || disturb(case, &name, Duration::from_secs(seconds)));
    let ended = run.wait().expect("the run ends");
    beside.join().expect("the disturbance ends");
    assert!(ended.success(), "the run ended badly: {ended}");
    let text = std::fs::read(directory.path().join("run.json")).expect("the run wrote its report");
    serde_json::from_slice(&text).expect("the report is JSON")
}

/// Looks on, in one way or another, from the second second of the run to its last but one. Like the monitor, off the loop's
/// core: what is started from here inherits that.
fn disturb(case: Case, name: &str, run_time: Duration) {
    apply(&Request {
        fifo_priority: None,
        core: usable_cores().first().copied(),
        lock_memory: false,
        hold_dma_latency: false,
    });
    let begun = Instant::now();
    std::thread::sleep(Duration::from_secs(2));
    let end = begun + run_time.saturating_sub(Duration::from_secs(2));
    let pause = (end - Instant::now()) / ATTACHMENTS;
    match case {
        Case::Nobody => (),
        Case::NeverRead => {
            let mut readers: Vec<Child> = (0..READERS).map(|_| start_reader(name)).collect();
            std::thread::sleep(end - Instant::now());
            readers.iter_mut().for_each(kill);
        }
        Case::Starts => again_and_again(pause, || wait_for(Command::new(PROGRAM).arg("--version"))),
        Case::Monitors => again_and_again(pause, || {
            wait_for(Command::new(PROGRAM).args([
                "monitor",
                "--once",
                "--listen",
                "20ms",
                "--instance",
                name,
            ]))
        }),
        Case::Crash => again_and_again(pause, || {
            let mut reader = start_reader(name);
            std::thread::sleep(Duration::from_millis(60));
            kill(&mut reader);
        }),
    }
}

fn again_and_again(pause: Duration, mut act: impl FnMut()) {
    let begun = Instant::now();
    for count in 1..=ATTACHMENTS {
        act();
        std::thread::sleep((begun + pause * count).saturating_duration_since(Instant::now()));
    }
}

fn wait_for(command: &mut Command) {
    let ended = command
        .stdout(Stdio::null())
        .status()
        .expect("the program starts");
    assert!(ended.success(), "{command:?}: {ended}");
}

fn start_reader(name: &str) -> Child {
    let this = std::env::current_exe().expect("this program");
    let mut reader = Command::new(this);
    reader
        .args([READER, name])
        .spawn()
        .expect("this program starts")
}

fn kill(reader: &mut Child) {
    reader.kill().expect("it is ours");
    reader.wait().expect("it was killed");
}

/// Takes a place on every topic of the relay and looks at none.
fn never_read(name: &str) {
    let instance = Instance::new(name, user_id()).expect("a good name");
    let bus = Bus::join(&instance).expect("the instance is ours");
    let _places = (
        bus.reader(&topics::OBSERVED_STATUS).expect("a place"),
        bus.reader(&topics::OBSERVED_SAMPLE).expect("a place"),
        bus.reader(&topics::OBSERVED_ESTIMATE).expect("a place"),
    );
    std::thread::sleep(Duration::from_secs(3600));
}
