//! What a robot file says of its EtherCAT drives: the `[drive]` table and those of the joints.

use std::time::Duration;

use robot::{Robot, Source, nearest};
use rt_loop::driver::OpenError;
use serde::Deserialize;

/// Watchdog of the drives where the robot file is silent: a fifth of the loop's longest, a dozen cycles of 1.5 kHz.
const WATCHDOG_MS: f64 = 20.0;

/// Those that stop the motor and end without torque (IEC 61800-7-201, 0x605a). 0 lets it run out; those from 5 on hold on.
const QUICK_STOP_OPTIONS: std::ops::RangeInclusive<i16> = 1..=4;

/// The `[drive]` table.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusTable {
    /// Network interface.
    pub interface: String,
    /// After so long without outputs a drive stops by itself.
    #[serde(default = "watchdog_ms")]
    pub watchdog_ms: f64,
    /// Whether drives act at SYNC0 of the distributed clocks, or when a frame comes.
    #[serde(default = "yes")]
    pub distributed_clocks: bool,
    /// Whether the process data's mapping is written to the drives, or taken as they have it.
    #[serde(default = "yes")]
    pub write_mapping: bool,
}

fn watchdog_ms() -> f64 {
    WATCHDOG_MS
}

fn yes() -> bool {
    true
}

/// A `[joint.drive]` table. What it leaves out is read from the drive; what it says must agree with the drive.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointTable {
    /// Slave, counted from 0 along the cable; the joints take the bus's axes in their order if no joint has one.
    pub slave: Option<u16>,
    /// Axis of the slave.
    #[serde(default)]
    pub axis: u8,
    /// Vendor of the slave.
    pub vendor: Option<u32>,
    /// Product code of the slave.
    pub product: Option<u32>,
    /// Counts a turn of the motor.
    pub encoder_counts: Option<u32>,
    /// The motor's encoder, velocity and torque count down where the joint's axis turns positively.
    #[serde(default)]
    pub reversed: bool,
    /// Motor count at which the joint is at zero.
    #[serde(default)]
    pub zero_count: i64,
    /// Counts a turn of a second encoder, behind the gear.
    pub link_encoder_counts: Option<u32>,
    /// The second encoder counts down where the joint's axis turns positively.
    #[serde(default)]
    pub link_reversed: bool,
    /// Its count at which the joint is at zero.
    #[serde(default)]
    pub link_zero_count: i64,
    /// Rated torque, which 0.1 % of are one digit.
    pub rated_torque_nm: Option<f64>,
    /// Whether the counts stand for the joint's angle: an absolute encoder, or one that was homed.
    #[serde(default)]
    pub homed: bool,
    /// How fast a quick stop slows the joint down, joint side; the drive's own if not given.
    pub quick_stop_rad_s2: Option<f64>,
    /// How a quick stop stops (0x605a); if not given the quick stop ramp, where the drive has a choice.
    pub quick_stop_option: Option<i16>,
}

/// Both, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Of the bus.
    pub bus: BusTable,
    /// Of each joint.
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
        let Some(table) = &robot.drive else {
            return Err(OpenError::Setting(format!(
                "{file}: no [drive] table; add one with interface = \"eth0\", the network interface of the drives"
            )));
        };
        let bus: BusTable = read(table, &format!("{file}, [drive]"))?;
        let watchdog_fits =
            bus.watchdog_ms.is_finite() && (1.0..=1000.0).contains(&bus.watchdog_ms);
        if !watchdog_fits {
            return Err(OpenError::Setting(format!(
                "{file}, [drive]: watchdog_ms = {}; give 1 to 1000",
                bus.watchdog_ms
            )));
        }
        let mut joints = Vec::new();
        for joint in &robot.joints {
            let place = format!("{file}, drive of joint `{}`", joint.name);
            let table = match &joint.drive {
                Some(table) => read(table, &place)?,
                None => JointTable::default(),
            };
            check(&table, &place)?;
            joints.push(table);
        }
        let given = joints.iter().filter(|joint| joint.slave.is_some()).count();
        if given != 0 && given != joints.len() {
            return Err(OpenError::Setting(format!(
                "{file}: {given} of {} joints say their slave; give it for all, or for none to take them in the bus's order",
                joints.len()
            )));
        }
        for (index, joint) in joints.iter().enumerate() {
            let same = |other: &&JointTable| (other.slave, other.axis) == (joint.slave, joint.axis);
            if given != 0 && joints[..index].iter().any(|other| same(&other)) {
                return Err(OpenError::Setting(format!(
                    "{file}, drive of joint `{}`: slave {} axis {} is another joint's already",
                    robot.joints[index].name,
                    joint.slave.unwrap_or(0),
                    joint.axis
                )));
            }
        }
        Ok(Self { bus, joints })
    }

    /// The drives' watchdog.
    pub fn watchdog(&self) -> Duration {
        Duration::from_secs_f64(self.bus.watchdog_ms * 1e-3)
    }
}

fn check(table: &JointTable, place: &str) -> Result<(), OpenError> {
    let wrong = |what: String| Err(OpenError::Setting(format!("{place}: {what}")));
    if table.encoder_counts == Some(0) || table.link_encoder_counts == Some(0) {
        return wrong("an encoder has 0 counts a turn; give what its manual says".to_owned());
    }
    if let Some(ramp_rad_s2) = table.quick_stop_rad_s2
        && !(ramp_rad_s2.is_finite() && ramp_rad_s2 > 0.0)
    {
        return wrong(format!(
            "quick_stop_rad_s2 = {ramp_rad_s2}; it must be positive"
        ));
    }
    if let Some(option) = table.quick_stop_option
        && !QUICK_STOP_OPTIONS.contains(&option)
    {
        return wrong(format!(
            "quick_stop_option = {option}; give 1 (slow down ramp), 2 (quick stop ramp), 3 (current limit) or 4 (voltage limit), \
             after which a drive is without torque"
        ));
    }
    match table.rated_torque_nm {
        Some(rated_nm) if !(rated_nm.is_finite() && rated_nm > 0.0) => {
            wrong(format!("rated_torque_nm = {rated_nm}; it must be positive"))
        }
        _ => Ok(()),
    }
}

fn read<'de, T: Deserialize<'de>>(table: &toml::Table, place: &str) -> Result<T, OpenError> {
    T::deserialize(table.clone()).map_err(|error| {
        let message = error.message().to_owned();
        let names: Vec<String> = message
            .split('`')
            .skip(1)
            .step_by(2)
            .map(str::to_owned)
            .collect();
        let told = match names.split_first() {
            Some((found, known)) if message.starts_with("unknown field") => {
                match nearest(found, known) {
                    Some(near) => format!("unknown key `{found}`; did you mean `{near}`?"),
                    None => format!("unknown key `{found}`; known: {}", known.join(", ")),
                }
            }
            Some((key, _)) if message.starts_with("missing field") => {
                format!("`{key}` is missing; add it")
            }
            _ => message.replace('\n', " "),
        };
        OpenError::Setting(format!("{place}: {told}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(bus: &str, joint: &str) -> Robot {
        let mut robot = robot::load("shd17").expect("a shipped robot");
        robot.drive = (!bus.is_empty()).then(|| bus.parse().expect("TOML"));
        robot.joints[0].drive = Some(joint.parse().expect("TOML"));
        robot
    }

    #[test]
    fn what_is_left_out_has_defaults() {
        let settings = Settings::of(&robot("interface = \"eth1\"", "")).expect("settings");
        assert_eq!(settings.bus.interface, "eth1");
        assert!(settings.bus.distributed_clocks && settings.bus.write_mapping);
        assert_eq!(settings.watchdog(), Duration::from_millis(20));
        assert_eq!(settings.joints, [JointTable::default()]);
    }

    #[test]
    fn what_is_wrong_is_said_in_one_line() {
        let cases = [
            ("", "", "no [drive] table"),
            ("watchdog_ms = 5.0", "", "`interface` is missing"),
            (
                "interface = \"a\"\nwatchdog_mss = 5.0",
                "",
                "did you mean `watchdog_ms`",
            ),
            ("interface = \"a\"\nwatchdog_ms = nan", "", "give 1 to 1000"),
            ("interface = 5", "", "invalid type"),
            ("interface = \"a\"", "encoder_counts = 0", "0 counts"),
            (
                "interface = \"a\"",
                "rated_torque_nm = -1.0",
                "must be positive",
            ),
            ("interface = \"a\"", "slav = 1", "did you mean `slave`"),
            (
                "interface = \"a\"",
                "quick_stop_rad_s2 = 0.0",
                "quick_stop_rad_s2 = 0",
            ),
            ("interface = \"a\"", "quick_stop_option = 6", "give 1 (slow"),
        ];
        for (bus, joint, part) in cases {
            let error = Settings::of(&robot(bus, joint))
                .expect_err(part)
                .to_string();
            assert!(error.contains(part), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }

    #[test]
    fn an_axis_drives_one_joint() {
        let mut robot = robot::load("pa10").expect("a shipped robot");
        robot.drive = Some("interface = \"a\"".parse().expect("TOML"));
        for joint in &mut robot.joints {
            joint.drive = Some("slave = 1".parse().expect("TOML"));
        }
        let error = Settings::of(&robot).expect_err("twice").to_string();
        assert!(error.contains("another joint's"), "{error}");
        robot.joints[3].drive = None;
        let error = Settings::of(&robot).expect_err("some").to_string();
        assert!(error.contains("6 of 7"), "{error}");
    }
}
