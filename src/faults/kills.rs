//! Kills in great number: services under one running loop, and whole instances at random moments.

use std::fmt;
use std::time::Duration;

use libc::{SIGINT, SIGKILL, SIGSTOP};
use rand_core::RngCore;
use rand_pcg::Pcg32;
use realtime::process::send_signal;
use serde::Serialize;
use shm_types::topics::Role;

use super::subject::{Subject, Target};
use crate::cli::FaultsArguments;
use crate::error::CliError;

/// Longer than any number of kills takes; the run is ended by Ctrl-C.
const ENDLESS: Duration = Duration::from_secs(24 * 3600);
/// How long a run that was asked to end may take.
const END: Duration = Duration::from_secs(20);
/// A service lives at most this long before it is killed: some are killed during their start, some at work.
const LIFE_MAX_MS: u32 = 600;
/// An instance lives at most this long: its own start takes about a third of it.
const ROUND_MAX_MS: u32 = 1500;
/// What is random about the moments.
const SEED: u64 = 1;

/// Services killed under one running loop.
#[derive(Debug, Serialize)]
pub struct KillReport {
    /// How many were killed.
    pub kills: u64,
    /// How many were asked for.
    pub asked: u64,
    /// The loop's last state.
    pub end_state: Option<String>,
    /// The longest time without a command, in cycles.
    pub command_gap_cycles: Option<u64>,
    /// Cycles the loop ran.
    pub cycles: Option<u64>,
    /// Files of the instance when all services ran for the first time.
    pub files_before: usize,
    /// The same after the last kill.
    pub files_after: usize,
    /// What was still there after the run.
    pub left_behind: Vec<String>,
    /// What the run said.
    pub said: String,
}

/// Instances started and stopped with kills at random moments.
#[derive(Debug, Default, Serialize)]
pub struct RoundReport {
    /// How many.
    pub rounds: u64,
    /// Rounds that left files or processes behind, with what.
    pub unclean: Vec<String>,
}

impl KillReport {
    /// Whether the loop went on, and nothing was left.
    pub fn survived(&self) -> bool {
        let stopped = self
            .end_state
            .as_deref()
            .is_none_or(|state| ["SafeStop", "Faulted"].contains(&state));
        self.kills == self.asked && !stopped && self.left_behind.is_empty()
    }
}

impl RoundReport {
    /// Whether no round left anything.
    pub fn clean(&self) -> bool {
        self.unclean.is_empty()
    }
}

fn random_below(random: &mut Pcg32, bound: u32) -> u32 {
    random.next_u32() % bound
}

fn pause(random: &mut Pcg32, most_ms: u32) {
    std::thread::sleep(Duration::from_millis(u64::from(random_below(
        random, most_ms,
    ))));
}

/// Kills one service after the other, each at a random moment of its life.
///
/// # Errors
/// [`CliError::Input`] if the run cannot be started.
pub fn under_one_loop(arguments: &FaultsArguments) -> Result<KillReport, CliError> {
    let asked = arguments
        .kills
        .unwrap_or(if arguments.short { 5 } else { 1000 });
    let mut random = Pcg32::new(SEED, 0);
    let mut subject = Subject::start(Target::of(arguments), ENDLESS)?;
    subject.await_process(Role::Loop, None);
    std::thread::sleep(Duration::from_secs(1));
    let files_before = subject.files();
    let roles = [Role::Feedforward, Role::Estimator, Role::Relay];
    let mut killed = [None; 3];
    let mut kills = 0;
    while kills < asked {
        let index = random_below(&mut random, 3) as usize;
        let Some(process_id) = subject.await_process(roles[index], killed[index]) else {
            break;
        };
        pause(&mut random, LIFE_MAX_MS);
        kills += u64::from(send_signal(process_id, SIGKILL));
        killed[index] = Some(process_id);
    }
    std::thread::sleep(Duration::from_secs(1));
    let files_after = subject.files();
    subject.signal(SIGINT);
    let end = subject.finish(END);
    let timing = &end.report["timing"];
    Ok(KillReport {
        kills,
        asked,
        end_state: timing["final_state"].as_str().map(str::to_owned),
        command_gap_cycles: timing["counters"]["longest_command_gap_cycles"].as_u64(),
        cycles: timing["counters"]["cycles"].as_u64(),
        files_before,
        files_after,
        left_behind: end.left_behind,
        said: end.said.lines().last().unwrap_or_default().to_owned(),
    })
}

/// Starts an instance, kills or freezes one of its processes at a random moment, asks it to end; again and again.
///
/// # Errors
/// [`CliError::Input`] if a run cannot be started.
pub fn at_random_moments(arguments: &FaultsArguments) -> Result<RoundReport, CliError> {
    let rounds = arguments
        .rounds
        .unwrap_or(if arguments.short { 2 } else { 200 });
    let mut random = Pcg32::new(SEED, 1);
    let mut report = RoundReport::default();
    for round in 0..rounds {
        let subject = Subject::start(Target::of(arguments), ENDLESS)?;
        pause(&mut random, ROUND_MAX_MS);
        let what = strike(&subject, &mut random);
        pause(&mut random, ROUND_MAX_MS / 3);
        subject.signal(SIGINT);
        let end = subject.finish(END);
        report.rounds += 1;
        if !end.left_behind.is_empty() {
            let left = end.left_behind.join(", ");
            report
                .unclean
                .push(format!("round {round}, {what}: {left}"));
        }
    }
    Ok(report)
}

fn strike(subject: &Subject, random: &mut Pcg32) -> String {
    let role = random_below(random, Role::ALL.len() as u32 + 1) as usize;
    let signal = match random_below(random, 4) {
        0 => SIGSTOP,
        _ => SIGKILL,
    };
    let Some(role) = Role::ALL.get(role) else {
        subject.signal(SIGKILL);
        return "supervisor killed".to_owned();
    };
    match subject.process(*role) {
        Some(process_id) => {
            send_signal(process_id, signal);
            format!("{} got signal {signal}", role.name())
        }
        None => format!("{} was not there", role.name()),
    }
}

impl fmt::Display for KillReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = self.end_state.as_deref().unwrap_or("unknown");
        let gap = self.command_gap_cycles.unwrap_or(0);
        let cycles = self.cycles.unwrap_or(0);
        write!(
            f,
            "service kills: {} of {} under one loop of {cycles} cycles, which ended in {state}; longest time without a \
             command {gap} cycles; files of the instance {} before, {} after the last kill, {} after the run",
            self.kills,
            self.asked,
            self.files_before,
            self.files_after,
            self.left_behind.len()
        )?;
        match self.survived() {
            true => Ok(()),
            false => write!(f, "\n  {}", self.said),
        }
    }
}

impl fmt::Display for RoundReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "start-stop rounds: {}, {} left something behind",
            self.rounds,
            self.unclean.len()
        )?;
        for round in &self.unclean {
            write!(f, "\n  {round}")?;
        }
        Ok(())
    }
}
