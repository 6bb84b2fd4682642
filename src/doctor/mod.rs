//! `flexspline doctor`: what real-time abilities this machine grants, what is missing, and how to get it.
//!
//! Every check is a function of the text of some file; [`machine`] reads the files, and what cannot be read is unknown.

mod cores;
mod drives;
mod finding;
mod kernel;
mod machine;
mod probe;
mod rights;
mod storage;

use std::fmt;
use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use realtime::cores::usable_cores;
use realtime::process::user_id;
use rt_loop::process::FIFO_PRIORITY;
use serde::Serialize;
use shm_types::instance::core_of;
use shm_types::topics::Role;

use crate::cli::DoctorArguments;
use crate::error::CliError;
use crate::output::{print, write_json};
use crate::run::PERIOD_NS;
use finding::{Finding, Verdict};
use machine::Machine;
use probe::{Probe, granted, jitter, probe};

/// Everything that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct DoctorReport {
    /// The worst of all findings.
    verdict: Verdict,
    findings: Vec<Finding>,
    probe: Option<Probe>,
}

/// Looks at the machine and reports.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if the loop would not get what it asks for.
pub fn doctor(arguments: &DoctorArguments) -> Result<(), CliError> {
    let cores = usable_cores();
    let loop_core = core_of(Role::Loop, &cores);
    let mut findings = drives::findings(arguments)?;
    findings.extend(read_findings(&cores, loop_core));
    let probe = if arguments.no_probe {
        None
    } else {
        Some(run_probe(arguments.probe, loop_core)?)
    };
    if let Some(probe) = &probe {
        findings.push(granted(&probe.grant));
        findings.push(jitter(probe));
    }
    let report = DoctorReport {
        verdict: worst(&findings),
        findings,
        probe,
    };
    if arguments.json.as_deref() != Some(Path::new("-")) {
        print(&report.to_string())?;
    }
    if let Some(path) = &arguments.json {
        write_json(&report, path)?;
    }
    report.outcome()
}

/// All that can be known from files.
fn read_findings(cores: &[usize], loop_core: Option<usize>) -> Vec<Finding> {
    let user = user_id();
    let machine = Machine::read(user, loop_core);
    let limits = machine.limits.as_deref();
    let status = machine.status.as_deref();
    let mut findings = vec![
        rights::priority(limits, status, FIFO_PRIORITY),
        rights::locked_memory(limits, status),
    ];
    findings.extend(kernel::group_share(machine.rt_group_share_us.as_deref()));
    findings.extend([
        kernel::preemption(
            machine.version.as_deref(),
            machine.preemption.as_deref(),
            machine.command_line.as_deref(),
            machine.config.as_deref(),
        ),
        kernel::throttling(
            machine.rt_runtime_us.as_deref(),
            machine.rt_period_us.as_deref(),
        ),
        cores::own_core(cores, loop_core),
        cores::isolation(machine.isolated.as_deref(), loop_core),
        cores::siblings(machine.siblings.as_deref(), loop_core),
        cores::governor(machine.governor.as_deref()),
        cores::sleep_states(
            machine.sleep_states.as_deref(),
            machine.can_hold_dma_latency,
        ),
        kernel::clock(machine.clock_source.as_deref()),
        kernel::host(machine.cpu_info.as_deref(), machine.stolen_s),
        storage::shared_memory(machine.shared_memory_free_bytes),
        storage::files(machine.files_free_bytes),
        storage::directory(machine.directory_refusal.clone()),
        storage::leftovers(&machine.instances, &machine.shared_memory),
        rights::logout(machine.logind.as_deref(), user),
        rights::ageing(machine.tmpfiles.as_deref()),
    ]);
    findings
}

fn run_probe(duration: Duration, loop_core: Option<usize>) -> Result<Probe, CliError> {
    if duration.as_nanos() < u128::from(PERIOD_NS) || duration > PROBE_MAX {
        return Err(CliError::Input(format!(
            "--probe {}: choose between one period, 667 µs, and {}",
            humantime::format_duration(duration),
            humantime::format_duration(PROBE_MAX)
        )));
    }
    let bar = ProgressBar::new_spinner().with_style(
        ProgressStyle::with_template("{spinner} waking up on the loop's core, {elapsed} of {msg}")
            .unwrap_or_else(|_| ProgressStyle::default_spinner()),
    );
    bar.set_message(humantime::format_duration(duration).to_string());
    bar.enable_steady_tick(Duration::from_millis(100));
    let probed = probe(duration, PERIOD_NS, loop_core);
    bar.finish_and_clear();
    probed.map_err(|error| CliError::Negative(format!("cannot start the probe: {error}")))
}

/// Longer than anybody waits; the number of wake-ups still fits.
const PROBE_MAX: Duration = Duration::from_secs(24 * 3600);

fn worst(findings: &[Finding]) -> Verdict {
    let verdicts = findings.iter().map(|finding| finding.verdict);
    verdicts.max().unwrap_or(Verdict::Good)
}

impl DoctorReport {
    fn outcome(&self) -> Result<(), CliError> {
        let missing: Vec<&str> = self
            .findings
            .iter()
            .filter(|finding| finding.verdict == Verdict::Missing)
            .map(|finding| finding.about)
            .collect();
        if missing.is_empty() {
            return Ok(());
        }
        Err(CliError::Negative(format!(
            "this machine does not give the loop what it asks for: {}",
            missing.join(", ")
        )))
    }
}

impl fmt::Display for DoctorReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for finding in &self.findings {
            let Finding {
                about, verdict, is, ..
            } = finding;
            writeln!(f, "{:8} {about:38} {is}", verdict.label())?;
            if *verdict == Verdict::Good {
                continue;
            }
            writeln!(f, "{:8} should be: {}", "", finding.wanted)?;
            if let Some(mend) = &finding.mend {
                writeln!(f, "{:8} mend:      {mend}", "")?;
            }
            writeln!(f, "{:8} otherwise: {}", "", finding.cost)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::finding::Rule;
    use super::*;

    const RULE: Rule = Rule {
        about: "x",
        wanted: "more",
        mend: "do it",
        cost: "less",
    };

    fn report(verdicts: &[Verdict]) -> DoctorReport {
        let findings: Vec<Finding> = verdicts
            .iter()
            .map(|&verdict| RULE.finds(verdict, "some"))
            .collect();
        DoctorReport {
            verdict: worst(&findings),
            findings,
            probe: None,
        }
    }

    #[test]
    fn only_what_is_missing_makes_the_answer_no() {
        assert!(
            report(&[Verdict::Good, Verdict::Unknown, Verdict::Weak])
                .outcome()
                .is_ok()
        );
        assert!(
            report(&[Verdict::Good, Verdict::Missing])
                .outcome()
                .is_err()
        );
    }

    #[test]
    fn what_is_good_takes_one_line_and_what_is_not_says_what_to_do() {
        assert_eq!(report(&[Verdict::Good]).to_string().lines().count(), 1);
        let weak = report(&[Verdict::Weak]).to_string();
        for part in ["should be: more", "mend:      do it", "otherwise: less"] {
            assert!(weak.contains(part), "{weak}");
        }
    }

    #[test]
    fn this_machine_is_read_without_a_panic() {
        let findings = read_findings(&[0], None);
        assert!(findings.len() >= 17, "{findings:?}");
    }
}
