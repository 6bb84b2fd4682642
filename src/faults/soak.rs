//! A long run in lockstep: whether memory, open files and counters stand still.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use libc::SIGINT;
use serde::Serialize;
use shm_types::bus::Bus;
use shm_types::topics::{self, Role};

use super::show;
use super::subject::{Setting, Subject, Target};
use crate::cli::FaultsArguments;
use crate::error::CliError;
use crate::run::{PERIOD_NS, stop_on_signals};

/// The soak of the full suite, in virtual time.
const FULL: Duration = Duration::from_secs(24 * 3600);
/// The soak of its short form.
const SHORT: Duration = Duration::from_secs(20);
/// Looks at the processes, spread evenly over the soak.
const CHECKPOINTS: u64 = 24;
/// How long a run that was asked to end may take.
const END: Duration = Duration::from_secs(20);
/// Between two looks at where the run is.
const LOOK: Duration = Duration::from_millis(20);
/// What a process may grow by in each third of the time from a third of the looks to the last: a queue that is once longer than
/// before is taken once, at most across the end of one third, a leak is in all three. The allocator takes memory from the kernel in pieces of 132 KiB, and a day of
/// a leak of one byte a cycle would be 124 MiB.
const GROWTH_MAX_KIB: u64 = 512;
/// What the recorder may grow by besides, per hour recorded: the index of a recording has an entry for each second of it.
const INDEX_KIB_PER_HOUR: f64 = 4096.0;
/// Counters that have to stay zero where nobody is late and nothing is lost.
const ZERO: [&str; 9] = [
    "missed_deadlines",
    "skipped_periods",
    "stale_commands",
    "refused_foreign_commands",
    "refused_late_commands",
    "refused_future_commands",
    "refused_unusable_commands",
    "drive_faults",
    "unsent_commands",
];

/// What one process held at a checkpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Held {
    /// Resident memory of its own or shared, in KiB, without pages of program files, which the kernel takes and brings back as
    /// it likes.
    pub memory_kib: u64,
    /// Open files.
    pub files: u64,
}

/// One look at the processes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Checkpoint {
    /// Where the loop was.
    pub cycle: u64,
    /// Since the start, by the wall clock.
    pub wall_s: f64,
    /// Each process by its role's name.
    pub held: BTreeMap<String, Held>,
}

/// What a soak came to.
#[derive(Debug, Serialize)]
pub struct SoakReport {
    /// Cycles asked for.
    pub asked_cycles: u64,
    /// Cycles run.
    pub cycles: u64,
    /// The looks, oldest first.
    pub checkpoints: Vec<Checkpoint>,
    /// The loop's counters at the end.
    pub counters: BTreeMap<String, u64>,
    /// Rows in the recording.
    pub recorded_rows: u64,
    /// Rows it lacks.
    pub lost_rows: u64,
    /// Everything that did not stand still.
    pub findings: Vec<String>,
}

/// Runs a robot in lockstep and looks at its processes now and then. Ctrl-C ends it early; what was run by then counts.
///
/// # Errors
/// [`CliError::Input`] if the run cannot be started or joined.
pub fn soak(arguments: &FaultsArguments) -> Result<SoakReport, CliError> {
    let duration = arguments
        .soak
        .unwrap_or(if arguments.short { SHORT } else { FULL });
    let asked_cycles = (duration.as_nanos() / u128::from(PERIOD_NS)) as u64;
    let stop = stop_on_signals()?;
    let setting = Setting {
        record: Some(Path::new("/dev/null")),
        lockstep: true,
        ..Setting::default()
    };
    let mut subject = Subject::start_with(Target::of(arguments), duration, &setting)?;
    subject.await_process(Role::Loop, None);
    let checkpoints = watch(arguments, &mut subject, asked_cycles, &stop)?;
    if stop.load(Ordering::Relaxed) {
        subject.signal(SIGINT);
    }
    let end = subject.finish(END);
    let timing = &end.report["timing"];
    let counters: BTreeMap<String, u64> =
        serde_json::from_value(timing["counters"].clone()).unwrap_or_default();
    let tracking = |name: &str| end.report["tracking"][name].as_u64().unwrap_or(0);
    let mut report = SoakReport {
        asked_cycles,
        cycles: counters.get("cycles").copied().unwrap_or(0),
        checkpoints,
        counters,
        recorded_rows: tracking("recorded_rows"),
        lost_rows: tracking("lost_rows"),
        findings: Vec::new(),
    };
    report.findings = report.look(timing["final_state"].as_str(), &end.said);
    report.findings.extend(end.left_behind);
    Ok(report)
}

/// Follows the run to its end or to `stop`.
fn watch(
    arguments: &FaultsArguments,
    subject: &mut Subject,
    asked_cycles: u64,
    stop: &AtomicBool,
) -> Result<Vec<Checkpoint>, CliError> {
    let bus = Bus::join(subject.instance()).map_err(CliError::input)?;
    let statuses = bus
        .reader(&topics::OBSERVED_STATUS)
        .map_err(CliError::input)?;
    let begun = Instant::now();
    // The last look is before the end, when the processes go.
    let step = (asked_cycles / (CHECKPOINTS + 1)).max(1);
    let mut checkpoints: Vec<Checkpoint> = Vec::new();
    while !stop.load(Ordering::Relaxed) && subject.is_running() {
        if let Some(status) = statuses.take_newest()
            && (checkpoints.len() as u64) < CHECKPOINTS
            && status.header.cycle >= step * (checkpoints.len() as u64 + 1)
        {
            let checkpoint = Checkpoint {
                cycle: status.header.cycle,
                wall_s: begun.elapsed().as_secs_f64(),
                held: Role::ALL
                    .into_iter()
                    .filter_map(|role| Some((role.name().to_owned(), held_by(subject, role)?)))
                    .collect(),
            };
            // the run ended during this look: what became of it its report tells
            if held_by(subject, Role::Loop).is_none() {
                break;
            }
            show(&checkpoint.to_string(), arguments)?;
            checkpoints.push(checkpoint);
        }
        std::thread::sleep(LOOK);
    }
    Ok(checkpoints)
}

fn held_by(subject: &Subject, role: Role) -> Option<Held> {
    let process_id = subject.process(role)?;
    let status = fs::read_to_string(format!("/proc/{process_id}/status")).ok()?;
    let files = fs::read_dir(format!("/proc/{process_id}/fd")).ok()?.count();
    Some(Held {
        memory_kib: resident_kib(&status)?,
        files: files as u64,
    })
}

/// Of the text of `/proc/PID/status`.
fn resident_kib(status: &str) -> Option<u64> {
    let kib = |key: &str| -> Option<u64> {
        let line = status.lines().find_map(|line| line.strip_prefix(key))?;
        line.split_whitespace().next()?.parse().ok()
    };
    Some(kib("RssAnon:")? + kib("RssShmem:")?)
}

impl SoakReport {
    /// Everything that did not stand still.
    fn look(&self, final_state: Option<&str>, said: &str) -> Vec<String> {
        let mut findings = Vec::new();
        if final_state != Some("Running") {
            let state = final_state.unwrap_or("an unknown state");
            findings.push(format!("the loop ended in {state}: {}", said.trim()));
        }
        for name in ZERO {
            let count = self.counters.get(name).copied().unwrap_or(0);
            if count > 0 {
                findings.push(format!("{count} {}", name.replace('_', " ")));
            }
        }
        if self.lost_rows > 0 || self.recorded_rows != self.cycles {
            findings.push(format!(
                "{} rows of {} cycles, {} lost",
                self.recorded_rows, self.cycles, self.lost_rows
            ));
        }
        findings.extend(self.growth());
        findings
    }

    /// From a third of the looks on: by then everything has been used.
    fn growth(&self) -> Vec<String> {
        let warm = &self.checkpoints[self.checkpoints.len() / 3..];
        let [first, .., last] = warm else {
            return Vec::new();
        };
        let thirds = [0, warm.len() / 3, 2 * warm.len() / 3, warm.len() - 1].map(|k| &warm[k]);
        let mut findings = Vec::new();
        for (role, before) in &first.held {
            let Some(after) = last.held.get(role) else {
                findings.push(format!("{role} was gone"));
                continue;
            };
            let has_grown = |from: &Checkpoint, to: &Checkpoint| {
                let held_kib =
                    |at: &Checkpoint| at.held.get(role).map_or(0, |held| held.memory_kib);
                let hours = (to.cycle - from.cycle) as f64 * PERIOD_NS as f64 * 1e-9 / 3600.0;
                let allowed_kib = match role == Role::Relay.name() {
                    true => GROWTH_MAX_KIB + (INDEX_KIB_PER_HOUR * hours) as u64,
                    false => GROWTH_MAX_KIB,
                };
                held_kib(to) > held_kib(from) + allowed_kib
            };
            if thirds.windows(2).all(|ends| has_grown(ends[0], ends[1])) {
                let (before_kib, after_kib) = (before.memory_kib, after.memory_kib);
                findings.push(format!("{role} grew from {before_kib} to {after_kib} KiB"));
            }
            // a process has one more open for an instant now and then: what is kept shows in every look
            let fewest = |looks: &[Checkpoint]| {
                let held = looks.iter().filter_map(|at| at.held.get(role));
                held.map(|held| held.files).min()
            };
            let third = warm.len().div_ceil(3);
            let [early, late] = [&warm[..third], &warm[warm.len() - third..]].map(fewest);
            if let (Some(early), Some(late)) = (early, late)
                && late > early
            {
                findings.push(format!("{role} had {early} files open, then {late}"));
            }
        }
        findings
    }

    /// Whether all of it was run and everything stood still.
    pub fn stood_still(&self) -> bool {
        self.findings.is_empty() && self.cycles >= self.asked_cycles
    }
}

impl fmt::Display for Checkpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} cycles, {:.0} s:", self.cycle, self.wall_s)?;
        for (role, held) in &self.held {
            write!(f, " {role} {} KiB {} files,", held.memory_kib, held.files)?;
        }
        Ok(())
    }
}

impl fmt::Display for SoakReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hours = self.cycles as f64 * PERIOD_NS as f64 * 1e-9 / 3600.0;
        write!(
            f,
            "soak in lockstep: {} of {} cycles ({hours:.2} h of control), {} rows recorded, {} lost",
            self.cycles, self.asked_cycles, self.recorded_rows, self.lost_rows
        )?;
        match self.findings.is_empty() {
            true => write!(f, "; memory, open files and counters stood still"),
            false => write!(f, "\n  {}", self.findings.join("\n  ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks one after the other, at memory in KiB and open files.
    fn looks(held: &[(u64, u64)]) -> SoakReport {
        let checkpoint = |(place, &(memory_kib, files)): (usize, &(u64, u64))| Checkpoint {
            cycle: place as u64 + 1,
            wall_s: 0.0,
            held: [("loop".to_owned(), Held { memory_kib, files })].into(),
        };
        report(held.iter().enumerate().map(checkpoint).collect())
    }

    fn report(checkpoints: Vec<Checkpoint>) -> SoakReport {
        SoakReport {
            asked_cycles: 100,
            cycles: 100,
            checkpoints,
            counters: BTreeMap::new(),
            recorded_rows: 100,
            lost_rows: 0,
            findings: Vec::new(),
        }
    }

    #[test]
    fn what_is_taken_at_the_start_is_no_growth_and_what_comes_later_is() {
        let found = |held: &[(u64, u64)]| looks(held).look(Some("Running"), "");
        let nothing = Vec::<String>::new();
        let steady = (1000, 5);
        let warm = [steady, (9000, 7), (9500, 7)];
        assert_eq!(found(&warm), nothing);
        let once_behind = [steady, steady, steady, (2000, 5), (3000, 5), (3100, 5)];
        assert_eq!(found(&once_behind), nothing);
        let opened_for_an_instant = [steady, steady, steady, steady, steady, (1000, 6)];
        assert_eq!(found(&opened_for_an_instant), nothing);
        let leaking = [steady, steady, steady, (1550, 5), (2100, 6), (2700, 6)];
        assert_eq!(
            found(&leaking),
            [
                "loop grew from 1000 to 2700 KiB",
                "loop had 5 files open, then 6"
            ]
        );
    }

    #[test]
    fn a_counter_that_moved_a_lost_row_and_a_stop_are_found() {
        let mut report = report(Vec::new());
        report.counters.insert("drive_faults".to_owned(), 2);
        report.recorded_rows = 99;
        let found = report.look(Some("SafeStop"), "why\n");
        assert_eq!(
            found,
            [
                "the loop ended in SafeStop: why",
                "2 drive faults",
                "99 rows of 100 cycles, 0 lost"
            ]
        );
    }

    #[test]
    fn resident_memory_is_read() {
        assert_eq!(
            resident_kib(
                "VmRSS:\t  1234 kB\nRssAnon:\t 1000 kB\nRssFile:\t 200 kB\nRssShmem:\t  34 kB\n"
            ),
            Some(1034)
        );
        assert_eq!(resident_kib("VmRSS:\t  1234 kB\n"), None);
    }
}
