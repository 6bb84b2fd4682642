//! What a run came to: tables for people, JSON for programs.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use comfy_table::{CellAlignment, Table, presets};
use estimators::Kind;
use rt_loop::report::{LoopReport, Quantiles};
use serde::Serialize;
use services::tracking::{ErrorSummary, TrackingReport};
use shm_types::instance::Mode;

use crate::supervisor::child::Restart;

/// Everything known about a finished run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunReport {
    /// The robot's name.
    pub robot: String,
    /// The trajectory's name or file.
    pub trajectory: String,
    /// How time passed.
    pub mode: Mode,
    /// Seed of everything random in the emulator.
    pub seed: u64,
    /// Where the recording went.
    pub recording: Option<PathBuf>,
    /// Whether Ctrl-C or SIGTERM ended it.
    pub interrupted: bool,
    /// The loop's account.
    pub timing: Option<LoopReport>,
    /// The relay's account.
    pub tracking: Option<TrackingReport>,
    /// Services that ended and were started again.
    pub restarts: Vec<Restart>,
    /// The loop's last cycles before each stop.
    pub last_cycles: Vec<PathBuf>,
}

impl fmt::Display for RunReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mode = match self.mode {
            Mode::Realtime => "real time",
            Mode::Lockstep => "lockstep",
        };
        write!(f, "{}, {}, {mode}", self.robot, self.trajectory)?;
        writeln!(
            f,
            "{}",
            if self.interrupted {
                ", interrupted"
            } else {
                ""
            }
        )?;
        if let Some(timing) = &self.timing {
            show_timing(f, timing)?;
        }
        if let Some(tracking) = &self.tracking {
            show_tracking(f, tracking)?;
        }
        show_restarts(f, &self.restarts, self.timing.as_ref())?;
        let recordings = self
            .tracking
            .as_ref()
            .map_or(&[][..], |tracking| &tracking.recordings);
        for recording in recordings {
            writeln!(f, "recording: {recording}")?;
        }
        Ok(())
    }
}

fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::UTF8_HORIZONTAL_ONLY)
        .set_header(header.to_vec());
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn show_timing(f: &mut fmt::Formatter<'_>, timing: &LoopReport) -> fmt::Result {
    let speed = timing.controlled_s / timing.wall_s.max(f64::MIN_POSITIVE);
    let cycles = timing.counters.get("cycles").copied().unwrap_or(0);
    writeln!(
        f,
        "loop: {:.1} Hz, {cycles} cycles, {:.2} s in {:.2} s of wall clock ({speed:.2} x), ended in {}",
        timing.rate_hz, timing.controlled_s, timing.wall_s, timing.final_state
    )?;
    if let Some(grant) = &timing.grant {
        show_grant(f, grant)?;
        let mut times = table(&["time, µs", "p50", "p99", "p99.9", "max"]);
        for (name, quantiles) in [
            ("late at wake-up", &timing.wakeup_lateness),
            ("period", &timing.period),
            ("own compute", &timing.compute),
            ("sample to command", &timing.command_latency),
            ("exchange with drives", &timing.exchange),
        ] {
            times.add_row(quantile_row(name, quantiles));
        }
        writeln!(f, "{times}")?;
    }
    let counted: Vec<String> = timing
        .counters
        .iter()
        .filter(|(name, count)| name.as_str() != "cycles" && **count > 0)
        .map(|(name, count)| format!("{} {count}", name.replace('_', " ")))
        .collect();
    let counted = if counted.is_empty() {
        "nothing missed".to_owned()
    } else {
        counted.join(", ")
    };
    writeln!(f, "counted: {counted}")?;
    if !timing.overrun_causes.is_empty() {
        let causes: Vec<String> = timing
            .overrun_causes
            .iter()
            .map(|(cause, count)| format!("{} {count}", cause.label()))
            .collect();
        writeln!(f, "missed deadlines by cause: {}", causes.join(", "))?;
    }
    Ok(())
}

fn show_grant(f: &mut fmt::Formatter<'_>, grant: &realtime::grant::Grant) -> fmt::Result {
    writeln!(f, "granted: {grant}")?;
    if !grant.refused.is_empty() {
        writeln!(
            f,
            "warning: not real-time, jitter will be larger; refused: {}",
            grant.refused.join("; ")
        )?;
    }
    Ok(())
}

fn quantile_row(name: &str, quantiles: &Quantiles) -> Vec<String> {
    let values = [
        quantiles.p50_us,
        quantiles.p99_us,
        quantiles.p999_us,
        quantiles.max_us,
    ];
    std::iter::once(name.to_owned())
        .chain(values.map(|value| format!("{value:.1}")))
        .collect()
}

fn show_tracking(f: &mut fmt::Formatter<'_>, tracking: &TrackingReport) -> fmt::Result {
    if let Some(error) = &tracking.end_effector_error_m {
        writeln!(
            f,
            "end effector: mean error {:.1} mm, maximum {:.1} mm, {:.1} mm after the first 2 s (against the {})",
            error.mean * 1e3,
            error.max * 1e3,
            error.max_after_start * 1e3,
            tracking.compared_with
        )?;
    }
    let mut joints = table(&[
        "joint",
        "tracking rms, mrad",
        "max, mrad",
        "feedback rms, Nm",
    ]);
    for joint in &tracking.joints {
        let mut row = vec![joint.joint.clone()];
        row.extend(rms_and_max(&joint.position_error_rad, 1e3));
        row.extend(
            rms_and_max(&joint.feedback_torque_nm, 1.0)
                .into_iter()
                .take(1),
        );
        joints.add_row(row);
    }
    writeln!(f, "{joints}")?;
    show_estimates(f, tracking)?;
    show_missing(f, tracking)?;
    show_contacts(f, tracking)?;
    let lost = if tracking.lost_rows > 0 {
        format!(", {} lost", tracking.lost_rows)
    } else {
        String::new()
    };
    writeln!(f, "recorded: {} rows{lost}", tracking.recorded_rows)?;
    if let Some(error) = &tracking.recording_error {
        writeln!(f, "recording ended early: {error}")?;
    }
    Ok(())
}

/// Every estimator that gave a torque, against what the plant, or its torque sensor, says.
fn show_estimates(f: &mut fmt::Formatter<'_>, tracking: &TrackingReport) -> fmt::Result {
    let errors = |kind: &Kind| {
        let joints = tracking.joints.iter();
        joints
            .filter_map(|joint| joint.estimate_errors_nm.get(kind))
            .count()
    };
    let kinds: Vec<Kind> = Kind::ALL
        .into_iter()
        .filter(|kind| errors(kind) > 0)
        .collect();
    if kinds.is_empty() {
        return Ok(());
    }
    let mut header = vec!["torque estimate minus".to_owned() + " " + torque_source(tracking)];
    for kind in &kinds {
        header.push(format!("{} rms, Nm", kind.name()));
        header.push("max".to_owned());
    }
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut estimates = table(&header);
    for joint in &tracking.joints {
        let mut row = vec![joint.joint.clone()];
        for kind in &kinds {
            let error = joint.estimate_errors_nm.get(kind).copied();
            row.extend(rms_and_max(&error, 1.0));
        }
        estimates.add_row(row);
    }
    writeln!(f, "{estimates}")
}

/// Each estimator that never gave a torque, with the joints and the signal it lacks there.
fn show_missing(f: &mut fmt::Formatter<'_>, tracking: &TrackingReport) -> fmt::Result {
    let mut joints_without: BTreeMap<(Kind, &str), Vec<&str>> = BTreeMap::new();
    for joint in &tracking.joints {
        for (kind, signal) in &joint.missing_signals {
            let joints = joints_without.entry((*kind, signal)).or_default();
            joints.push(&joint.joint);
        }
    }
    for ((kind, signal), joints) in joints_without {
        writeln!(
            f,
            "{}: no estimate at {}, needs {signal}, which was never measured",
            kind.name(),
            joints.join(", ")
        )?;
    }
    Ok(())
}

fn torque_source(tracking: &TrackingReport) -> &'static str {
    if tracking.compared_with == "plant" {
        "the plant's torque"
    } else {
        "the torque sensor"
    }
}

fn show_contacts(f: &mut fmt::Formatter<'_>, tracking: &TrackingReport) -> fmt::Result {
    for joint in &tracking.joints {
        let Some(external) = &joint.external_torque_nm else {
            continue;
        };
        write!(
            f,
            "{}: external torque {:.2} Nm rms, {:.2} Nm at most; ",
            joint.joint, external.rms, external.max
        )?;
        match joint.first_contact_s {
            Some(first_s) => writeln!(
                f,
                "contacts {}, the first at {first_s:.3} s",
                joint.contacts
            )?,
            None => writeln!(f, "no contact")?,
        }
    }
    Ok(())
}

fn rms_and_max(summary: &Option<ErrorSummary>, scale: f64) -> [String; 2] {
    match summary {
        Some(summary) => [summary.rms, summary.max].map(|value| format!("{:.2}", value * scale)),
        None => ["-", "-"].map(str::to_owned),
    }
}

fn show_restarts(
    f: &mut fmt::Formatter<'_>,
    restarts: &[Restart],
    timing: Option<&LoopReport>,
) -> fmt::Result {
    for restart in restarts {
        let back = restart
            .back_after_ms
            .map_or("not back before the end".to_owned(), |ms| {
                format!("back after {ms:.0} ms")
            });
        writeln!(
            f,
            "{} ended at {:.2} s ({}), {back}",
            restart.role, restart.at_s, restart.reason
        )?;
    }
    let gap = timing
        .and_then(|timing| timing.counters.get("longest_command_gap_cycles"))
        .copied()
        .unwrap_or(0);
    if !restarts.is_empty() && gap > 0 {
        let period_ms = timing.map_or(0.0, |timing| 1e3 / timing.rate_hz);
        writeln!(
            f,
            "longest time without a command: {gap} cycles ({:.0} ms)",
            gap as f64 * period_ms
        )?;
    }
    Ok(())
}
