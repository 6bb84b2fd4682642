//! TOML text to typed values, with errors that name the line, the table, and the nearest known key.

use serde::de::DeserializeOwned;
use serde_path_to_error::Segment;

use crate::error::{Place, RobotError};

/// Reads TOML text; `file` is what errors call it.
///
/// # Errors
/// [`RobotError`] in one line: what is wrong in which line and table, and for unknown keys the nearest known one.
pub fn parse<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, RobotError> {
    let syntax = |error: toml::de::Error| RobotError::Syntax {
        place: Box::new(Place {
            line: line_of(text, &error),
            ..Place::new(file, "")
        }),
        what: format!("not valid TOML: {}", error.message()),
    };
    // The untyped table gives the places in messages their names.
    let table: toml::Table = toml::from_str(text).map_err(syntax)?;
    let input = toml::Deserializer::parse(text).map_err(syntax)?;
    serde_path_to_error::deserialize(input).map_err(|error| {
        let (segments, error) = (error.path().clone(), error.into_inner());
        let message = error.message();
        let within = describe(
            segments.iter(),
            &table,
            unknown_name(message).map(|(_, name)| name),
        );
        let place = Place {
            line: line_of(text, &error),
            ..Place::new(file, within)
        };
        explain(message, &place, &[])
    })
}

/// Turns one of serde's messages into an error of ours. `also_known` are keys that were taken out beforehand.
pub fn explain(message: &str, place: &Place, also_known: &[&str]) -> RobotError {
    match unknown_name(message) {
        Some((kind, found)) => {
            let mut known = quoted(message);
            known.remove(0);
            known.extend(also_known.iter().map(|key| (*key).to_owned()));
            place.unknown(kind, found, &known)
        }
        None => place.invalid(with_remedy(message)),
    }
}

fn with_remedy(message: &str) -> String {
    match message.strip_prefix("missing field ") {
        Some(key) => format!("{key} is missing, add it"),
        None => message.to_owned(),
    }
}

/// What serde calls unknown, from messages such as "unknown field `a`, expected one of `b`, `c`".
fn unknown_name(message: &str) -> Option<(&'static str, &str)> {
    let (kind, rest) = match message.strip_prefix("unknown field `") {
        Some(rest) => ("key", rest),
        None => ("name", message.strip_prefix("unknown variant `")?),
    };
    let end = rest
        .find("`, expected ")
        .or_else(|| rest.find("`, there are no"))?;
    Some((kind, &rest[..end]))
}

/// The names between backticks. The first is the unknown one, which may itself hold a backtick.
fn quoted(message: &str) -> Vec<String> {
    let (unknown, expected) = message.split_once("`, expected ").unwrap_or((message, ""));
    let names = expected.split('`').skip(1).step_by(2).map(str::to_owned);
    std::iter::once(unknown.to_owned()).chain(names).collect()
}

fn line_of(text: &str, error: &toml::de::Error) -> Option<usize> {
    let start = error.span()?.start.min(text.len());
    Some(
        text.as_bytes()[..start]
            .iter()
            .filter(|byte| **byte == b'\n')
            .count()
            + 1,
    )
}

/// Says a path in words: "joint `elbow`, effects `coulomb_friction`".
fn describe<'a>(
    path: impl Iterator<Item = &'a Segment>,
    table: &toml::Table,
    unknown: Option<&str>,
) -> String {
    let mut words: Vec<String> = Vec::new();
    let root = toml::Value::Table(table.clone());
    let mut here = Some(&root);
    for segment in path {
        match segment {
            Segment::Map { key } if Some(key.as_str()) == unknown => {}
            Segment::Map { key } => {
                here = here.and_then(|value| value.get(key));
                words.push(key.clone());
            }
            Segment::Seq { index } => {
                here = here.and_then(|value| value.get(*index));
                let label = here
                    .and_then(label)
                    .map_or_else(|| (index + 1).to_string(), |name| format!("`{name}`"));
                let list = words.pop();
                words.push(list.map_or(label.clone(), |list| format!("{list} {label}")));
            }
            Segment::Enum { .. } | Segment::Unknown => {}
        }
    }
    if words.is_empty() {
        "top level".to_owned()
    } else {
        words.join(", ")
    }
}

/// What a table in a list is called.
fn label(value: &toml::Value) -> Option<&str> {
    ["name", "joint", "effect"]
        .iter()
        .find_map(|key| value.get(key)?.as_str())
}
