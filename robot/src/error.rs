//! Why a robot or injection file cannot be used. Every message is one line: where, what, what to change.

use std::fmt;

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file, or the shipped robot's name.
    pub file: String,
    /// Line counted from 1, where it is known.
    pub line: Option<usize>,
    /// Which table, joint or entry.
    pub within: String,
}

impl Place {
    /// A place whose line is not known.
    pub fn new(file: &str, within: impl Into<String>) -> Self {
        Self {
            file: file.to_owned(),
            line: None,
            within: within.into(),
        }
    }

    /// Something at this place that is none of the `known` names.
    pub fn unknown(&self, kind: &'static str, found: &str, known: &[String]) -> RobotError {
        RobotError::Unknown {
            place: Box::new(self.clone()),
            kind,
            found: found.to_owned(),
            known: known.to_vec(),
        }
    }

    /// Value error at this place.
    pub fn invalid(&self, what: impl Into<String>) -> RobotError {
        RobotError::Invalid {
            place: Box::new(self.clone()),
            what: what.into(),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&one_line(&self.file))?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if !self.within.is_empty() {
            write!(f, ", {}", one_line(&self.within))?;
        }
        Ok(())
    }
}

/// Why a robot or injection file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RobotError {
    /// The file cannot be read.
    #[error(
        "{}: cannot be read ({}){}",
        one_line(file),
        one_line(reason),
        one_line(hint)
    )]
    Read {
        /// The path as given.
        file: String,
        /// What the system says.
        reason: String,
        /// What else the name may have meant.
        hint: String,
    },
    /// The text is no TOML, or no URDF.
    #[error("{place}: {}", one_line(what))]
    Syntax {
        /// Where reading stopped.
        place: Box<Place>,
        /// What is wrong there.
        what: String,
    },
    /// A key, effect, joint or link that nobody knows.
    #[error(
        "{place}: unknown {kind} `{}`; {}",
        one_line(found),
        hint(found, known)
    )]
    Unknown {
        /// Where it stands.
        place: Box<Place>,
        /// Key, effect, joint and so on.
        kind: &'static str,
        /// What stands there.
        found: String,
        /// What may stand there.
        known: Vec<String>,
    },
    /// A value that cannot be meant, or one that is missing.
    #[error("{place}: {}", one_line(what))]
    Invalid {
        /// Where it stands.
        place: Box<Place>,
        /// What is wrong, and what is allowed.
        what: String,
    },
}

/// Names the nearest known name, or all of them where none is near.
fn hint(found: &str, known: &[String]) -> String {
    match nearest(found, known) {
        Some(name) => format!("did you mean `{}`?", one_line(name)),
        None if known.is_empty() => "none is allowed here, remove it".to_owned(),
        None => format!("known: {}", one_line(&known.join(", "))),
    }
}

/// The known name most like `found`, if one is at all alike.
pub fn nearest<'a>(found: &str, known: &'a [String]) -> Option<&'a str> {
    // Below 0.6 a suggestion points at something unrelated more often than not.
    const ALIKE: f64 = 0.6;
    let found = found.to_lowercase();
    let likeness =
        |name: &&String| strsim::normalized_damerau_levenshtein(&found, &name.to_lowercase());
    let begins_alike =
        |name: &&String| !found.is_empty() && name.to_lowercase().starts_with(&found);
    let best = known
        .iter()
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))?;
    if likeness(&best) >= ALIKE {
        return Some(best);
    }
    known.iter().find(begins_alike).map(String::as_str)
}

/// Control characters would break the one-line promise.
fn one_line(text: &str) -> String {
    const LENGTH_MAX: usize = 400;
    let flat: String = text
        .trim()
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    let words: Vec<&str> = flat.split(' ').filter(|word| !word.is_empty()).collect();
    let mut line = words.join(" ");
    if let Some((end, _)) = line.char_indices().nth(LENGTH_MAX) {
        line.truncate(end);
        line.push('…');
    }
    if text.starts_with(' ') {
        format!(" {line}")
    } else {
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_named() {
        let known = ["gear_ratio", "torque_limit_nm", "coulomb_nm"].map(String::from);
        assert_eq!(nearest("gear_ration", &known), Some("gear_ratio"));
        assert_eq!(nearest("Coulomb_Nm", &known), Some("coulomb_nm"));
        assert_eq!(nearest("coulomb", &known), Some("coulomb_nm"));
        assert_eq!(nearest("zzz", &known), None);
    }

    #[test]
    fn messages_stay_on_one_line() {
        let place = Place::new("a\nb.toml", "joint `x\ny`");
        let error = place.unknown("key", "z\n\u{7}", &[]);
        assert_eq!(
            error.to_string(),
            "a b.toml, joint `x y`: unknown key `z`; none is allowed here, remove it"
        );
        let error = place.unknown("joint", "elbow", &["elbow\n".to_owned()]);
        assert_eq!(
            error.to_string(),
            "a b.toml, joint `x y`: unknown joint `elbow`; did you mean `elbow`?"
        );
    }
}
