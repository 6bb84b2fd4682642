//! `flexspline gap repeats`: which recordings are repeats of one input, how far they scatter, and which of them differ.

use std::fmt::Write;
use std::path::Path;

use comfy_table::{CellAlignment, Table, presets};
use recording::Recording;
use recording::repeats::{FALSE_ALARMS, Group, JointDeviation, JointScatter, Repeat, repeats};
use report::number;
use serde::Serialize;

use crate::cli::GapRepeatsArguments;
use crate::error::CliError;
use crate::output::{print, write_json};

/// For programs.
#[derive(Serialize)]
struct Told {
    schema: u32,
    /// Of groups whose repeats are alike, the part in which one is said to differ.
    false_alarm_rate: f64,
    groups: Vec<Group>,
    /// Recordings of which nothing is in a group.
    alone: Vec<String>,
}

/// Reads, judges, prints.
///
/// # Errors
/// [`CliError::Input`] for bad input, and where no input was repeated often enough.
pub fn tell(arguments: &GapRepeatsArguments) -> Result<(), CliError> {
    let recordings = arguments
        .recording
        .iter()
        .map(|path| super::read(path))
        .collect::<Result<Vec<_>, _>>()?;
    let told = Told::of(&recordings)?;
    if let Some(path) = &arguments.json {
        write_json(&told, path)?;
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    print(&told.in_words())
}

impl Told {
    fn of(recordings: &[(String, Recording)]) -> Result<Self, CliError> {
        let groups = repeats(recordings).map_err(CliError::input)?;
        let is_alone = |name: &&String| {
            let mut all = groups.iter().flat_map(|group| &group.repeats);
            !all.any(|repeat| repeat.recording == **name)
        };
        let names = recordings.iter().map(|(name, _)| name);
        let alone = names.filter(is_alone).cloned().collect();
        Ok(Self {
            schema: 1,
            false_alarm_rate: FALSE_ALARMS,
            groups,
            alone,
        })
    }

    fn in_words(&self) -> String {
        let groups: Vec<String> = self.groups.iter().map(of_group).collect();
        let mut text = groups.join("\n");
        if !self.alone.is_empty() {
            let _ = writeln!(
                text,
                "\nnot repeated often enough: {}",
                self.alone.join(", ")
            );
        }
        text
    }
}

fn of_group(group: &Group) -> String {
    let input: Vec<&str> = group.input.iter().map(|signal| signal.name()).collect();
    let mut text = format!(
        "{} repeats of one input ({}), {} s at {} Hz: {}\n",
        group.repeats.len(),
        input.join(", "),
        number(group.seconds, 3),
        number(group.sample_rate_hz, 4),
        verdict(group)
    );
    let _ = writeln!(text, "{}", scatter(group));
    let _ = writeln!(text, "{}", each(group));
    let _ = writeln!(
        text,
        "a lasting deviation is found from about {} scatters on",
        number(group.found_from_scatters, 2)
    );
    text
}

fn verdict(group: &Group) -> String {
    let differ: Vec<&str> = group
        .repeats
        .iter()
        .filter(|repeat| repeat.differs)
        .map(|repeat| repeat.recording.as_str())
        .collect();
    let drifting: Vec<&str> = group
        .joints
        .iter()
        .filter(|joint| joint.order.is_some_and(|order| order.drifts))
        .map(|joint| joint.joint.as_str())
        .collect();
    let mut text = match differ.len() {
        0 => "no gap against each other".to_owned(),
        1 => format!("{} differs from the others", differ[0]),
        _ => format!("{} differ from the others", differ.join(", ")),
    };
    if !drifting.is_empty() {
        let _ = write!(
            text,
            "; drift from repeat to repeat: {}",
            drifting.join(", ")
        );
    }
    text
}

/// Of the repeats that are alike.
fn scatter(group: &Group) -> Table {
    let mut rows = table(&[
        "joint",
        "signal",
        "scatter, rms",
        "at the start",
        "at the end",
        "next to any",
    ]);
    for joint in &group.joints {
        for (line, signal) in joint.signals.iter().enumerate() {
            let first = |text: String| if line == 0 { text } else { String::new() };
            rows.add_row([
                first(joint.joint.clone()),
                signal.signal.name().to_owned(),
                number(signal.rms, 3),
                number(signal.rms_at_start, 3),
                number(signal.rms_at_end, 3),
                first(order(joint)),
            ]);
        }
    }
    for column in rows.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    rows
}

fn order(joint: &JointScatter) -> String {
    match joint.order {
        Some(order) if order.drifts => format!("{}, drifts", number(order.next_to_any, 2)),
        Some(order) => number(order.next_to_any, 2),
        None if joint.stands => "stands".to_owned(),
        None => "-".to_owned(),
    }
}

/// Every repeat with the joint that deviates least probably.
fn each(group: &Group) -> Table {
    let mut rows = table(&[
        "repeat",
        "from, s",
        "verdict",
        "most at",
        "signal",
        "between, s",
        "over scatter",
        "probability",
    ]);
    for repeat in &group.repeats {
        let verdict = if repeat.differs { "differs" } else { "no gap" };
        let mut row = vec![
            repeat.recording.clone(),
            number(repeat.from_s, 4),
            verdict.to_owned(),
        ];
        row.extend(most(repeat).map_or_else(|| vec!["-".to_owned(); 5], columns));
        rows.add_row(row);
    }
    for column in rows.column_iter_mut().skip(6) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    rows
}

fn most(repeat: &Repeat) -> Option<&JointDeviation> {
    let joints = repeat.joints.iter();
    joints.min_by(|a, b| a.probability.total_cmp(&b.probability))
}

fn columns(deviation: &JointDeviation) -> Vec<String> {
    vec![
        deviation.joint.clone(),
        deviation.signal.name().to_owned(),
        format!(
            "{} to {}",
            number(deviation.from_s, 3),
            number(deviation.to_s, 3)
        ),
        number(deviation.in_scatters, 3),
        number(deviation.probability, 2),
    ]
}

fn table(titles: &[&str]) -> Table {
    let mut rows = Table::new();
    rows.load_preset(presets::UTF8_HORIZONTAL_ONLY)
        .set_header(titles.to_vec());
    rows
}
