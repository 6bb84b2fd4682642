//! The configuration of a drive: named numbers that `conf get`, `conf set` and `conf enumerate` show and change.
//!
//! Names, types, order and factory values follow the maker's firmware (mjbots/moteus, fw/bldc_servo_structs.h,
//! fw/motor_position.h; meaning: reference/configuration.md). Left out are the groups of what is not emulated: auxiliary
//! ports, gate driver, and the tables of encoder and cogging compensation. A change acts at once and is lost at the next
//! power-on unless `conf write` came before.

/// How a number is written and what it can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Float,
    /// Between these, both included; more wraps as in the drive.
    Whole {
        bits: u32,
        signed: bool,
    },
    Flag,
}

const U8: Kind = Kind::Whole {
    bits: 8,
    signed: false,
};
const I8: Kind = Kind::Whole {
    bits: 8,
    signed: true,
};
const U16: Kind = Kind::Whole {
    bits: 16,
    signed: false,
};
const U32: Kind = Kind::Whole {
    bits: 32,
    signed: false,
};
const I32: Kind = Kind::Whole {
    bits: 32,
    signed: true,
};

/// The longest number that is read: more digits than any type has.
const NUMBER_CHARACTERS: usize = 64;

#[derive(Clone, Debug)]
struct Entry {
    name: String,
    kind: Kind,
    value: f64,
    saved: f64,
    factory: f64,
}

/// All entries of a drive.
#[derive(Clone, Debug)]
pub struct Config {
    entries: Vec<Entry>,
}

/// Why a `conf` command is refused. The text is what follows `ERR`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// There is no such group.
    #[error("unknown group")]
    Group,
    /// The group has no such entry; told so when one is read.
    #[error("error reading")]
    Reading,
    /// The group has no such entry; told so when one is set.
    #[error("error setting")]
    Setting,
}

impl Config {
    /// As the drive leaves the factory.
    pub fn factory(uuid: [u8; 16]) -> Self {
        let mut config = Self {
            entries: Vec::new(),
        };
        config.add_bus(uuid);
        config.add_servo();
        config.add_motor();
        config.add_motor_position();
        config
    }

    fn add_bus(&mut self, uuid: [u8; 16]) {
        self.add("id.id", U32, 1.0);
        self.add("can.prefix", U32, 0.0);
        for (index, byte) in uuid.iter().enumerate() {
            self.add(&format!("uuid.uuid.{index}"), U8, f64::from(*byte));
        }
    }

    fn add_servo(&mut self) {
        let float = Kind::Float;
        for (name, kind, factory) in [
            ("pwm_rate_hz", U16, 30_000.0),
            ("current_sense_ohm", float, 0.0005),
            ("max_voltage", float, 46.0),
            ("max_power_W", float, f64::NAN),
            ("override_board_max_power", Kind::Flag, 0.0),
            ("temperature_margin", float, 25.0),
            ("fault_temperature", float, 75.0),
            ("enable_motor_temperature", Kind::Flag, 0.0),
            ("motor_thermistor_ohm", float, 10_000.0),
            ("motor_temperature_margin", float, 20.0),
            ("motor_fault_temperature", float, f64::NAN),
            ("fault_position_error", float, f64::NAN),
            ("fault_velocity_error", float, f64::NAN),
            ("velocity_threshold", float, 0.0),
            ("position_derate", float, 0.02),
            ("pid_dq_hz", float, 100.0),
            ("max_current_desired_rate", float, 10_000.0),
            ("pid_position.kp", float, 4.0),
            ("pid_position.ki", float, 1.0),
            ("pid_position.kd", float, 0.05),
            ("pid_position.iratelimit", float, -1.0),
            ("pid_position.ilimit", float, 0.0),
            ("pid_position.max_desired_rate", float, 0.0),
            ("pid_position.sign", I8, -1.0),
            ("current_feedforward", float, 1.0),
            ("bemf_feedforward", float, 0.0),
            ("bemf_feedforward_override", Kind::Flag, 0.0),
            ("inertia_feedforward", float, 0.0),
            ("default_velocity_limit", float, f64::NAN),
            ("default_accel_limit", float, 50.0),
            ("voltage_mode_control", Kind::Flag, 0.0),
            ("fixed_voltage_mode", Kind::Flag, 0.0),
            ("fixed_voltage_control_V", float, 0.0),
            ("max_position_slip", float, f64::NAN),
            ("max_velocity_slip", float, f64::NAN),
            ("default_timeout_s", float, 0.1),
            ("timeout_max_torque_Nm", float, 5.0),
            ("timeout_mode", U8, 12.0),
            ("flux_brake_margin_voltage", float, 3.0),
            ("flux_brake_resistance_ohm", float, 0.025),
            ("max_regen_power_W", float, f64::NAN),
            ("max_current_A", float, 100.0),
            ("derate_current_A", float, -20.0),
            ("max_velocity", float, 500.0),
            ("max_velocity_derate", float, 2.0),
            ("velocity_zero_capture_threshold", float, 0.05),
        ] {
            self.add(&format!("servo.{name}"), kind, factory);
        }
        self.add("servopos.position_min", float, -0.01);
        self.add("servopos.position_max", float, 0.01);
    }

    fn add_motor(&mut self) {
        let float = Kind::Float;
        for (name, kind, factory) in [
            ("poles", U8, 0.0),
            ("phase_invert", U8, 0.0),
            ("resistance_ohm", float, 0.0),
            ("inductance_d_H", float, 0.0),
            ("inductance_q_H", float, 0.0),
            ("inductance_d_scale", float, 0.0),
            ("Kv", float, 0.0),
        ] {
            self.add(&format!("motor.{name}"), kind, factory);
        }
        for index in 0..64 {
            self.add(&format!("motor.offset.{index}"), float, 0.0);
        }
        self.add("motor.rotation_current_cutoff_A", float, 10_000.0);
        self.add("motor.rotation_current_scale", float, 0.05);
        self.add("motor.rotation_torque_scale", float, 14.7);
    }

    fn add_motor_position(&mut self) {
        let float = Kind::Float;
        for source in 0..3 {
            for (name, kind, factory) in [
                ("aux_number", U8, 1.0),
                ("type", U32, if source == 0 { 1.0 } else { 0.0 }),
                ("i2c_device", U8, 0.0),
                ("incremental_index", I8, -1.0),
                ("cpr", U32, 16_384.0),
                ("offset", float, 0.0),
                ("sign", I8, 1.0),
                ("debug_override", I32, -1.0),
                ("timeout_s", float, 0.2),
                ("reference", U32, 0.0),
                ("pll_filter_hz", float, 400.0),
            ] {
                self.add(
                    &format!("motor_position.sources.{source}.{name}"),
                    kind,
                    factory,
                );
            }
        }
        for (name, kind, factory) in [
            ("commutation_source", I8, 0.0),
            ("output.source", I8, 0.0),
            ("output.offset", float, 0.0),
            ("output.sign", I8, 1.0),
            ("output.reference_source", I8, -1.0),
            ("rotor_to_output_ratio", float, 1.0),
            ("rotor_to_output_override", Kind::Flag, 0.0),
        ] {
            self.add(&format!("motor_position.{name}"), kind, factory);
        }
    }

    fn add(&mut self, name: &str, kind: Kind, factory: f64) {
        let factory = kind.held(factory);
        self.entries.push(Entry {
            name: name.to_owned(),
            kind,
            value: factory,
            saved: factory,
            factory,
        });
    }

    fn has_group(&self, group: &str) -> bool {
        let first = |entry: &Entry| entry.name.split('.').next() == Some(group);
        !group.is_empty() && self.entries.iter().any(first)
    }

    fn check_group(&self, name: &str) -> Result<(), ConfigError> {
        let group = name.split('.').next().unwrap_or_default();
        self.has_group(group)
            .then_some(())
            .ok_or(ConfigError::Group)
    }

    /// The number of an entry.
    ///
    /// # Panics
    /// If there is no such entry: only for names of this crate's own.
    pub fn number(&self, name: &str) -> f64 {
        self.find(name)
            .map(|entry| entry.value)
            .unwrap_or_else(|| panic!("no entry {name}"))
    }

    /// Sets an entry by its number and keeps it over a power-on, as if it had been configured and written.
    ///
    /// # Panics
    /// If there is no such entry: only for names of this crate's own.
    pub fn configure(&mut self, name: &str, value: f64) {
        let entry = self.entries.iter_mut().find(|entry| entry.name == name);
        let entry = entry.unwrap_or_else(|| panic!("no entry {name}"));
        entry.value = entry.kind.held(value);
        entry.saved = entry.value;
    }

    /// Sets an entry by its number until the next power-on.
    ///
    /// # Panics
    /// If there is no such entry: only for names of this crate's own.
    pub fn change(&mut self, name: &str, value: f64) {
        let entry = self.entries.iter_mut().find(|entry| entry.name == name);
        let entry = entry.unwrap_or_else(|| panic!("no entry {name}"));
        entry.value = entry.kind.held(value);
    }

    fn find(&self, name: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.name == name)
    }

    /// `conf get`: the number as the drive prints it.
    ///
    /// # Errors
    /// [`ConfigError`] if there is none of this name.
    pub fn get(&self, name: &str) -> Result<String, ConfigError> {
        self.check_group(name)?;
        self.find(name)
            .map(Entry::printed)
            .ok_or(ConfigError::Reading)
    }

    /// `conf set`: what is no number counts as 0, as in the drive.
    ///
    /// # Errors
    /// [`ConfigError`] if there is none of this name.
    pub fn set(&mut self, name: &str, text: &str) -> Result<(), ConfigError> {
        self.check_group(name)?;
        let entry = self.entries.iter_mut().find(|entry| entry.name == name);
        let entry = entry.ok_or(ConfigError::Setting)?;
        entry.value = entry.kind.held(leading_number(text));
        Ok(())
    }

    /// `conf enumerate`: lines of name and number, of one group or of all.
    ///
    /// # Errors
    /// [`ConfigError::Group`].
    pub fn enumerate(&self, group: &str) -> Result<String, ConfigError> {
        if !group.is_empty() && !self.has_group(group) {
            return Err(ConfigError::Group);
        }
        let wanted =
            |entry: &&Entry| group.is_empty() || entry.name.split('.').next() == Some(group);
        let lines = self.entries.iter().filter(wanted);
        Ok(lines
            .map(|entry| format!("{} {}\r\n", entry.name, entry.printed()))
            .collect())
    }

    /// `conf list`: the groups.
    pub fn groups(&self) -> Vec<&str> {
        let mut groups: Vec<&str> = Vec::new();
        for entry in &self.entries {
            let group = entry.name.split('.').next().unwrap_or_default();
            if !groups.contains(&group) {
                groups.push(group);
            }
        }
        groups
    }

    /// `conf write`.
    pub fn save(&mut self) {
        for entry in &mut self.entries {
            entry.saved = entry.value;
        }
    }

    /// `conf load`, and what a power-on does.
    pub fn load(&mut self) {
        for entry in &mut self.entries {
            entry.value = entry.saved;
        }
    }

    /// `conf default`.
    pub fn reset(&mut self) {
        for entry in &mut self.entries {
            entry.value = entry.factory;
        }
    }
}

impl Entry {
    fn printed(&self) -> String {
        match self.kind {
            Kind::Float if self.value.is_nan() => "nan".to_owned(),
            Kind::Float => format!("{:.6}", self.value),
            _ => format!("{:.0}", self.value),
        }
    }
}

impl Kind {
    /// What is left of a value in the entry's own type.
    fn held(self, value: f64) -> f64 {
        match self {
            Self::Float => f64::from(value as f32),
            Self::Flag => f64::from(u8::from(value != 0.0)),
            Self::Whole { bits, signed } => {
                let wrapped = (value as i64).rem_euclid(1 << bits);
                let half = 1 << (bits - 1);
                if signed && wrapped >= half {
                    (wrapped - (1 << bits)) as f64
                } else {
                    wrapped as f64
                }
            }
        }
    }
}

/// The number at the beginning of a text, as C's `strtof` reads it; 0 if there is none.
pub fn leading_number(text: &str) -> f64 {
    let text = text.trim_start();
    let starts: Vec<usize> = text
        .char_indices()
        .map(|(index, character)| index + character.len_utf8())
        .take(NUMBER_CHARACTERS)
        .collect();
    let longest = starts
        .iter()
        .rev()
        .find_map(|end| text[..*end].parse().ok());
    longest.unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> Config {
        Config::factory([7; 16])
    }

    #[test]
    fn what_is_set_is_read_and_lost_without_write() {
        let mut config = config();
        assert_eq!(
            config.get("servo.default_timeout_s").as_deref(),
            Ok("0.100000")
        );
        config
            .set("servo.default_timeout_s", "0.25")
            .expect("an entry");
        assert_eq!(
            config.get("servo.default_timeout_s").as_deref(),
            Ok("0.250000")
        );
        config.load();
        assert_eq!(
            config.get("servo.default_timeout_s").as_deref(),
            Ok("0.100000")
        );
        config
            .set("servo.default_timeout_s", "nan")
            .expect("an entry");
        config.save();
        config.load();
        assert_eq!(config.get("servo.default_timeout_s").as_deref(), Ok("nan"));
        config.reset();
        assert_eq!(
            config.get("servo.default_timeout_s").as_deref(),
            Ok("0.100000")
        );
    }

    #[test]
    fn numbers_are_kept_in_their_own_type() {
        let mut config = config();
        for (text, kept) in [("300", "44"), ("-1", "255"), ("what", "0"), ("12x", "12")] {
            config.set("servo.timeout_mode", text).expect("an entry");
            assert_eq!(
                config.get("servo.timeout_mode").as_deref(),
                Ok(kept),
                "{text}"
            );
        }
        config
            .set("motor_position.output.sign", "-1")
            .expect("an entry");
        assert_eq!(
            config.get("motor_position.output.sign").as_deref(),
            Ok("-1")
        );
    }

    #[test]
    fn unknown_names_are_refused_as_the_drive_does() {
        let mut config = config();
        assert_eq!(config.get("nothing.here"), Err(ConfigError::Group));
        assert_eq!(config.get("servo.nothing"), Err(ConfigError::Reading));
        assert_eq!(config.set("servo.nothing", "1"), Err(ConfigError::Setting));
        assert_eq!(config.enumerate("nothing"), Err(ConfigError::Group));
        let uuid = config.enumerate("uuid").expect("a group");
        assert_eq!(
            (uuid.lines().count(), uuid.lines().next()),
            (16, Some("uuid.uuid.0 7"))
        );
    }
}
