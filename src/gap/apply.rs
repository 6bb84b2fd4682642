//! `flexspline gap apply`: a robot file with the diagnosed effects in it, everything else as it was written.

pub mod links;
mod remaining;
mod simulator;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use gap_report::{JointReport, NamedEffect, Parameter, Report};
use robot::{Effect, EffectKind, Robot, RobotFile, Simulator, Source};
use serde::Serialize;
use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item, Table, TableLike, Value};

use crate::cli::{ApplyFormat, GapApplyArguments};
use crate::error::CliError;
use crate::output::{print, write_json, write_text};

/// A robot file's numbers carry no more digits than a fit is worth.
const DIGITS: usize = 6;

/// One change of the file, as it is told.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// None for the whole arm.
    pub joint: Option<String>,
    /// Its name.
    pub effect: &'static str,
    /// What was done, in words.
    pub done: String,
}

/// For programs.
#[derive(Serialize)]
struct Applied<'a> {
    schema: u32,
    robot_file: &'a Path,
    changes: &'a [Change],
    /// The URDF or MuJoCo model that the new robot file names, where that is new too.
    #[serde(skip_serializing_if = "Option::is_none")]
    description: Option<&'a Path>,
    /// What of the rest no table holds.
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    left_out: &'a [String],
}

/// Reads report and robot, writes the new file, tells what was changed.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if the report names no effect.
pub fn apply(arguments: &GapApplyArguments) -> Result<(), CliError> {
    let report = read_report(&arguments.report)?;
    let simulator = match arguments.format {
        ApplyFormat::Toml => None,
        ApplyFormat::Mjcf => Some(Simulator::Mjcf),
        ApplyFormat::Urdf => Some(Simulator::Urdf),
        ApplyFormat::Isaaclab => Some(Simulator::IsaacLab),
    };
    if let Some(simulator) = simulator {
        return simulator::apply(arguments, &report, simulator);
    }
    let (text, source) = robot::load_text(&arguments.robot).map_err(CliError::input)?;
    let robot = RobotText {
        text: &text,
        source: &source,
        name: &arguments.robot,
    };
    let report_name = arguments.report.display().to_string();
    let out = Some(arguments.out.as_path());
    let mended = mended(&robot, report, &report_name, arguments.remaining, out)?;
    mended.save(&source, &arguments.out)?;
    tell(arguments, &mended)
}

/// Writes a robot file that came from there; what it names is then named from where it is.
///
/// # Errors
/// [`CliError::Input`] if it cannot be written.
pub fn save(text: &str, source: &Source, out: &Path) -> Result<(), CliError> {
    let text = with_description(text.to_owned(), source, out)?;
    write_text(out, &text)
}

/// A robot file as it is written.
#[derive(Clone, Copy, Debug)]
pub struct RobotText<'a> {
    /// Its text.
    pub text: &'a str,
    /// Where it came from.
    pub source: &'a Source,
    /// What errors call it.
    pub name: &'a str,
}

/// A robot file with a report's effects in it.
#[derive(Clone, Debug)]
pub struct Mended {
    /// Everything else as it was written. A URDF or a MuJoCo model is named from where the robot file was.
    pub text: String,
    /// What was changed.
    pub changes: Vec<Change>,
    /// What of the rest no table holds, in sentences.
    pub left_out: Vec<String>,
    /// What the file is to name instead of the description that it names.
    pub description: Option<links::NewDescription>,
}

impl Mended {
    /// Writes the robot file, and the description beside it that is new.
    fn save(&self, source: &Source, out: &Path) -> Result<(), CliError> {
        let Some(new) = &self.description else {
            return save(&self.text, source, out);
        };
        write_text(&new.path, &new.text)?;
        let mut document: DocumentMut = self.text.parse().map_err(CliError::input)?;
        let name = new.path.file_name().unwrap_or_default().to_string_lossy();
        document[new.key] = toml_edit::value(name.into_owned());
        write_text(out, &document.to_string())
    }
}

/// Adds a report's effects to a robot file, with `remaining` also what has no name, as tables. `report_name` is what errors call the
/// report. Links of a URDF or a MuJoCo model go into a new one, which is to lie beside `out`; without that they are left out.
///
/// # Errors
/// [`CliError::Input`] if the report does not fit the robot, [`CliError::Negative`] if it names no effect.
pub fn mended(
    robot: &RobotText<'_>,
    mut report: Report,
    report_name: &str,
    remaining: bool,
    out: Option<&Path>,
) -> Result<Mended, CliError> {
    let file = RobotFile::parse(robot.text, robot.name).map_err(CliError::input)?;
    check_name([report_name, robot.name], &report, &file.name)?;
    let built = file.clone().build(robot.source.clone());
    let built = built.map_err(CliError::input)?;
    put_payloads_on_last_link(&mut report, &built);
    let refuse =
        |reason: String| CliError::Input(format!("{report_name} with {}: {reason}", robot.name));
    let text = with_joint_tables(robot.text, file, &built).map_err(refuse)?;
    let links = links::with_links(&text, &built, &report, out).map_err(refuse)?;
    let impossible = take_impossible(&mut report, &links.text, robot);
    let (text, mut changes) = with_effects(&links.text, &report).map_err(refuse)?;
    changes.extend(links.changes);
    let mut mended = Mended {
        text,
        changes,
        description: links.description,
        left_out: sensors(&report)
            .chain(impossible)
            .chain(links.left_out)
            .collect(),
    };
    if remaining {
        let rest = remaining::with_remaining(&mended.text, &report).map_err(refuse)?;
        mended.text = rest.text;
        mended.changes.extend(rest.changes);
        mended.left_out.extend(rest.left_out);
    }
    if mended.changes.is_empty() {
        return Err(names_nothing(report_name, &report));
    }
    check(&mended.text, robot)?;
    Ok(mended)
}

fn names_nothing(report_name: &str, report: &Report) -> CliError {
    CliError::Negative(match sensors(report).next() {
        Some(of_sensor) => format!("{report_name}: nothing to add: {of_sensor}"),
        None if !report.links.is_empty() => {
            format!("{report_name}: nothing to add: {}", links::BY_HAND)
        }
        None => format!("{report_name}: names no effect, so there is nothing to add"),
    })
}

/// Whether the report is about this robot.
fn check_name(
    [report_name, robot_name]: [&str; 2],
    report: &Report,
    name: &str,
) -> Result<(), CliError> {
    if name == report.robot {
        return Ok(());
    }
    Err(CliError::Input(format!(
        "{report_name}: is about robot `{}`, --robot {robot_name} is `{name}`; give the robot file that was diagnosed",
        report.robot,
    )))
}

/// Reads a report that somebody else may have written.
///
/// # Errors
/// [`CliError::Input`] with file, field and value.
pub fn read_report(path: &Path) -> Result<Report, CliError> {
    let refuse = |reason: String| {
        CliError::Input(format!(
            "{}: {reason}; give a report.json of `gap diagnose`",
            path.display()
        ))
    };
    let text = fs::read_to_string(path).map_err(|error| refuse(error.to_string()))?;
    Report::from_json(&text).map_err(|error| refuse(error.to_string()))
}

fn tell(arguments: &GapApplyArguments, mended: &Mended) -> Result<(), CliError> {
    let (changes, left_out) = (&mended.changes, &mended.left_out);
    let description = mended.description.as_ref().map(|new| new.path.as_path());
    if let Some(path) = &arguments.json {
        let applied = Applied {
            schema: 1,
            robot_file: &arguments.out,
            changes,
            description,
            left_out,
        };
        write_json(&applied, path)?;
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    let mut text = String::new();
    for change in changes {
        let on = change.joint.as_deref().unwrap_or("arm");
        let _ = writeln!(text, "{on}: {}: {}", change.effect, change.done);
    }
    for sentence in left_out {
        let _ = writeln!(text, "{sentence}");
    }
    if let Some(path) = description {
        let _ = writeln!(text, "its bodies: {}", path.display());
    }
    let _ = writeln!(text, "robot file: {}", arguments.out.display());
    print(&text)
}

/// A payload was found in the frame of the last joint that was diagnosed, and a file has it in that of its last link: a gripper
/// that nobody recorded may be between them.
fn put_payloads_on_last_link(report: &mut Report, robot: &Robot) {
    let joints = report.joints.iter();
    let names: Vec<String> = joints.map(|joint| joint.joint.clone()).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let shared = report.shared_effects.iter_mut();
    let own = report.joints.iter_mut();
    let own = own.flat_map(|joint| joint.effects.iter_mut().chain(&mut joint.minor_effects));
    for found in shared.map(|shared| &mut shared.effect).chain(own) {
        let Ok(Effect::Payload { centre_m, .. }) = to_effect(found) else {
            continue;
        };
        let centre_m = robot.in_last_link(&names, centre_m);
        let places = [("x", 0), ("y", 1), ("z", 2)];
        let stated = found.parameters.remove("centre_m");
        for (axis, index) in places {
            let parameter = found.parameters.entry(format!("centre_m_{axis}"));
            let parameter = parameter.or_insert(stated.unwrap_or(Parameter {
                value: 0.0,
                std: 0.0,
                at_bound: false,
            }));
            parameter.value = centre_m[index];
        }
    }
}

/// Takes from a report the link inertias and payloads that no link of the robot can have, and says which: a joint that moves less inertia
/// than the file tells may do so for any body that it carries, and its own link has not as much to spare; and no more can be missing at an
/// arm's end than its last link is.
fn take_impossible(report: &mut Report, text: &str, robot: &RobotText<'_>) -> Vec<String> {
    let mut none = report.clone();
    none.shared_effects.clear();
    for joint in &mut none.joints {
        joint.effects.clear();
        joint.minor_effects.clear();
    }
    let is_possible = |alone: &Report| {
        let written = with_effects(text, alone);
        written.is_ok_and(|(text, _)| check(&text, robot).is_ok())
    };
    let mut left_out = Vec::new();
    let mut can_be = |found: &NamedEffect, on: &str, alone: &dyn Fn() -> Report| {
        let why = match to_effect(found) {
            Ok(Effect::LinkInertia { inertia_kg_m2 }) => format!(
                "{on}: {inertia_kg_m2:+.3e} kg m² of inertia are left out: its own link has not as much, so bodies that it carries are lighter \
                 than the file tells"
            ),
            Ok(Effect::Payload { mass_kg, .. }) => format!(
                "{on}: a payload of {mass_kg:+.3} kg is left out: the last link has not as much, so bodies before it are lighter than the file \
                 tells, or none of it is there"
            ),
            _ => return true,
        };
        let can_be = is_possible(&alone());
        left_out.extend((!can_be).then_some(why));
        can_be
    };
    report.shared_effects.retain(|shared| {
        can_be(&shared.effect, "arm", &|| Report {
            shared_effects: vec![shared.clone()],
            ..none.clone()
        })
    });
    for (place, joint) in report.joints.iter_mut().enumerate() {
        let name = &joint.joint;
        let mut of_joint = |found: &NamedEffect| {
            can_be(found, name, &|| {
                let mut alone = none.clone();
                alone.joints[place].effects = vec![found.clone()];
                alone
            })
        };
        joint.effects.retain(&mut of_joint);
        joint.minor_effects.retain(&mut of_joint);
    }
    left_out
}

/// What comes of it must be what every other command takes.
fn check(text: &str, robot: &RobotText<'_>) -> Result<(), CliError> {
    RobotFile::parse(text, robot.name)
        .and_then(|file| file.build(robot.source.clone()))
        .map(|_| ())
        .map_err(|error| {
            CliError::Input(format!(
                "the report's effects make a robot that nobody can have, so nothing was written: {error}"
            ))
        })
}

/// A URDF or a MuJoCo model is named relative to its robot file; from another folder it needs its whole path.
fn with_description(text: String, source: &Source, out: &Path) -> Result<String, CliError> {
    let Source::File(from) = source else {
        return Ok(text);
    };
    let folder = |path: &Path| path.parent().map(Path::to_owned).unwrap_or_default();
    let mut document: DocumentMut = text.parse().map_err(CliError::input)?;
    let named = ["urdf", "mjcf"]
        .into_iter()
        .find_map(|key| Some((key, document.get(key)?.as_str()?)));
    let Some((key, name)) = named else {
        return Ok(text);
    };
    if folder(from) == folder(out) {
        return Ok(text);
    }
    let whole = fs::canonicalize(folder(from).join(name))
        .map_err(|error| CliError::Input(format!("{}: {key} {name}: {error}", from.display())))?;
    document[key] = toml_edit::value(whole.display().to_string());
    Ok(document.to_string())
}

/// The text of a robot file with what its description alone says of joints: a table for each joint, where it has none, else rotor and
/// effects that a joint's table leaves to the description. Effects go into tables, and what a table has the description says no more.
/// The file's own text stays as it was.
///
/// # Errors
/// Why they cannot be written.
pub fn with_joint_tables(text: &str, file: RobotFile, built: &Robot) -> Result<String, String> {
    if !file.joints.is_empty() {
        return with_described(text, built);
    }
    let whole = RobotFile {
        joints: built.joints.clone(),
        ..file
    };
    let whole = whole.to_toml().map_err(|error| error.to_string())?;
    let mut whole: DocumentMut = whole
        .parse()
        .map_err(|error| format!("robot file: {error}"))?;
    whole.retain(|key, _| key == "joint");
    Ok(format!(
        "{}\n\n{}",
        text.trim_end(),
        whole.to_string().trim_start()
    ))
}

fn with_described(text: &str, built: &Robot) -> Result<String, String> {
    let mut document: DocumentMut = text
        .parse()
        .map_err(|error| format!("robot file: {error}"))?;
    for joint in &built.joints {
        // of a joint without a table nothing is told
        let Ok(table) = joint_table(&mut document, &joint.name) else {
            continue;
        };
        let inertia_kg_m2 = joint.rotor_inertia_kg_m2;
        if inertia_kg_m2 != 0.0 && !table.contains_key("rotor_inertia_kg_m2") {
            add_to_number(table, "rotor_inertia_kg_m2", inertia_kg_m2);
        }
        for effect in &joint.effects {
            let name = Some(effect.name());
            let is_there = table.get_mut("effects").is_some_and(|list| {
                let mut kinds = entries(list).into_iter();
                kinds.any(|entry| entry.get("effect").and_then(Item::as_str) == name)
            });
            if !is_there {
                add_to_list(table, "effects", effect)?;
            }
        }
    }
    Ok(document.to_string())
}

/// The text of a robot file with a report's effects in it, and what was changed.
///
/// # Errors
/// Why the report's effects do not fit the file.
pub fn with_effects(text: &str, report: &Report) -> Result<(String, Vec<Change>), String> {
    let mut document: DocumentMut = text
        .parse()
        .map_err(|error| format!("robot file: {error}"))?;
    let mut changes = Vec::new();
    for shared in &report.shared_effects {
        let effect = to_effect(&shared.effect)?;
        if effect.may_be_shared() {
            let done = add_to_list(document.as_table_mut(), "shared_effects", &effect)?;
            changes.push(Change {
                joint: None,
                effect: effect.name(),
                done,
            });
            continue;
        }
        for joint in &shared.joints {
            changes.push(add_to_joint(&mut document, joint, &effect)?);
        }
    }
    for joint in &report.joints {
        for (_, effect) in effects_of(joint)? {
            changes.push(add_to_joint(&mut document, &joint.joint, &effect)?);
        }
    }
    Ok((document.to_string(), changes))
}

const OF_SENSOR: &str =
    "it is the torque sensor's; correct it in the mapping file, as a note of the report tells";

/// What is left out of the files, in sentences: what a torque sensor is wrong by is no effect of the joint.
fn sensors(report: &Report) -> impl Iterator<Item = String> {
    let joints = report.joints.iter();
    let named = joints.flat_map(|joint| joint.named().map(move |found| (joint, found)));
    let of_sensors = named.filter(|(joint, found)| joint.is_of_sensor(&found.effect));
    of_sensors
        .map(|(joint, found)| format!("{}: {}: left out, {OF_SENSOR}", joint.joint, found.effect))
}

/// What is named of a joint, in the motor's newton metres. All were fitted together: without the small ones the large ones are wrong.
fn effects_of(joint: &JointReport) -> Result<Vec<(&NamedEffect, Effect)>, String> {
    let named = joint.named();
    let named = named.filter(|found| !found.of_links && !joint.is_of_sensor(&found.effect));
    named
        .map(|found| Ok((found, at_motor(joint, found)?)))
        .collect()
}

/// A joint's effect with the values found, in the motor's newton metres.
///
/// # Errors
/// Which parameter is missing or unknown.
pub fn at_motor(joint: &JointReport, found: &NamedEffect) -> Result<Effect, String> {
    let mut own = found.clone();
    let parameters = EffectKind::named(&found.effect).map_or(&[][..], EffectKind::parameters);
    for parameter in parameters.iter().filter(|of| of.is_of_torque()) {
        if let Some(value) = own.parameters.get_mut(parameter.name) {
            value.value *= joint.motor_per_recorded();
        }
    }
    to_effect(&own)
}

/// The effect with the values found. A point's coordinates are parameters of their own.
///
/// # Errors
/// Which parameter is missing or unknown.
pub fn to_effect(found: &NamedEffect) -> Result<Effect, String> {
    let mut fields: BTreeMap<String, serde_json::Value> = BTreeMap::new();
    fields.insert("effect".to_owned(), found.effect.clone().into());
    for (name, parameter) in &found.parameters {
        let value = serde_json::Value::from(rounded(parameter.value));
        match name.rsplit_once('_') {
            Some((point, axis @ ("x" | "y" | "z"))) => {
                let point = fields
                    .entry(point.to_owned())
                    .or_insert_with(|| vec![0.0; 3].into());
                // a report may have the distance along z under the point's own name
                if !point.is_array() {
                    *point = vec![0.0; 3].into();
                }
                point[usize::from(axis.as_bytes()[0] - b'x')] = value;
            }
            _ => {
                fields.insert(name.clone(), value);
            }
        }
    }
    if let Some(side) = &found.side {
        fields.insert("side".to_owned(), side.clone().into());
    }
    let fields = fields.into_iter().collect::<serde_json::Map<_, _>>();
    serde_json::from_value(fields.into()).map_err(|error| format!("{}: {error}", found.effect))
}

fn rounded(value: f64) -> f64 {
    format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value)
}

/// A joint's table in the robot file.
fn joint_table<'a>(document: &'a mut DocumentMut, joint: &str) -> Result<&'a mut Table, String> {
    let tables = document
        .get_mut("joint")
        .and_then(Item::as_array_of_tables_mut)
        .ok_or("the robot file's joints are not [[joint]] tables; write them so")?;
    tables
        .iter_mut()
        .find(|table| table.get("name").and_then(Item::as_str) == Some(joint))
        .ok_or_else(|| {
            format!(
                "joint `{joint}` is not in the robot file; give the robot file that was diagnosed"
            )
        })
}

fn add_to_joint(
    document: &mut DocumentMut,
    joint: &str,
    effect: &Effect,
) -> Result<Change, String> {
    let table = joint_table(document, joint)?;
    let done = match effect {
        // the file has a value of its own for it
        Effect::RotorInertia { inertia_kg_m2 } => {
            add_to_number(table, "rotor_inertia_kg_m2", *inertia_kg_m2)
        }
        _ => add_to_list(table, "effects", effect)?,
    };
    Ok(Change {
        joint: Some(joint.to_owned()),
        effect: effect.name(),
        done,
    })
}

fn add_to_number(table: &mut dyn TableLike, key: &str, change: f64) -> String {
    let before = table.get(key).map_or(0.0, float);
    let after = rounded(before + change);
    put_number(table, key, after);
    format!("{key} {before} -> {after}")
}

fn put_number(table: &mut dyn TableLike, key: &str, after: f64) {
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(value) => {
            let decor = value.decor().clone();
            *value = after.into();
            *value.decor_mut() = decor;
        }
        None => {
            table.insert(key, toml_edit::value(after));
        }
    }
}

fn float(item: &Item) -> f64 {
    let integer = || item.as_integer().map(|value| value as f64);
    item.as_float().or_else(integer).unwrap_or(0.0)
}

/// Adds to the entry of the same kind where the two add up, else a new entry, in the form the list has.
fn add_to_list(table: &mut Table, key: &str, effect: &Effect) -> Result<String, String> {
    let text = effect.to_toml().map_err(|error| error.to_string())?;
    let entry: DocumentMut = text
        .parse()
        .map_err(|error| format!("{}: {error}", effect.name()))?;
    let list = table
        .entry(key)
        .or_insert_with(|| toml_edit::value(Array::new()));
    let same = |known: &&mut dyn TableLike| {
        known.get("effect").and_then(Item::as_str) == Some(effect.name())
    };
    let parameters = effect.kind().parameters();
    if parameters.iter().all(|parameter| parameter.adds_up)
        && let Some(known) = entries(list).into_iter().find(same)
    {
        let changes = parameters.iter().map(|parameter| {
            let change = entry.get(parameter.name).map_or(0.0, float);
            add_to_number(known, parameter.name, change)
        });
        return Ok(changes.collect::<Vec<_>>().join(", "));
    }
    let told = text.trim().lines().skip(1).collect::<Vec<_>>().join(", ");
    push(list, entry.as_table().clone())
        .ok_or_else(|| format!("{key} of the robot file is no list; write it as one"))?;
    Ok(format!("added, {told}"))
}

/// A list's entries, however they are written.
fn entries(list: &mut Item) -> Vec<&mut dyn TableLike> {
    match list {
        Item::Value(Value::Array(array)) => array
            .iter_mut()
            .filter_map(Value::as_inline_table_mut)
            .map(|entry| entry as &mut dyn TableLike)
            .collect(),
        Item::ArrayOfTables(tables) => tables
            .iter_mut()
            .map(|entry| entry as &mut dyn TableLike)
            .collect(),
        _ => Vec::new(),
    }
}

fn push(list: &mut Item, entry: Table) -> Option<()> {
    match list {
        Item::Value(Value::Array(array)) => push_inline(array, entry.into_inline_table()),
        Item::ArrayOfTables(tables) => push_table(tables, entry),
        _ => return None,
    }
    Some(())
}

/// On a line of its own where the others have theirs.
fn push_inline(array: &mut Array, mut entry: InlineTable) {
    entry.fmt();
    let before = array.iter().last().map(|last| last.decor().clone());
    array.push(entry);
    if let (Some(decor), Some(last)) = (before, array.iter_mut().last())
        && let Some(prefix) = decor.prefix().and_then(|prefix| prefix.as_str())
    {
        // a comment behind the entry before it stays with that one
        let own = prefix.rsplit('\n').next().unwrap_or_default();
        let prefix = if prefix.contains('\n') {
            format!("\n{own}")
        } else {
            " ".to_owned()
        };
        last.decor_mut().set_prefix(prefix);
    }
}

fn push_table(tables: &mut ArrayOfTables, entry: Table) {
    tables.push(entry);
}

#[cfg(test)]
pub mod tests;
