//! `flexspline gap diagnose`: the report for programs, the page for people, and a summary.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use comfy_table::{Table, presets};
use gap_diagnosis::{Diagnosis, Engine, Options};
use gap_report::{DataFinding, JointReport, Report, Verdict};
use indicatif::{ProgressBar, ProgressStyle};
use recording::Recording;
use report::number;
use robot::Robot;
use serde::Serialize;

use super::beside::{Beside, beside};
use super::page;
use super::page::words::{sentence, verdict_in_words, with_value};
use crate::cli::GapDiagnoseArguments;
use crate::error::CliError;
use crate::output::{cannot_write, print, write_json, write_text};

/// A report, and the simulator beside it where there is one.
#[derive(Serialize)]
struct Told<'a> {
    #[serde(flatten)]
    report: &'a Report,
    #[serde(skip_serializing_if = "Option::is_none")]
    beside_simulator: Option<&'a Beside>,
}

/// Reads, diagnoses, writes, prints.
///
/// # Errors
/// [`CliError::Input`] for bad input: the file and what is wrong with it.
pub fn diagnose(arguments: &GapDiagnoseArguments) -> Result<(), CliError> {
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    let (recordings, mut guessed) = read_all(&arguments.recording, arguments, &robot)?;
    let robot = recorded_joints_of(&robot, &recordings)?;
    let (simulated, more) = read_all(&arguments.simulated, arguments, &robot)?;
    guessed += &more;
    let diagnosis = diagnosed(&robot, &recordings, arguments)?;
    let simulator = (!simulated.is_empty())
        .then(|| diagnosed(&robot, &simulated, arguments))
        .transpose()?;
    let simulator = simulator.map(|simulator| simulator.report);
    let beside = simulator
        .as_ref()
        .map(|simulator| beside(&diagnosis.report, simulator));
    let told = Told {
        report: &diagnosis.report,
        beside_simulator: beside.as_ref(),
    };
    if let Some(folder) = &arguments.out {
        fs::create_dir_all(folder).map_err(|error| cannot_write(folder, &error))?;
        write_json(&told, &folder.join("report.json"))?;
        if let Some(simulator) = &simulator {
            write_json(simulator, &folder.join("simulated.json"))?;
        }
        let page = page::page(&robot, &diagnosis, beside.as_ref()).to_html();
        write_text(&folder.join("report.html"), &page)?;
    }
    if let Some(path) = &arguments.json {
        write_json(&told, path)?;
    }
    if let Some(why) = nothing_to_say(&diagnosis.report) {
        return Err(CliError::Input(why));
    }
    if let Some(why) = simulator.as_ref().and_then(nothing_to_say) {
        return Err(CliError::Input(format!("--simulated: {why}")));
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    let lines = beside.map_or(String::new(), |beside| beside.lines());
    print(&(guessed + &summary(&diagnosis.report, &lines, arguments.out.as_deref())))
}

/// The robot of which only the joints that are in recordings move.
///
/// # Errors
/// [`CliError::Input`] if none of its joints was recorded.
pub fn recorded_joints_of(
    robot: &Robot,
    recordings: &[(String, Recording)],
) -> Result<Robot, CliError> {
    let recorded: Vec<&str> = recordings
        .iter()
        .flat_map(|(_, recording)| recording.joint_names())
        .collect();
    robot.moving_only(&recorded).map_err(CliError::input)
}

/// Recordings with their names, and what was guessed of them.
fn read_all(
    paths: &[PathBuf],
    arguments: &GapDiagnoseArguments,
    robot: &Robot,
) -> Result<(Vec<(String, Recording)>, String), CliError> {
    let mut recordings = Vec::new();
    let mut guessed = String::new();
    for path in paths {
        let mapping = arguments.mapping.as_deref();
        let (recording, lines) = crate::recording::read_of(path, mapping, robot, &arguments.robot)?;
        recordings.push((path.display().to_string(), recording));
        guessed += &lines;
    }
    Ok((recordings, guessed))
}

fn diagnosed(
    robot: &Robot,
    recordings: &[(String, Recording)],
    arguments: &GapDiagnoseArguments,
) -> Result<Diagnosis, CliError> {
    let bar = progress_bar(robot.joints.len());
    let options = Options {
        engine: arguments.engine.map(Engine::from),
        materiality: arguments.materiality,
    };
    let diagnosed = gap_diagnosis::diagnose(robot, recordings, &options, &|progress| {
        bar.set_position(progress.done as u64);
    });
    bar.finish_and_clear();
    diagnosed.map_err(CliError::input)
}

/// Why no joint can be diagnosed, if so: what is wrong with the data of one, or that it is not there. A joint that stands still keeps no
/// other from being told, so that it comes last.
pub fn nothing_to_say(report: &Report) -> Option<String> {
    let mut joints = report.joints.iter();
    if !joints.all(|joint| joint.verdict == Verdict::InsufficientData) {
        return None;
    }
    let because = |joint: &JointReport| {
        let mut findings = report.data.iter();
        let why = findings.find(|finding| {
            joint.reason.contains(&finding.what) || finding.what.starts_with(&joint.reason)
        });
        let order = match why {
            Some(finding) if finding.severity == "error" => 0,
            None => 1,
            Some(_) => 2,
        };
        let reason = || format!("{}: {}", joint.joint, joint.reason);
        (order, why.map_or_else(reason, ToString::to_string))
    };
    let (_, reason) = report
        .joints
        .iter()
        .map(because)
        .min_by_key(|(order, _)| *order)?;
    Some(reason)
}

/// What the command prints: a sentence, a line a joint, and what is to be known of the data. `beside`: lines about the simulator;
/// `out`: the folder in which the report is.
pub fn summary(report: &Report, beside: &str, out: Option<&Path>) -> String {
    let mut text = format!("{}\n", sentence(report));
    let mut rows = Table::new();
    rows.load_preset(presets::UTF8_HORIZONTAL_ONLY).set_header([
        "joint",
        "verdict",
        "effects, share of the gap",
        "torque rms, Nm: before",
        "after",
        "noise floor",
        "shrink",
    ]);
    for joint in page::largest_first(report) {
        rows.add_row(row(report, joint));
    }
    let _ = writeln!(text, "{rows}");
    for joint in &report.joints {
        if matches!(
            joint.verdict,
            Verdict::Unexplained | Verdict::InsufficientData
        ) {
            let (name, reason) = (&joint.joint, &joint.reason);
            let verdict = verdict_in_words(joint.verdict);
            let _ = writeln!(text, "{name}: {verdict}: {reason}");
        }
    }
    text += beside;
    for (finding, joints) in told_once(&report.data) {
        let on = if joints.len() < 2 {
            String::new()
        } else {
            format!(" ({})", joints.join(", "))
        };
        let finding = DataFinding {
            joint: finding.joint.clone().filter(|_| on.is_empty()),
            ..finding.clone()
        };
        let _ = writeln!(text, "{}{on}: {finding}", finding.severity);
    }
    if let Some(folder) = out {
        let _ = writeln!(text, "report: {}", folder.join("report.html").display());
    }
    text
}

/// Findings, what is the same of several joints only once, with the joints.
fn told_once(findings: &[DataFinding]) -> Vec<(&DataFinding, Vec<&str>)> {
    let mut all: Vec<(&DataFinding, Vec<&str>)> = Vec::new();
    for finding in findings {
        let same = all.iter_mut().find(|(known, _)| {
            (&known.severity, &known.what, &known.remedy)
                == (&finding.severity, &finding.what, &finding.remedy)
        });
        let joint = finding.joint.as_deref();
        match same {
            Some((_, joints)) => joints.extend(joint),
            None => all.push((finding, joint.into_iter().collect())),
        }
    }
    all
}

fn row(report: &Report, joint: &JointReport) -> [String; 7] {
    let mut effects = page::with_shares(report, joint);
    let minor = joint.minor_effects.iter();
    effects.extend(minor.map(|found| format!("minor: {}", with_value(found))));
    effects.extend(page::unit_taken(joint));
    let torque = &joint.gap.torque_rms_nm;
    [
        joint.joint.clone(),
        verdict_in_words(joint.verdict).to_owned(),
        effects.join("\n"),
        number(torque.before, 3),
        number(torque.after, 3),
        number(torque.noise_floor, 3),
        number(joint.gap.shrink, 3),
    ]
}

/// In joints.
fn progress_bar(joints: usize) -> ProgressBar {
    let bar = ProgressBar::new(joints as u64);
    let template = "{bar:32} {pos} of {len} joints, {eta} left";
    bar.set_style(
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar
}
