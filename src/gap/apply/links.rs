//! The links' masses, centres and inertias that torques ask for: in a robot file's `[[link]]` tables, or in the description that it names,
//! which becomes a file of its own; with what the file says hangs on the links.

use std::path::{Path, PathBuf};

use gap_report::Report;
use joint_model::rigid_body::Link;
use robot::{Effect, MassChange, Reshaping, Robot, RobotFile};
use toml_edit::{DocumentMut, Item, TableLike};

use super::{Change, entries, float, put_number};
use crate::gap::apply::Mended;

/// What is told where nothing can be written.
pub const BY_HAND: &str =
    "it is what the links weigh; change that in the description, as a warning of the report tells";

/// So many digits read back as a sum of several bodies within a billionth.
const DIGITS: usize = 12;

/// A URDF or a MuJoCo model that a robot file names from now on.
#[derive(Clone, Debug)]
pub struct NewDescription {
    /// The key of the robot file that names it.
    pub key: &'static str,
    /// Where it is to lie.
    pub path: PathBuf,
    /// What is in it.
    pub text: String,
}

/// What becomes of the robot's links; none where the report has no changes.
///
/// # Errors
/// Why the robot cannot have them.
pub fn reshaping(report: &Report, robot: &Robot) -> Result<Option<Reshaping>, String> {
    let changes = report.links.iter().map(|change| MassChange {
        joint: change.joint.clone(),
        mass_kg: change.mass_kg.value,
        centre_of_mass_m: change.centre_of_mass_m.each_ref().map(|of| of.value),
        inertia_part: change.inertia_part.value,
    });
    let changes: Vec<MassChange> = changes.collect();
    let by = (!changes.is_empty()).then(|| robot.reshaping(&changes));
    by.transpose().map_err(|error| error.to_string())
}

/// A robot file with the links' values changed. A description that it names goes beside `out`; without that, the links stay as they are,
/// and that is said.
///
/// # Errors
/// Why they cannot be written.
pub fn with_links(
    text: &str,
    robot: &Robot,
    report: &Report,
    out: Option<&Path>,
) -> Result<Mended, String> {
    let mut mended = Mended {
        text: text.to_owned(),
        changes: Vec::new(),
        left_out: Vec::new(),
        description: None,
    };
    let Some(by) = reshaping(report, robot)? else {
        return Ok(mended);
    };
    let file = RobotFile::parse(text, &robot.name).map_err(|error| error.to_string())?;
    let mut document: DocumentMut = text
        .parse()
        .map_err(|error| format!("robot file: {error}"))?;
    if file.links.is_empty() {
        mended.description = out
            .map(|out| described(&file, robot, &by, out))
            .transpose()?
            .flatten();
        if mended.description.is_none() {
            let left_out = format!("the links are left out: {BY_HAND}");
            mended.left_out.push(left_out);
            return Ok(mended);
        }
    } else {
        let reshaped = robot.reshaped(&by).map_err(|error| error.to_string())?;
        let tables = document.get_mut("link").map(entries);
        for table in tables.into_iter().flatten() {
            let joint = table.get("joint").and_then(Item::as_str);
            if let Some(index) = joint.and_then(|joint| robot.joint_index(joint)) {
                put_link(table, &reshaped.chain.links()[index]);
            }
        }
    }
    put_effects(document.as_table_mut(), "shared_effects", None, &by);
    let joints = document.get_mut("joint").map(entries);
    for table in joints.into_iter().flatten() {
        let joint = table.get("name").and_then(Item::as_str);
        let index = joint.and_then(|joint| robot.joint_index(joint));
        put_effects(table, "effects", index, &by);
    }
    let told = by.told().map(|(joint, done)| Change {
        joint: Some(joint.to_owned()),
        effect: "link",
        done,
    });
    mended.changes = told.collect();
    mended.text = document.to_string();
    Ok(mended)
}

fn described(
    file: &RobotFile,
    robot: &Robot,
    by: &Reshaping,
    out: &Path,
) -> Result<Option<NewDescription>, String> {
    let (key, ending) = match &file.urdf {
        Some(_) => ("urdf", "urdf"),
        None => ("mjcf", "xml"),
    };
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let path = out.with_file_name(format!("{stem}_links.{ending}"));
    let text = robot::reshaped_description(file, &robot.source, by, &path);
    let text = text.map_err(|error| error.to_string())?;
    Ok(text.map(|text| NewDescription { key, path, text }))
}

fn put_link(table: &mut dyn TableLike, link: &Link) {
    put(table, "mass_kg", link.mass_kg);
    put_point(table, "centre_of_mass_m", link.centre_of_mass_m.as_ref());
    let inertia = table.get_mut("inertia_kg_m2");
    if let Some(inertia) = inertia.and_then(Item::as_table_like_mut) {
        let axes = [
            ("xx", 0, 0),
            ("yy", 1, 1),
            ("zz", 2, 2),
            ("xy", 0, 1),
            ("yz", 1, 2),
            ("xz", 0, 2),
        ];
        for (key, row, column) in axes {
            if inertia.contains_key(key) {
                put(inertia, key, link.inertia_kg_m2[(row, column)]);
            }
        }
    }
}

/// What hangs on links is part of what was told of them.
fn put_effects(table: &mut dyn TableLike, key: &str, joint: Option<usize>, by: &Reshaping) {
    for entry in table.get_mut(key).map(entries).into_iter().flatten() {
        match entry.get("effect").and_then(Item::as_str) {
            Some("payload") => {
                let centre = entry.get("centre_m").and_then(Item::as_array);
                let at = |k: usize| centre.and_then(|centre| centre.get(k)).map_or(0.0, number);
                let mass_kg = entry.get("mass_kg").map_or(0.0, float);
                let centre_m = [at(0), at(1), at(2)];
                if let Effect::Payload { mass_kg, centre_m } =
                    by.effect(joint, &Effect::Payload { mass_kg, centre_m })
                {
                    put(entry, "mass_kg", mass_kg);
                    put_point(entry, "centre_m", &centre_m);
                }
            }
            Some("link_inertia") => {
                let inertia_kg_m2 = entry.get("inertia_kg_m2").map_or(0.0, float);
                if let Effect::LinkInertia { inertia_kg_m2 } =
                    by.effect(joint, &Effect::LinkInertia { inertia_kg_m2 })
                {
                    put(entry, "inertia_kg_m2", inertia_kg_m2);
                }
            }
            _ => {}
        }
    }
}

/// What says the same stays as it was written.
fn put(table: &mut dyn TableLike, key: &str, value: f64) {
    if table.get(key).map(float) != Some(value) {
        put_number(table, key, written(value));
    }
}

fn put_point(table: &mut dyn TableLike, key: &str, point: &[f64; 3]) {
    if let Some(array) = table.get_mut(key).and_then(Item::as_array_mut) {
        for (place, value) in point.iter().enumerate() {
            if array.get(place).is_some_and(|own| number(own) != *value) {
                array.replace(place, written(*value));
            }
        }
    }
}

fn written(value: f64) -> f64 {
    format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value)
}

fn number(value: &toml_edit::Value) -> f64 {
    let integer = || value.as_integer().map(|value| value as f64);
    value.as_float().or_else(integer).unwrap_or(0.0)
}
