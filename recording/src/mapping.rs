//! The mapping file beside a foreign log: which column is which signal, and by what factor.
//!
//! ```toml
//! sample_rate_hz = 250.0            # optional where a time column exists
//! [columns]
//! time_s = "t"
//! segment = "trial"
//! [joint.axis1]                      # the robot file's joint name
//! motor_position_rad = { column = "axis1_motor_position_deg", scale = 4.4829 }  # value = scale·x + offset
//! motor_torque_nm = "axis1_motor_torque_nm"
//! ```
//!
//! Columns that bear the names of a recording's own need no entry. Of arrays with a column for each joint (`q`, `dq`, `tau`,
//! `q_des`, `observation.state`, …) a line with the joints' names is enough: `joints = ["axis1", "axis2"]`; a column of one
//! is `q[0]`.

use crate::columns::{SEGMENT, TIME};
use crate::error::nearest;
use crate::{MappingProblem, ReadProblem, Signal};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

const RATE: &str = "sample_rate_hz";
const COLUMNS: &str = "columns";
const JOINT: &str = "joint";
const JOINTS: &str = "joints";
const COLUMN: &str = "column";
const SCALE: &str = "scale";
const OFFSET: &str = "offset";

/// A mapping file's contents; empty where there is no such file.
#[derive(Default)]
pub(crate) struct Mapping {
    pub(crate) sample_rate_hz: Option<f64>,
    pub(crate) time: Option<Source>,
    pub(crate) segment: Option<Source>,
    /// Of the columns of arrays, in their order.
    pub(crate) joint_names: Vec<String>,
    pub(crate) joints: Vec<(String, Vec<(Signal, Source)>)>,
}

/// Where a log's mapping is looked for.
pub(crate) struct MappingFile<'a> {
    pub(crate) log: &'a Path,
    /// Instead of the one beside the log.
    pub(crate) given: Option<&'a Path>,
}

impl MappingFile<'_> {
    /// Whether the user named it.
    pub(crate) fn is_given(&self) -> bool {
        self.given.is_some()
    }

    /// The mapping, and the file it was read from or, where there is none, could be written to.
    pub(crate) fn load(&self) -> Result<(Mapping, PathBuf), ReadProblem> {
        match self.file() {
            Some(file) => Ok((Mapping::at(&file)?, file)),
            None => Ok((Mapping::default(), mapping_beside(self.log))),
        }
    }

    /// The mapping file, if there is one.
    pub(crate) fn file(&self) -> Option<PathBuf> {
        if let Some(given) = self.given {
            return Some(given.to_owned());
        }
        let own = mapping_beside(self.log);
        if !matches!(own.try_exists(), Ok(false)) {
            return Some(own);
        }
        let of_the_name = self.log.with_extension("toml");
        match std::fs::read_to_string(&of_the_name) {
            // Not a mapping: people name the robot's file and its log after the robot.
            Ok(text) if is_robot_file(&text) => None,
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            _ => Some(of_the_name),
        }
    }
}

/// Where a value comes from: `value = scale·x + offset`.
pub(crate) struct Source {
    /// In the mapping file, for errors.
    pub(crate) key: String,
    pub(crate) column: String,
    pub(crate) scale: f64,
    pub(crate) offset: f64,
}

impl Mapping {
    /// Reads the mapping file.
    pub(crate) fn at(path: &Path) -> Result<Self, ReadProblem> {
        let text = std::fs::read_to_string(path).map_err(MappingProblem::Io);
        text.and_then(|text| Self::parse(&text))
            .map_err(|wrong| problem(path, wrong))
    }

    pub(crate) fn parse(text: &str) -> Result<Self, MappingProblem> {
        let file: Table = text
            .parse()
            .map_err(|error: toml::de::Error| MappingProblem::Toml {
                line: line_of(text, &error),
                what: error.message().to_owned(),
            })?;
        let mut mapping = Self::default();
        for (key, value) in &file {
            match key.as_str() {
                RATE => mapping.sample_rate_hz = Some(positive(key, value)?),
                COLUMNS => mapping.add_columns(table(key, value)?)?,
                JOINT => {
                    for (joint, signals) in table(key, value)? {
                        let key = format!("{JOINT}.{joint}");
                        mapping
                            .joints
                            .push((joint.clone(), joint_signals(&key, table(&key, signals)?)?));
                    }
                }
                JOINTS => mapping.joint_names = names(key, value)?,
                _ => return Err(unknown(String::new(), key, [RATE, COLUMNS, JOINT, JOINTS])),
            }
        }
        Ok(mapping)
    }

    fn add_columns(&mut self, columns: &Table) -> Result<(), MappingProblem> {
        for (name, value) in columns {
            let key = format!("{COLUMNS}.{name}");
            match name.as_str() {
                TIME => self.time = Some(source(key, value)?),
                // A trajectory's number is not measured, so there is nothing to scale.
                SEGMENT if value.is_str() => self.segment = Some(source(key, value)?),
                SEGMENT => {
                    return Err(MappingProblem::WrongValue {
                        key,
                        expected: "a column's name",
                    });
                }
                _ => return Err(unknown(format!("{COLUMNS}."), name, [TIME, SEGMENT])),
            }
        }
        Ok(())
    }
}

/// The mapping file that belongs to a log: `NAME.mapping.toml` beside `NAME.csv`, or beside a folder `NAME`.
#[must_use]
pub fn mapping_beside(log: &Path) -> PathBuf {
    let name = if log.is_dir() {
        log.file_name()
    } else {
        log.file_stem()
    };
    let mut name = name.unwrap_or_default().to_owned();
    name.push(".mapping.toml");
    log.with_file_name(name)
}

/// Whether a TOML text describes a robot: by the keys that a robot file must have, which a mapping never has. Text that
/// is no TOML is not one.
fn is_robot_file(text: &str) -> bool {
    const ROBOT_KEYS: [&str; 5] = ["name", "gravity_m_s2", "urdf", "mjcf", "link"];
    text.parse::<Table>().is_ok_and(|file| {
        ROBOT_KEYS.iter().any(|key| file.contains_key(*key))
            || file.get(JOINT).is_some_and(Value::is_array)
    })
}

fn joint_signals(
    joint_key: &str,
    signals: &Table,
) -> Result<Vec<(Signal, Source)>, MappingProblem> {
    let read = |(name, value): (&String, &Value)| {
        let signal = Signal::from_name(name)
            .ok_or_else(|| unknown(format!("{joint_key}."), name, Signal::ALL.map(Signal::name)))?;
        Ok((signal, source(format!("{joint_key}.{name}"), value)?))
    };
    signals.iter().map(read).collect()
}

fn source(key: String, value: &Value) -> Result<Source, MappingProblem> {
    let expected = "a column's name, or { column = \"…\", scale = …, offset = … }";
    let wrong = || MappingProblem::WrongValue {
        key: key.clone(),
        expected,
    };
    if let Some(column) = value.as_str() {
        return Ok(Source {
            key,
            column: column.to_owned(),
            scale: 1.0,
            offset: 0.0,
        });
    }
    let (mut column, mut scale, mut offset) = (None, 1.0, 0.0);
    for (name, value) in value.as_table().ok_or_else(wrong)? {
        match name.as_str() {
            COLUMN => column = Some(value.as_str().ok_or_else(wrong)?.to_owned()),
            SCALE => {
                scale = number(
                    &format!("{key}.{SCALE}"),
                    value,
                    |scale| scale != 0.0,
                    scale_must_be(&key, value),
                )?
            }
            OFFSET => offset = number(&format!("{key}.{OFFSET}"), value, |_| true, "a number")?,
            _ => return Err(unknown(format!("{key}."), name, [COLUMN, SCALE, OFFSET])),
        }
    }
    let column = column.ok_or_else(wrong)?;
    Ok(Source {
        key,
        column,
        scale,
        offset,
    })
}

/// What a scale must be. A scale of 0 is most likely meant for the torque of a joint that nothing drives.
fn scale_must_be(key: &str, scale: &Value) -> &'static str {
    let torques = [
        Signal::MotorTorqueNm,
        Signal::JointTorqueNm,
        Signal::CommandTorqueNm,
    ];
    let is_zero = scale.as_float() == Some(0.0) || scale.as_integer() == Some(0);
    if is_zero && torques.iter().any(|torque| key.ends_with(torque.name())) {
        "a number other than 0; for a joint without a drive add a column of zeros to the log and map it to command_torque_nm"
    } else {
        "a number other than 0"
    }
}

fn names(key: &str, value: &Value) -> Result<Vec<String>, MappingProblem> {
    let names = value.as_array().map(|names| {
        let names = names.iter().map(|name| name.as_str().map(str::to_owned));
        names.collect::<Option<Vec<String>>>()
    });
    names.flatten().ok_or_else(|| MappingProblem::WrongValue {
        key: key.to_owned(),
        expected: "a list of names in quotes",
    })
}

fn positive(key: &str, value: &Value) -> Result<f64, MappingProblem> {
    number(key, value, |number| number > 0.0, "a positive number")
}

fn number(
    key: &str,
    value: &Value,
    fits: fn(f64) -> bool,
    expected: &'static str,
) -> Result<f64, MappingProblem> {
    let number = value
        .as_float()
        .or_else(|| value.as_integer().map(|integer| integer as f64));
    number
        .filter(|number| number.is_finite() && fits(*number))
        .ok_or_else(|| MappingProblem::WrongValue {
            key: key.to_owned(),
            expected,
        })
}

fn table<'a>(key: &str, value: &'a Value) -> Result<&'a Table, MappingProblem> {
    value.as_table().ok_or_else(|| MappingProblem::WrongValue {
        key: key.to_owned(),
        expected: "a table",
    })
}

fn unknown<const N: usize>(tables: String, key: &str, known: [&str; N]) -> MappingProblem {
    MappingProblem::UnknownKey {
        nearest: nearest(key, known),
        key: tables + key,
    }
}

fn problem(path: &Path, problem: MappingProblem) -> ReadProblem {
    ReadProblem::Mapping {
        mapping: path.to_owned(),
        problem,
    }
}

/// Line of the text at which it stopped being TOML, from one on.
fn line_of(text: &str, error: &toml::de::Error) -> usize {
    let end = error.span().map_or(0, |span| span.start.min(text.len()));
    let before = &text.as_bytes()[..end];
    1 + before.iter().filter(|byte| **byte == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        Mapping::parse(text).err().unwrap().to_string()
    }

    #[test]
    fn a_robot_file_is_told_from_a_mapping() {
        for robot in [
            "name = 'pendulum'\n[[joint]]\nname = 'shoulder'",
            "[[joint]]\nname = 'shoulder'",
            "urdf = 'arm.urdf'",
        ] {
            assert!(is_robot_file(robot), "{robot}");
        }
        for other in [
            "[joint.a]\nmotor_torque_nm = 'i'",
            "sample_rate = 1",
            "",
            "name = ",
        ] {
            assert!(!is_robot_file(other), "{other}");
        }
    }

    #[test]
    fn joints_keep_the_order_of_the_file() {
        let mapping =
            Mapping::parse("[joint.j2]\nmotor_torque_nm = 'b'\n[joint.j10]\n[joint.j1]").unwrap();
        let names: Vec<_> = mapping
            .joints
            .iter()
            .map(|(name, _)| name.as_str())
            .collect();
        assert_eq!(names, ["j2", "j10", "j1"]);
    }

    #[test]
    fn a_key_that_is_unknown_is_named_with_the_nearest_known_one() {
        assert_eq!(
            refusal("sample_rate = 1.0"),
            "unknown key `sample_rate`; did you mean `sample_rate_hz`?"
        );
        assert_eq!(
            refusal("[columns]\ntime = 't'"),
            "unknown key `columns.time`; did you mean `time_s`?"
        );
        assert_eq!(
            refusal("[joint.axis1]\nmotor_positon_rad = 'q'"),
            "unknown key `joint.axis1.motor_positon_rad`; did you mean `motor_position_rad`?"
        );
        assert_eq!(
            refusal("[columns]\ntime_s = { colum = 't' }"),
            "unknown key `columns.time_s.colum`; did you mean `column`?"
        );
        assert_eq!(refusal("zzz = 1"), "unknown key `zzz`");
    }

    #[test]
    fn a_value_that_means_nothing_is_named_with_what_belongs_there() {
        assert_eq!(
            refusal("sample_rate_hz = 0"),
            "`sample_rate_hz` must be a positive number"
        );
        assert_eq!(
            refusal("sample_rate_hz = nan"),
            "`sample_rate_hz` must be a positive number"
        );
        assert_eq!(refusal("joint = 1"), "`joint` must be a table");
        assert_eq!(
            refusal("[joint.a]\nmotor_torque_nm = { column = 'i', scale = 0 }"),
            "`joint.a.motor_torque_nm.scale` must be a number other than 0; for a joint without a drive add a column of zeros to the log \
             and map it to command_torque_nm"
        );
        assert_eq!(
            refusal("[joint.a]\nmotor_current_a = { column = 'i', scale = 0.0 }"),
            "`joint.a.motor_current_a.scale` must be a number other than 0"
        );
        assert_eq!(
            refusal("[joint.a]\nmotor_torque_nm = { column = 'i', scale = 'x' }"),
            "`joint.a.motor_torque_nm.scale` must be a number other than 0"
        );
        assert!(
            refusal("[joint.a]\nmotor_torque_nm = { scale = 2 }")
                .starts_with("`joint.a.motor_torque_nm` must be")
        );
        assert_eq!(
            refusal("[columns]\nsegment = { column = 's' }"),
            "`columns.segment` must be a column's name"
        );
        assert!(refusal("\n[columns").starts_with("is not TOML, line 2: "));
    }
}
