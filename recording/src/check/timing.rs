//! Time: rate, regularity, gaps.

use super::{Finding, FindingKind};
use crate::Recording;
use crate::builder::SPREAD;
use crate::info::{Timing, timing};
use crate::statistics::span;

/// Below this nothing can be said about a recording.
pub(super) const ROWS_MIN: usize = 64;
/// The lowest sampling rate at which friction and compliance can still be told apart.
const RATE_MIN_HZ: f64 = 50.0;
/// More than this share of lost rows is worth a warning.
const LOST_SHARE: f64 = 0.01;
/// A rate off by more than this shifts every velocity by as much.
const RATE_SHARE: f64 = 0.01;
/// Jitter above this share of the step makes velocities from differences too rough.
const JITTER_SHARE: f64 = 0.1;

pub(super) fn check(recording: &Recording) -> Vec<Finding> {
    let mut findings = Vec::new();
    let rows = recording.rows();
    if rows < ROWS_MIN {
        let what = format!("{rows} rows, at least {ROWS_MIN} are needed");
        let finding = Finding::error(FindingKind::TooShort, what).decided_by(rows as f64);
        findings.push(finding.remedy("record for longer"));
    }
    if recording.truncated {
        let what = "the recorder was stopped before it finished the file; rows up to its last whole chunk are there";
        findings.push(Finding::note(FindingKind::Truncated, what.to_owned()));
    }
    let timing = timing(recording);
    findings.extend(rate(recording, &timing));
    findings.extend(regularity(recording, &timing));
    findings
}

fn rate(recording: &Recording, timing: &Timing) -> Vec<Finding> {
    let mut findings = Vec::new();
    let planned_hz = recording.sample_rate_hz;
    if planned_hz < RATE_MIN_HZ {
        let what = format!(
            "{planned_hz:.4} rows a second; below {RATE_MIN_HZ} the effects of a gear blur"
        );
        let finding = Finding::warning(FindingKind::SlowSampling, what).decided_by(planned_hz);
        findings.push(finding.remedy("record at a higher rate"));
    }
    if let Some(measured_hz) = timing.measured_rate_hz
        && (measured_hz / planned_hz - 1.0).abs() > RATE_SHARE
    {
        let what =
            format!("the times show {measured_hz:.4} Hz where {planned_hz:.4} Hz were planned");
        let finding = Finding::warning(FindingKind::RateOff, what).decided_by(measured_hz);
        findings.push(
            finding
                .remedy("correct `sample_rate_hz`, or the scale of `time_s`, in the mapping file"),
        );
    }
    findings
}

fn regularity(recording: &Recording, timing: &Timing) -> Vec<Finding> {
    let mut findings = Vec::new();
    let lost_share = timing.lost_rows as f64 / (timing.lost_rows as f64 + recording.rows() as f64);
    if timing.gaps > 0 {
        let what = format!(
            "{} gaps with room for {} rows ({:.2} % of all), the longest {:.4} s at {:.4} s",
            timing.gaps,
            timing.lost_rows,
            100.0 * lost_share,
            timing.longest_gap_s,
            timing.longest_gap_at_s
        );
        let finding = match lost_share > LOST_SHARE {
            true => Finding::warning(FindingKind::Gaps, what),
            false => Finding::note(FindingKind::Gaps, what),
        };
        findings.push(finding.decided_by(lost_share));
    }
    if timing.repeated_times > 0 {
        let what = format!(
            "{} rows have the time of the row before",
            timing.repeated_times
        );
        let finding = Finding::warning(FindingKind::RepeatedTimes, what);
        let finding = finding.decided_by(timing.repeated_times as f64);
        let rows = recording.rows();
        findings.push(if 2 * timing.repeated_times > rows {
            // more than were written once
            let rate_hz = rows as f64 / span(&recording.time_s);
            finding.remedy(format!(
                "the clock's step is longer than a row: in the mapping file, leave `time_s` out and set `sample_rate_hz`, about {rate_hz:.0}"
            ))
        } else {
            finding.remedy("write times with more digits, or remove rows that were written twice")
        });
    }
    if let Some(step_s) = recording.metadata.get(SPREAD) {
        let what = format!(
            "the clock's step is {step_s} s, about a row or longer; rows are taken to be more even, {:.4} a second",
            recording.sample_rate_hz
        );
        let finding = Finding::note(FindingKind::RepeatedTimes, what);
        findings
            .push(finding.remedy("if the rate is known, set `sample_rate_hz` in the mapping file"));
    }
    let jitter = timing.jitter_std_s * recording.sample_rate_hz;
    if jitter > JITTER_SHARE {
        let what = format!(
            "rows follow each other irregularly: {:.3} ms standard deviation where the step is {:.3} ms",
            1e3 * timing.jitter_std_s,
            1e3 / recording.sample_rate_hz
        );
        let finding = Finding::warning(FindingKind::Jitter, what).decided_by(jitter);
        findings.push(finding.remedy("record the time of the measurement, not of writing"));
    }
    findings
}
