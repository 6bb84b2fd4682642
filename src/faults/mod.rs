//! `flexspline faults`: puts faults into a running system and says what it did about each.

mod kills;
mod processes;
mod soak;
mod subject;
mod table;
mod virtual_time;

use serde::Serialize;

use crate::cli::{FaultsArguments, FaultsPart};
use crate::drivers;
use crate::error::CliError;
use crate::output::{print, write_json};
use kills::{KillReport, RoundReport};
use processes::ProcessOutcome;
use soak::SoakReport;
use virtual_time::OnDrives;

/// What all faults came to.
#[derive(Debug, Default, Serialize)]
struct FaultsReport {
    /// In virtual time, cycle by cycle.
    virtual_time: Vec<OnDrives>,
    /// With processes, in real time.
    processes: Vec<ProcessOutcome>,
    /// Services killed under one running loop.
    kills: Option<KillReport>,
    /// Instances started and stopped with kills at random moments.
    rounds: Option<RoundReport>,
    /// A long run in lockstep.
    soak: Option<SoakReport>,
}

/// Runs the suite and prints its tables.
///
/// # Errors
/// [`CliError::Input`] if it cannot be run, [`CliError::Negative`] if a fault ended otherwise than documented.
pub fn faults(arguments: &FaultsArguments) -> Result<(), CliError> {
    drivers::find(&arguments.driver)?;
    let wanted = |part| match arguments.part.is_empty() {
        // In virtual time there are emulated drives only.
        true => part != FaultsPart::Virtual || drivers::is_emulated(&arguments.driver),
        false => arguments.part.contains(&part),
    };
    let mut report = FaultsReport::default();
    if wanted(FaultsPart::Virtual) {
        report.virtual_time = virtual_time::run(arguments)?;
        for text in table::virtual_time(&report.virtual_time) {
            show(&format!("{text}\n"), arguments)?;
        }
    }
    if wanted(FaultsPart::Processes) {
        report.processes = processes::run(arguments)?;
        show(&table::processes(&report.processes), arguments)?;
    }
    if wanted(FaultsPart::Kills) {
        let kills = kills::under_one_loop(arguments)?;
        show(&format!("{kills}"), arguments)?;
        report.kills = Some(kills);
    }
    if wanted(FaultsPart::Rounds) {
        let rounds = kills::at_random_moments(arguments)?;
        show(&format!("{rounds}"), arguments)?;
        report.rounds = Some(rounds);
    }
    // It takes hours: only where it is asked for.
    if wanted(FaultsPart::Soak) && (arguments.short || !arguments.part.is_empty()) {
        let soak = soak::soak(arguments)?;
        show(&format!("{soak}"), arguments)?;
        report.soak = Some(soak);
    }
    if let Some(path) = &arguments.json {
        write_json(&report, path)?;
    }
    report.verdict()
}

/// Tables go to standard output unless the results do.
fn show(text: &str, arguments: &FaultsArguments) -> Result<(), CliError> {
    match arguments.json.as_deref() {
        Some(path) if path.as_os_str() == "-" => Ok(()),
        _ => print(&format!("{text}\n")),
    }
}

impl FaultsReport {
    fn verdict(&self) -> Result<(), CliError> {
        let in_virtual_time = self.virtual_time.iter().flat_map(OnDrives::wrong);
        let with_processes = self
            .processes
            .iter()
            .filter(|outcome| outcome.skipped.is_none() && !outcome.as_documented)
            .map(|outcome| outcome.fault.to_owned());
        let kills = self.kills.iter().filter(|kills| !kills.survived());
        let rounds = self.rounds.iter().filter(|rounds| !rounds.clean());
        let soak = self.soak.iter().filter(|soak| !soak.stood_still());
        let wrong: Vec<String> = in_virtual_time
            .chain(with_processes)
            .chain(kills.map(|_| "service kills".to_owned()))
            .chain(rounds.map(|_| "start-stop rounds".to_owned()))
            .chain(soak.map(|_| "soak".to_owned()))
            .collect();
        if wrong.is_empty() {
            return Ok(());
        }
        Err(CliError::Negative(format!(
            "not as documented: {}",
            wrong.join("; ")
        )))
    }
}
