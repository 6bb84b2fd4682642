//! Faults of processes and of the machine they run on, in real time.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use libc::{SIGCONT, SIGKILL, SIGSTOP};
use realtime::process::{send_signal, user_id};
use serde::Serialize;
use serde_json::Value;
use shm_types::topics::Role;

use super::subject::{End, Setting, Subject, Target};
use crate::cli::FaultsArguments;
use crate::drivers;
use crate::error::CliError;

/// Before anything is done to a run.
const SETTLE: Duration = Duration::from_millis(1200);
/// A run in which a fault is survived.
const RUN: Duration = Duration::from_secs(6);
/// A run that has to be ended by its fault.
const LONG_RUN: Duration = Duration::from_secs(40);

/// How a run has to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// It goes on to its planned end.
    GoesOn,
    /// It goes on, and says that its recording is not complete.
    GoesOnUnrecorded,
    /// The loop stops for safety; exit code 1.
    SafeStop,
    /// A process it cannot go on without is lost; exit code 1.
    Lost,
    /// It does not start; one line says why.
    Refused,
    /// Its supervisor is dead; everything else ends too.
    Gone,
}

/// What one fault came to.
#[derive(Debug, Serialize)]
pub struct ProcessOutcome {
    /// Its name.
    pub fault: &'static str,
    /// How it has to end.
    pub documented: Ending,
    /// Why it was not tried here.
    pub skipped: Option<String>,
    /// Whether it ended that way and left nothing behind.
    pub as_documented: bool,
    /// Exit code.
    pub exit_code: Option<i32>,
    /// The loop's last state.
    pub end_state: Option<String>,
    /// The longest time without a command, in cycles.
    pub command_gap_cycles: Option<u64>,
    /// From being started again to the first sign of life, the last one started.
    pub back_after_ms: Option<f64>,
    /// Furthest the tool was from its path.
    pub tool_off_path_mm: Option<f64>,
    /// Rows missing in the recording.
    pub lost_rows: Option<u64>,
    /// What the run said.
    pub said: String,
    /// What was still there afterwards.
    pub left_behind: Vec<String>,
}

struct ProcessFault {
    name: &'static str,
    ending: Ending,
    /// Part of the short form.
    short: bool,
    /// Why it cannot be tried here; none if it can.
    obstacle: fn(Target<'_>) -> Option<String>,
    start: fn(Target<'_>) -> Result<Subject, CliError>,
    act: fn(&mut Subject),
}

/// Tries every fault, or the few of the short form.
///
/// # Errors
/// [`CliError::Input`] if a run cannot be started.
pub fn run(arguments: &FaultsArguments) -> Result<Vec<ProcessOutcome>, CliError> {
    all()
        .iter()
        .filter(|fault| fault.short || !arguments.short)
        .map(|fault| fault.run(Target::of(arguments)))
        .collect()
}

fn all() -> Vec<ProcessFault> {
    use Ending::{GoesOn, GoesOnUnrecorded, Gone, Lost, Refused, SafeStop};
    let fault = |name, ending, act| ProcessFault {
        name,
        ending,
        short: false,
        obstacle: |_| None,
        start: |target| Subject::start(target, RUN),
        act,
    };
    let long = |fault| ProcessFault {
        start: |target| Subject::start(target, LONG_RUN),
        ..fault
    };
    let emulated = |fault| ProcessFault {
        obstacle: needs_emulator,
        ..fault
    };
    let short = |fault| ProcessFault {
        short: true,
        ..fault
    };
    vec![
        short(fault("feedforward killed", GoesOn, |run| {
            signal(run, Role::Feedforward, SIGKILL)
        })),
        fault("estimator killed", GoesOn, |run| {
            signal(run, Role::Estimator, SIGKILL)
        }),
        fault("recorder killed", GoesOn, |run| {
            signal(run, Role::Relay, SIGKILL)
        }),
        fault(
            "feedforward killed again while it starts",
            GoesOn,
            kill_while_starting,
        ),
        fault("feedforward stopped (SIGSTOP)", GoesOn, |run| {
            signal(run, Role::Feedforward, SIGSTOP)
        }),
        fault("estimator stopped (SIGSTOP)", GoesOn, |run| {
            signal(run, Role::Estimator, SIGSTOP)
        }),
        fault("feedforward frozen for 300 ms", GoesOn, |run| {
            freeze(run, Role::Feedforward, 300)
        }),
        short(emulated(fault(
            "emulator frozen for 300 ms",
            GoesOn,
            |run| freeze(run, Role::Emulator, 300),
        ))),
        fault(
            "recorder frozen for 1 s, as by a slow disk",
            GoesOn,
            |run| freeze(run, Role::Relay, 1000),
        ),
        short(emulated(long(fault("emulator killed", Lost, |run| {
            signal(run, Role::Emulator, SIGKILL)
        })))),
        emulated(long(fault("emulator stopped (SIGSTOP)", Lost, |run| {
            signal(run, Role::Emulator, SIGSTOP)
        }))),
        long(fault("loop killed", Lost, |run| {
            signal(run, Role::Loop, SIGKILL)
        })),
        short(ProcessFault {
            start: |target| start(target, Some("/dev/full"), &[]),
            ..fault("disk full from the start", Refused, |_| ())
        }),
        ProcessFault {
            obstacle: needs_root,
            start: |target| start(target, Some("/mnt/run.mcap"), &SMALL_DISK),
            ..fault("disk full during the run", GoesOnUnrecorded, |_| ())
        },
        short(fault(
            "supervisor frozen for 3 s",
            SafeStop,
            freeze_supervisor,
        )),
        short(long(fault("supervisor killed", Gone, |run| {
            run.signal(SIGKILL)
        }))),
        ProcessFault {
            obstacle: needs_root,
            start: |target| start(target, None, &FULL_SHARED_MEMORY),
            ..fault("shared memory full", Refused, |_| ())
        },
        ProcessFault {
            obstacle: needs_root,
            ..fault("wall clock stepped by 2 s, and back", GoesOn, step_clock)
        },
    ]
}

fn start(target: Target<'_>, record: Option<&str>, wrapper: &[&str]) -> Result<Subject, CliError> {
    let setting = Setting {
        record: record.map(Path::new),
        wrapper,
        lockstep: false,
    };
    Subject::start_with(target, RUN, &setting)
}

/// Runs what follows with 1 MiB of shared memory, seen by it alone.
const FULL_SHARED_MEMORY: [&str; 6] = [
    "unshare",
    "--mount",
    "sh",
    "-c",
    "mount -t tmpfs -o size=1m tmpfs /dev/shm && exec \"$@\"",
    "sh",
];

/// Runs what follows with a disk of 1 MiB at `/mnt`, seen by it alone.
const SMALL_DISK: [&str; 6] = [
    "unshare",
    "--mount",
    "sh",
    "-c",
    "mount -t tmpfs -o size=1m tmpfs /mnt && exec \"$@\"",
    "sh",
];

fn needs_root(_: Target<'_>) -> Option<String> {
    (user_id() != 0).then(|| "needs root".to_owned())
}

fn needs_emulator(target: Target<'_>) -> Option<String> {
    let reason = || "needs the emulator".to_owned();
    (!drivers::is_emulated(target.driver)).then(reason)
}

fn signal(run: &mut Subject, role: Role, signal: i32) {
    if let Some(process_id) = run.process(role) {
        send_signal(process_id, signal);
    }
}

fn freeze(run: &mut Subject, role: Role, milliseconds: u64) {
    signal(run, role, SIGSTOP);
    std::thread::sleep(Duration::from_millis(milliseconds));
    signal(run, role, SIGCONT);
}

fn freeze_supervisor(run: &mut Subject) {
    run.signal(SIGSTOP);
    std::thread::sleep(Duration::from_secs(3));
    run.signal(SIGCONT);
}

fn kill_while_starting(run: &mut Subject) {
    let mut before = run.process(Role::Feedforward);
    for _ in 0..3 {
        signal(run, Role::Feedforward, SIGKILL);
        before = run.await_process(Role::Feedforward, before);
    }
}

fn step_clock(_: &mut Subject) {
    for step_s in [2.0, -2.0] {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let target_s = now.map_or(0.0, |now| now.as_secs_f64()) + step_s;
        // What it says about the new time is of no interest.
        let _ = Command::new("date")
            .arg("-s")
            .arg(format!("@{target_s:.3}"))
            .output();
        std::thread::sleep(Duration::from_millis(500));
    }
}

impl ProcessFault {
    fn run(&self, target: Target<'_>) -> Result<ProcessOutcome, CliError> {
        if let Some(obstacle) = (self.obstacle)(target) {
            eprintln!("flexspline: {} is skipped: {obstacle}", self.name);
            return Ok(ProcessOutcome::skipped(self, obstacle));
        }
        let mut subject = (self.start)(target)?;
        if subject.await_process(Role::Loop, None).is_some() {
            std::thread::sleep(SETTLE);
            (self.act)(&mut subject);
        }
        Ok(ProcessOutcome::of(self, subject.finish(LONG_RUN)))
    }
}

impl ProcessOutcome {
    fn of(fault: &ProcessFault, end: End) -> Self {
        let report = &end.report;
        let restarts = report["restarts"].as_array();
        let mut outcome = Self {
            fault: fault.name,
            documented: fault.ending,
            skipped: None,
            as_documented: false,
            exit_code: end.exit_code,
            end_state: text(&report["timing"]["final_state"]),
            command_gap_cycles: report["timing"]["counters"]["longest_command_gap_cycles"].as_u64(),
            back_after_ms: restarts
                .and_then(|restarts| restarts.last())
                .and_then(|restart| restart["back_after_ms"].as_f64()),
            tool_off_path_mm: report["tracking"]["end_effector_error_m"]["max"]
                .as_f64()
                .map(|metres| metres * 1e3),
            lost_rows: report["tracking"]["lost_rows"].as_u64(),
            said: end.said.lines().last().unwrap_or_default().to_owned(),
            left_behind: end.left_behind,
        };
        outcome.as_documented = outcome.left_behind.is_empty() && outcome.ended_as(fault.ending);
        outcome
    }

    fn skipped(fault: &ProcessFault, obstacle: String) -> Self {
        let nothing = End {
            exit_code: None,
            said: String::new(),
            report: Value::Null,
            left_behind: Vec::new(),
        };
        Self {
            skipped: Some(obstacle),
            ..Self::of(fault, nothing)
        }
    }

    fn ended_as(&self, ending: Ending) -> bool {
        let state = self.end_state.as_deref().unwrap_or_default();
        let stopped = ["SafeStop", "Faulted"].contains(&state);
        let one_line = !self.said.is_empty();
        match ending {
            Ending::GoesOn => self.exit_code == Some(0) && !stopped,
            Ending::GoesOnUnrecorded => self.exit_code == Some(1) && !stopped && one_line,
            Ending::SafeStop => self.exit_code == Some(1) && state == "SafeStop" && one_line,
            Ending::Lost => self.exit_code == Some(1) && one_line,
            Ending::Refused => matches!(self.exit_code, Some(1 | 2)) && one_line,
            Ending::Gone => self.exit_code.is_none(),
        }
    }
}

fn text(value: &Value) -> Option<String> {
    value.as_str().map(str::to_owned)
}
