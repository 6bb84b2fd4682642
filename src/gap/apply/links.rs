//! The links' masses, centres and inertias that torques ask for, in a robot file's `[[link]]` tables.

use gap_diagnosis::report::{LinkChange, Report};
use toml_edit::{DocumentMut, Item, TableLike};

use super::{Change, add_to_number, float, rounded};
use crate::gap::apply::Mended;

/// What a simulator's file, or a robot file whose bodies are a description's, is told instead.
pub const BY_HAND: &str =
    "it is the links' masses; change those in the description, as a warning of the report tells";

/// A robot file with the links' values changed; what has no `[[link]]` tables stays as it is, and that is said.
///
/// # Errors
/// Why they cannot be written.
pub fn with_links(text: &str, report: &Report) -> Result<Mended, String> {
    let mut mended = Mended {
        text: text.to_owned(),
        changes: Vec::new(),
        left_out: Vec::new(),
    };
    if report.links.is_empty() {
        return Ok(mended);
    }
    let mut document: DocumentMut = text
        .parse()
        .map_err(|error| format!("robot file: {error}"))?;
    let tables = document
        .get_mut("link")
        .and_then(Item::as_array_of_tables_mut);
    // bodies of joints that nobody recorded were taken together with others
    let Some(tables) = tables.filter(|tables| tables.len() == report.links.len()) else {
        mended
            .left_out
            .push(format!("the links are left out: {BY_HAND}"));
        return Ok(mended);
    };
    for change in &report.links {
        let own = |table: &&mut toml_edit::Table| {
            table.get("joint").and_then(Item::as_str) == Some(change.joint.as_str())
        };
        let table = tables.iter_mut().find(own).ok_or_else(|| {
            format!(
                "no [[link]] has joint = \"{}\"; give the robot file that was diagnosed",
                change.joint
            )
        })?;
        mended.changes.push(Change {
            joint: Some(change.joint.clone()),
            effect: "link",
            done: changed(table, change),
        });
    }
    mended.text = document.to_string();
    Ok(mended)
}

fn changed(table: &mut dyn TableLike, change: &LinkChange) -> String {
    let mut done = vec![add_to_number(table, "mass_kg", change.mass_kg.value)];
    if let Some(centre) = table
        .get_mut("centre_of_mass_m")
        .and_then(Item::as_array_mut)
    {
        for (place, of) in change.centre_of_mass_m.iter().enumerate() {
            let before = centre.get(place).and_then(number).unwrap_or(0.0);
            let after = rounded(before + of.value);
            if place < centre.len() {
                centre.replace(place, after);
            }
        }
        done.push(format!("centre_of_mass_m {}", centre.to_string().trim()));
    }
    let part = 1.0 + change.inertia_part.value;
    if let Some(inertia) = table
        .get_mut("inertia_kg_m2")
        .and_then(Item::as_table_like_mut)
    {
        let names: Vec<String> = inertia.iter().map(|(name, _)| name.to_owned()).collect();
        for name in names {
            let before = inertia.get(&name).map_or(0.0, float);
            add_to_number(inertia, &name, (part - 1.0) * before);
        }
        done.push(format!("inertia_kg_m2 times {part:.3}"));
    }
    done.join(", ")
}

fn number(value: &toml_edit::Value) -> Option<f64> {
    let integer = || value.as_integer().map(|value| value as f64);
    value.as_float().or_else(integer)
}
