//! What a model says that is not read here, each kind once with its first line.

use std::collections::BTreeMap;

use crate::xml::Element;

/// Top-level elements of which nothing moves a joint, or that are read.
const TOP: [&str; 15] = [
    "asset",
    "visual",
    "statistic",
    "size",
    "custom",
    "sensor",
    "keyframe",
    "contact",
    "default",
    "compiler",
    "option",
    "worldbody",
    "actuator",
    "equality",
    "include",
];

/// Attributes that would change motion or mass and are not read, by element.
const UNREAD: [(&str, &[&str]); 9] = [
    ("joint", &["springdamper", "armaturetype"]),
    ("body", &["gravcomp", "mocap"]),
    ("geom", &["fluidshape"]),
    ("compiler", &["alignfree", "fitaabb"]),
    ("option", &["density", "viscosity", "wind"]),
    ("position", &["dampratio", "timeconst", "delay"]),
    ("motor", &["delay"]),
    ("velocity", &["delay"]),
    ("general", &["dampratio", "delay"]),
];

/// Adds the notes.
pub fn note(root: &Element, notes: &mut Vec<String>) {
    for child in root.children().filter(|child| !TOP.contains(&child.tag())) {
        notes.push(child.note(&format!("<{}> is not read", child.tag())));
    }
    let mut found: BTreeMap<(&str, &str), (usize, &Element)> = BTreeMap::new();
    let mut open: Vec<&Element> = vec![root];
    while let Some(element) = open.pop() {
        open.extend(element.children().rev());
        let Some((tag, keys)) = UNREAD.iter().find(|(tag, _)| *tag == element.tag()) else {
            continue;
        };
        for key in keys.iter().copied() {
            let says_something = element.attribute(key).is_some_and(|value| {
                let mut words = value.split_whitespace();
                !words.all(|word| matches!(word.parse(), Ok(0.0)) || word == "false")
            });
            if says_something {
                found.entry((tag, key)).or_insert((0, element)).0 += 1;
            }
        }
    }
    let mut found: Vec<_> = found.into_iter().collect();
    found.sort_by_key(|(_, (_, first))| first.line());
    for ((_, key), (count, first)) in found {
        let times = if count > 1 {
            format!(", {count} times")
        } else {
            String::new()
        };
        notes.push(first.note(&format!("{key} is not read{times}")));
    }
}
