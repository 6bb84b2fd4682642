//! `info`: what is in a recording, how good it is, and what it cannot support.

use std::fmt;
use std::path::{Path, PathBuf};

use comfy_table::{CellAlignment, Table, presets};
use recording::{
    Finding, GuessJoint, ReadError, ReadProblem, Recording, RecordingInfo, Severity, SignalInfo,
    check, describe, read_guessing,
};
use recording_checks::data::findings;
use serde::Serialize;

use super::{read, read_of};
use crate::cli::RecordingInfoArguments;
use crate::error::CliError;
use crate::output::{print, write_json};

/// One recording, for programs.
#[derive(Serialize)]
struct Described {
    schema: u32,
    file: PathBuf,
    #[serde(flatten)]
    info: RecordingInfo,
    findings: Vec<Finding>,
}

/// Describes the recordings.
///
/// # Errors
/// [`CliError::Input`] if one cannot be read, [`CliError::Negative`] if one does not fit the robot.
pub fn info(arguments: &RecordingInfoArguments) -> Result<(), CliError> {
    let robot = match &arguments.robot {
        Some(name) => Some(robot::load(name).map_err(CliError::input)?),
        None => None,
    };
    let mut all = Vec::new();
    for file in &arguments.files {
        let mapping = arguments.mapping.as_deref();
        let table = match (&robot, &arguments.robot) {
            (Some(robot), Some(name)) => read_of(file, mapping, robot, name)?.0,
            _ if mapping.is_some() => read(file, mapping)?,
            _ => read_by_number(file)?,
        };
        all.push(Described {
            schema: 1,
            file: file.clone(),
            info: describe(&table),
            findings: robot
                .as_ref()
                .map_or_else(|| check(&table, None), |robot| findings(robot, &table)),
        });
    }
    let to_standard_output = arguments.json.as_deref() == Some(Path::new("-"));
    if !to_standard_output {
        let texts: Vec<String> = all.iter().map(ToString::to_string).collect();
        print(&texts.join("\n"))?;
    }
    if let Some(path) = &arguments.json {
        write_json(&all, path)?;
    }
    verdict(&all)
}

/// A recording. Where nothing names the joints of its arrays they are called by their number: rates, ranges and gaps can be told of
/// joints without names. What is doubtful even so needs the names.
fn read_by_number(file: &Path) -> Result<Recording, CliError> {
    let (problem, columns) = match recording::read(file) {
        Err(ReadError {
            problem: problem @ ReadProblem::UnnamedJoints { columns, .. },
            path,
        }) => (ReadError { path, problem }, columns),
        read => return read.map_err(CliError::input),
    };
    let joint = |number| GuessJoint {
        name: format!("joint{number}"),
        gear_ratio: 1.0,
        // Nothing tells that it may not turn round and round.
        is_limited: false,
        has_rotor: false,
        slides: false,
    };
    let joints: Vec<GuessJoint> = (1..=columns).map(joint).collect();
    let Ok((mut recording, Some(_))) = read_guessing(file, &joints) else {
        return Err(CliError::input(problem));
    };
    let (key, told) = JOINTS_WITHOUT_NAMES;
    recording.metadata.insert(key.to_owned(), told.to_owned());
    Ok(recording)
}

/// What the metadata say then.
const JOINTS_WITHOUT_NAMES: (&str, &str) = (
    "joints_without_names",
    "called by their number; --robot names them, or a mapping file: joints = [\"…\", …]",
);

fn verdict(all: &[Described]) -> Result<(), CliError> {
    let is_error = |finding: &&Finding| finding.severity == Severity::Error;
    let errors = all
        .iter()
        .map(|described| described.findings.iter().filter(is_error).count());
    match errors.sum() {
        0 => Ok(()),
        1 => Err(CliError::Negative("1 error was found".to_owned())),
        count => Err(CliError::Negative(format!("{count} errors were found"))),
    }
}

impl fmt::Display for Described {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let info = &self.info;
        let segments = if info.segments == 1 {
            "segment"
        } else {
            "segments"
        };
        let joints = if info.joints.len() == 1 {
            "joint"
        } else {
            "joints"
        };
        writeln!(f, "{}", self.file.display())?;
        writeln!(
            f,
            "  {} rows, {:.3} s, {} {joints}, {} {segments}{}",
            info.rows,
            info.seconds,
            info.joints.len(),
            info.segments,
            if info.truncated { ", cut short" } else { "" }
        )?;
        timing(f, info)?;
        for (key, value) in info
            .metadata
            .iter()
            .filter(|(key, _)| !TOLD_ALREADY.contains(&key.as_str()))
        {
            writeln!(f, "  {key}: {value}")?;
        }
        writeln!(f, "{}", signals(info))?;
        for (finding, joints) in alike(&self.findings) {
            match joints.len() {
                0 | 1 => writeln!(f, "  {}: {finding}", finding.severity)?,
                _ => writeln!(
                    f,
                    "  {}: {}: {}",
                    finding.severity,
                    joints.join(", "),
                    finding.told()
                )?,
            }
        }
        Ok(())
    }
}

/// Keys of the metadata that the lines before them tell.
const TOLD_ALREADY: [&str; 2] = ["joints", "sample_rate_hz"];

/// Findings that several joints share, each with its joints.
fn alike(findings: &[Finding]) -> Vec<(&Finding, Vec<&str>)> {
    let mut groups: Vec<(&Finding, Vec<&str>)> = Vec::new();
    for finding in findings {
        let same = groups.iter_mut().find(|(known, _)| {
            (known.kind, known.signal, known.told())
                == (finding.kind, finding.signal, finding.told())
        });
        let joint = finding.joint.as_deref();
        match same {
            Some((_, joints)) => joints.extend(joint),
            None => groups.push((finding, joint.into_iter().collect())),
        }
    }
    groups
}

fn timing(f: &mut fmt::Formatter<'_>, info: &RecordingInfo) -> fmt::Result {
    let timing = &info.timing;
    let measured = timing
        .measured_rate_hz
        .map_or("unknown".to_owned(), |rate_hz| format!("{rate_hz:.3} Hz"));
    writeln!(
        f,
        "  rate {:.3} Hz planned, {measured} measured, jitter {:.1} µs standard deviation, {:.1} µs at most",
        info.sample_rate_hz,
        1e6 * timing.jitter_std_s,
        1e6 * timing.jitter_max_s
    )?;
    writeln!(
        f,
        "  {} gaps with room for {} rows, {} repeated times",
        timing.gaps, timing.lost_rows, timing.repeated_times
    )
}

fn signals(info: &RecordingInfo) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(["joint", "signal", "from", "to", "step", "noise", "missing"]);
    for joint in &info.joints {
        for signal in &joint.signals {
            table.add_row([
                joint.joint.clone(),
                signal.signal.to_string(),
                format!("{:.5}", signal.minimum),
                if signal.constant {
                    "constant".to_owned()
                } else {
                    format!("{:.5}", signal.maximum)
                },
                scientific(signal.step),
                scientific(signal.noise_std),
                missing(signal),
            ]);
        }
    }
    for column in 2..7 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

fn scientific(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.3e}"))
}

fn missing(signal: &SignalInfo) -> String {
    match signal.missing_share {
        0.0 => String::new(),
        share => format!("{:.2} %", 100.0 * share),
    }
}
