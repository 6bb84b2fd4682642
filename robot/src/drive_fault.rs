//! Faults of a drive's own, put into an emulated one: `[[drive_fault]]` tables of an injection file, with `joint`, `error_code`,
//! `start_s`, and `cause_s`, for which a reset does not help.

use std::path::Path;

use serde::Deserialize;

use crate::check::{self, Must};
use crate::error::{Place, RobotError};
use crate::injection::{InjectionFile, read_file};
use crate::parse::parse;
use crate::{Robot, RobotJoint};

/// A drive trips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveFaultInjection {
    /// The joint whose drive it is.
    pub joint: usize,
    /// The drive's number for it, as CiA 402 object 0x603F has it.
    pub error_code: u16,
    /// From the start of the run.
    pub start_s: f64,
    /// Until its cause is gone and a reset helps.
    pub cause_s: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DriveFaultEntry {
    joint: String,
    error_code: u16,
    start_s: f64,
    #[serde(default)]
    cause_s: f64,
}

/// Reads the drive faults of an injection file.
///
/// # Errors
/// [`RobotError`]: one line with file, entry, and what to change.
pub fn load_drive_faults(
    path: impl AsRef<Path>,
    robot: &Robot,
) -> Result<Vec<DriveFaultInjection>, RobotError> {
    let (file, text) = read_file(path.as_ref())?;
    let entries = parse::<InjectionFile>(&text, &file)?.drive_faults;
    let each = entries.into_iter().enumerate();
    each.map(|(index, entry)| {
        let place = Place::new(&file, format!("drive_fault {}", index + 1));
        drive_fault(&place, entry, robot)
    })
    .collect()
}

fn drive_fault(
    place: &Place,
    entry: DriveFaultEntry,
    robot: &Robot,
) -> Result<DriveFaultInjection, RobotError> {
    let joint = robot.joint_index(&entry.joint).ok_or_else(|| {
        let name = |joint: &RobotJoint| joint.name.clone();
        let known: Vec<String> = robot.joints.iter().map(name).collect();
        place.unknown("joint", &entry.joint, &known)
    })?;
    check::number(place, "start_s", entry.start_s, Must::NotBeNegative)?;
    check::number(place, "cause_s", entry.cause_s, Must::NotBeNegative)?;
    Ok(DriveFaultInjection {
        joint,
        error_code: entry.error_code,
        start_s: entry.start_s,
        cause_s: entry.cause_s,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use std::fs;

    use super::*;

    fn read(text: &str) -> Result<Vec<DriveFaultInjection>, RobotError> {
        let robot = crate::load("shd17").unwrap();
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        crate::load_injection(file.path(), &robot)?;
        load_drive_faults(file.path(), &robot)
    }

    #[test]
    fn a_drive_fault_is_read_and_each_slip_is_named() {
        let text = "[[drive_fault]]\njoint = \"joint1\"\nerror_code = 0x2310\nstart_s = 2\n";
        let fault = DriveFaultInjection {
            joint: 0,
            error_code: 0x2310,
            start_s: 2.0,
            cause_s: 0.0,
        };
        assert_eq!(read(text).unwrap(), [fault]);
        for (slip, told) in [
            (text.replace("joint1", "joint2"), "joint2"),
            (text.replace("0x2310", "0x12310"), "error_code"),
            (text.replace("start_s = 2", "start_s = -2"), "start_s"),
            (format!("{text}cause_s = -1\n"), "cause_s"),
        ] {
            let said = read(&slip).unwrap_err().to_string();
            assert!(said.contains(told) && said.lines().count() == 1, "{said}");
        }
    }
}
