//! What a robot file says of its moteus drives: the `[drive]` table and those of the joints.
//!
//! ```toml
//! [drive]
//! ports = ["/dev/serial/by-id/usb-mjbots_fdcanusb_1234-if00"]  # one for each bus
//! watchdog_ms = 100       # after so long without a command a drive damps by itself; 100 if left out
//!
//! [[joint]]
//! drive = { id = 1, bus = 1, reversed = false }  # bus 1 and not reversed if left out
//! ```

use robot::{Robot, Source};
use rt_loop::driver::OpenError;
use serde::Deserialize;

/// The keys of `[drive]`, for errors.
const BUS_KEYS: &str = "ports, watchdog_ms";
/// The keys of a joint's `drive`.
const JOINT_KEYS: &str = "id, bus, reversed";
/// The identifiers a drive may have; 127 is everybody's (moteus, protocol/registers.md, 0x110).
const IDS: std::ops::RangeInclusive<u8> = 1..=126;

/// The `[drive]` table.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BusTable {
    /// The serial port of each bus's adapter.
    pub ports: Vec<String>,
    /// `servo.default_timeout_s` of every drive.
    #[serde(default = "watchdog_ms")]
    pub watchdog_ms: u32,
}

fn watchdog_ms() -> u32 {
    100
}

/// A joint's `drive`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct JointTable {
    /// `id.id` of its drive.
    pub id: u8,
    /// Which of the ports, from 1.
    #[serde(default = "first")]
    pub bus: usize,
    /// Whether the drive counts against the joint's axis.
    #[serde(default)]
    pub reversed: bool,
}

fn first() -> usize {
    1
}

/// All of them, checked.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    pub bus: BusTable,
    /// In the robot's order.
    pub joints: Vec<JointTable>,
}

impl Settings {
    /// Reads the tables of a robot.
    ///
    /// # Errors
    /// [`OpenError::Setting`]: file, table, key, and what to change.
    pub fn of(robot: &Robot) -> Result<Self, OpenError> {
        let file = match &robot.source {
            Source::Shipped(name) => (*name).to_owned(),
            Source::File(path) => path.display().to_string(),
        };
        let wrong = |reason: String| Err(OpenError::Setting(format!("{file}: {reason}")));
        let Some(table) = &robot.drive else {
            return wrong(
                "no [drive] table; add one with ports = [\"/dev/...\"], the serial port of each bus's adapter".to_owned(),
            );
        };
        let bus: BusTable = read(table, &format!("{file}, [drive]"), BUS_KEYS)?;
        if bus.ports.is_empty() {
            return wrong(
                "[drive] ports is empty; name the serial port of each bus's adapter".to_owned(),
            );
        }
        let repeated = |(index, port): (usize, &String)| bus.ports[..index].contains(port);
        if let Some(index) = bus.ports.iter().enumerate().position(repeated) {
            return wrong(format!(
                "[drive] ports has {} twice; name each port once",
                bus.ports[index]
            ));
        }
        if !(1..=100).contains(&bus.watchdog_ms) {
            return wrong(format!(
                "[drive] watchdog_ms = {}; give 1 to 100",
                bus.watchdog_ms
            ));
        }
        let mut joints: Vec<JointTable> = Vec::with_capacity(robot.joints.len());
        for joint in &robot.joints {
            let place = format!("joint `{}`", joint.name);
            let Some(table) = &joint.drive else {
                return wrong(format!(
                    "{place} has no drive; add drive = {{ id = ... }} with the drive's id.id"
                ));
            };
            let table: JointTable = read(table, &format!("{file}, drive of {place}"), JOINT_KEYS)?;
            if !IDS.contains(&table.id) {
                return wrong(format!("{place}: id = {}; a drive has 1 to 126", table.id));
            }
            if table.bus == 0 || table.bus > bus.ports.len() {
                return wrong(format!(
                    "{place}: bus = {}; [drive] ports names {}, from 1 on",
                    table.bus,
                    bus.ports.len()
                ));
            }
            let same = |other: &JointTable| other.id == table.id && other.bus == table.bus;
            if let Some(index) = joints.iter().position(same) {
                return wrong(format!(
                    "{place}: id {} on bus {} is already joint `{}`'s; give each joint its own drive",
                    table.id, table.bus, robot.joints[index].name
                ));
            }
            joints.push(table);
        }
        Ok(Self { bus, joints })
    }
}

fn read<'de, T: Deserialize<'de>>(
    table: &toml::Table,
    place: &str,
    keys: &str,
) -> Result<T, OpenError> {
    T::deserialize(table.clone()).map_err(|error| {
        let message = error.message().replace('\n', " ");
        OpenError::Setting(format!("{place}: {message}; the keys are {keys}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(bus: &str, joint: &str) -> Result<Settings, String> {
        let mut robot = robot::load("shd17").expect("shipped");
        let table = |text: &str| text.parse::<toml::Table>().expect("TOML");
        robot.drive = (!bus.is_empty()).then(|| table(bus));
        robot.joints[0].drive = (!joint.is_empty()).then(|| table(joint));
        Settings::of(&robot).map_err(|error| error.to_string())
    }

    #[test]
    fn what_is_left_out_has_its_default() {
        let settings = settings("ports = [\"/dev/a\"]", "id = 3").expect("right");
        let joint = &settings.joints[0];
        assert_eq!(
            (
                settings.bus.watchdog_ms,
                joint.id,
                joint.bus,
                joint.reversed
            ),
            (100, 3, 1, false)
        );
    }

    #[test]
    fn what_is_wrong_is_told_in_one_line_with_what_to_change() {
        for (bus, joint, told) in [
            ("", "id = 1", "no [drive] table; add one"),
            ("ports = []", "id = 1", "ports is empty"),
            ("ports = [\"a\", \"a\"]", "id = 1", "a twice"),
            ("port = \"a\"", "id = 1", "the keys are ports"),
            (
                "ports = [\"a\"]\nwatchdog_ms = 500",
                "id = 1",
                "give 1 to 100",
            ),
            ("ports = [\"a\"]", "", "no drive; add drive"),
            ("ports = [\"a\"]", "id = 0", "1 to 126"),
            ("ports = [\"a\"]", "id = 300", "the keys are id"),
            ("ports = [\"a\"]", "id = 1\nbus = 2", "bus = 2"),
            ("ports = [\"a\"]", "name = \"x\"", "the keys are id"),
        ] {
            let error = settings(bus, joint).expect_err(told);
            assert!(error.contains(told) && !error.contains('\n'), "{error}");
        }
        let mut robot = robot::load("pa10").expect("shipped");
        robot.drive = Some("ports = [\"a\"]".parse().expect("TOML"));
        for joint in &mut robot.joints {
            joint.drive = Some("id = 1".parse().expect("TOML"));
        }
        let error = Settings::of(&robot).expect_err("twice").to_string();
        assert!(error.contains("already joint `joint1`'s"), "{error}");
    }
}
