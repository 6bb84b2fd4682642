//! One drive: identity, configuration, control, registers and diagnostic stream.

use core::f64::consts::TAU;

use crate::config::Config;
use crate::servo::{Command, Measured, Mode, Servo, Tuning};
use crate::tunnel::Tunnel;

/// Model number (fw/moteus_hw.h).
pub const MODEL: u32 = 0;
/// Board: moteus-r4.11, as the telemetry channel `firmware` names it.
pub const FAMILY: u8 = 0;
/// See [`FAMILY`].
pub const REVISION: u8 = 8;
/// Firmware version and interface: the newest that the maker's tools of 2026 know (`SUPPORTED_ABI_VERSION`).
pub const FIRMWARE: u32 = 0x01_01_00;
/// Register map (fw/moteus_controller.cc, `kRegisterMapVersion`).
pub const REGISTER_MAP: i32 = 5;
/// Supply of the emulated drives.
const BUS_V: f64 = 24.0;
/// Of the power stage; its warming is not emulated.
const TEMPERATURE_C: f64 = 30.0;
/// Steps of the output position in a revolution: positions are kept with 16 bits behind the point (fw/motor_position.h,
/// `IntToFloat`).
const POSITION_STEPS: f64 = 65_536.0;

/// What the output position is referenced to; register 0x00c.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Homed {
    /// To nothing.
    Relative = 0,
    /// To the rotor's encoder: right but for whole turns of the rotor.
    Rotor = 1,
    /// To the output.
    Output = 2,
}

/// What the sensors at the joint show.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sensors {
    /// Turns of the motor since the joint's zero.
    pub rotor_rev: f64,
    /// How fast it turns.
    pub rotor_rev_s: f64,
    /// Current times torque constant, before the gear.
    pub motor_torque_nm: f64,
    /// Turns of the joint, where it has an encoder of its own; else NaN.
    pub link_rev: f64,
}

/// A telemetry channel's state.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Channel {
    pub is_text: bool,
    pub every_ms: u32,
    pub next_ms: u32,
}

/// One drive.
#[derive(Clone, Debug)]
pub struct Controller {
    pub(crate) uuid: [u8; 16],
    pub(crate) serial: [u32; 3],
    pub(crate) config: Config,
    pub(crate) tuning: Tuning,
    pub(crate) servo: Servo,
    pub(crate) tunnel: Tunnel,
    pub(crate) channels: [Channel; crate::channels::NAMES.len()],
    pub(crate) sensors: Sensors,
    pub(crate) milliseconds: u32,
    homed: Homed,
    /// Output position less what the rotor's turns make of it.
    base_rev: f64,
    is_powered: bool,
}

impl Controller {
    /// A drive configured as `config` has it, its output position known if it `is_homed`.
    pub fn new(uuid: [u8; 16], config: Config, sensors: Sensors, is_homed: bool) -> Self {
        let word = |index: usize| {
            u32::from_le_bytes([
                uuid[index],
                uuid[index + 1],
                uuid[index + 2],
                uuid[index + 3],
            ])
        };
        let mut controller = Self {
            uuid,
            serial: [word(0), word(4), word(8)],
            tuning: Tuning::of(&config),
            config,
            servo: Servo::default(),
            tunnel: Tunnel::default(),
            channels: Default::default(),
            sensors,
            milliseconds: 0,
            homed: Homed::Rotor,
            base_rev: 0.0,
            is_powered: true,
        };
        controller.find_position();
        if is_homed {
            controller.base_rev = 0.0;
            controller.homed = Homed::Output;
        }
        controller
    }

    /// The identifier it answers to, 7 bits.
    pub fn id(&self) -> u8 {
        self.config.number("id.id") as u8 & 0x7f
    }

    /// The upper bits of the identifiers it answers to.
    pub fn prefix(&self) -> u16 {
        self.config.number("can.prefix") as u16
    }

    /// Its control.
    pub fn servo(&self) -> &Servo {
        &self.servo
    }

    /// What its output position is referenced to.
    pub fn homed(&self) -> Homed {
        self.homed
    }

    /// Whether it has supply.
    pub fn is_powered(&self) -> bool {
        self.is_powered
    }

    /// Output position as the drive reports it, in steps of its own.
    pub fn position_rev(&self) -> f64 {
        (self.exact_position_rev() * POSITION_STEPS).floor() / POSITION_STEPS
    }

    /// Output velocity as the drive reports it.
    pub fn velocity_rev_s(&self) -> f64 {
        self.sensors.rotor_rev_s * self.turned_ratio()
    }

    /// Output torque as the current tells; 0 without current.
    pub fn torque_nm(&self) -> f64 {
        if self.is_driven() && self.tuning.ratio != 0.0 {
            self.sensors.motor_torque_nm * self.output_sign() / self.tuning.ratio
        } else {
            0.0
        }
    }

    /// Current of the torque.
    pub fn q_current_a(&self) -> f64 {
        if self.is_driven() {
            self.sensors.motor_torque_nm * self.output_sign() / self.tuning.torque_constant_nm_a
        } else {
            0.0
        }
    }

    /// Electrical power at the motor's shaft; what the windings heat with is not emulated.
    pub fn power_w(&self) -> f64 {
        self.torque_nm() * self.velocity_rev_s() * TAU
    }

    /// Supply voltage.
    pub fn bus_v(&self) -> f64 {
        BUS_V
    }

    /// Temperature of the power stage.
    pub fn temperature_c(&self) -> f64 {
        TEMPERATURE_C
    }

    /// The rotor's encoder, 0 to 1, as source 0.
    pub fn rotor_encoder_rev(&self) -> f64 {
        self.sensors.rotor_rev.rem_euclid(1.0)
    }

    /// The encoder at the joint, 0 to 1, as source 1; NaN where there is none.
    pub fn link_encoder_rev(&self) -> f64 {
        self.sensors.link_rev.rem_euclid(1.0)
    }

    /// Whether there is an encoder at the joint.
    pub fn has_link_encoder(&self) -> bool {
        !self.sensors.link_rev.is_nan()
    }

    fn output_sign(&self) -> f64 {
        self.tuning.output_sign
    }

    fn turned_ratio(&self) -> f64 {
        self.output_sign() * self.tuning.ratio
    }

    fn is_driven(&self) -> bool {
        !matches!(
            self.servo.mode(),
            Mode::Stopped | Mode::Fault | Mode::Enabling | Mode::Calibrating
        )
    }

    pub(crate) fn exact_position_rev(&self) -> f64 {
        self.sensors.rotor_rev * self.turned_ratio() + self.base_rev
    }

    /// Output position as far as the rotor's encoder alone tells: between plus and minus half of a rotor's turn.
    fn rotor_position_rev(&self) -> f64 {
        let offset_rev = self.config.number("motor_position.output.offset");
        let turn_rev = self.tuning.ratio.abs();
        let position_rev =
            (self.rotor_encoder_rev() * self.tuning.ratio + offset_rev) * self.output_sign();
        balanced(position_rev, turn_rev)
    }

    /// Finds the position after power-on: by the encoder at the joint where there is one, else within a turn of the rotor.
    fn find_position(&mut self) {
        let rotor_rev = self.rotor_position_rev();
        let (position_rev, homed) = match self.link_position_rev() {
            Some(link_rev) => (self.nearest_rev(link_rev), Homed::Output),
            None => (rotor_rev, Homed::Rotor),
        };
        self.homed = homed;
        self.base_rev = position_rev - self.sensors.rotor_rev * self.turned_ratio();
    }

    fn link_position_rev(&self) -> Option<f64> {
        let is_reference = self.config.number("motor_position.output.reference_source") == 1.0;
        let offset_rev = self.config.number("motor_position.output.offset");
        (is_reference && self.has_link_encoder()).then(|| {
            balanced(
                (self.link_encoder_rev() + offset_rev) * self.output_sign(),
                1.0,
            )
        })
    }

    /// The position next to `value_rev` that the rotor's encoder allows.
    fn nearest_rev(&self, value_rev: f64) -> f64 {
        let rotor_rev = self.rotor_position_rev();
        let turn_rev = self.tuning.ratio.abs();
        if turn_rev == 0.0 {
            return value_rev;
        }
        rotor_rev + ((value_rev - rotor_rev) / turn_rev).round() * turn_rev
    }

    /// Registers and diagnostics: whole rotor turns are chosen so that the position is next to this one.
    pub fn set_nearest(&mut self, value_rev: f64) {
        if !value_rev.is_finite() {
            return;
        }
        let position_rev = match self.link_position_rev() {
            // whole turns of the output are what is open then
            Some(link_rev) => {
                let known_rev = self.nearest_rev(link_rev);
                known_rev + (value_rev - known_rev).round()
            }
            None => self.nearest_rev(value_rev),
        };
        self.place(position_rev);
    }

    /// Registers and diagnostics: the position is this one from now on.
    pub fn set_exact(&mut self, value_rev: f64) {
        if value_rev.is_finite() {
            self.place(value_rev);
        }
    }

    fn place(&mut self, position_rev: f64) {
        self.base_rev = position_rev - self.sensors.rotor_rev * self.turned_ratio();
        self.homed = Homed::Output;
        self.servo.recapture();
    }

    /// Diagnostics: the configured offset is changed so that the position is this one, also after the next power-on.
    pub fn configure_output(&mut self, value_rev: f64) {
        if !value_rev.is_finite() {
            return;
        }
        self.config.change("motor_position.output.offset", 0.0);
        self.set_nearest(value_rev);
        let missing_rev = (value_rev - self.exact_position_rev()) * self.output_sign();
        self.config
            .change("motor_position.output.offset", missing_rev);
        self.set_nearest(value_rev);
    }

    /// Registers and diagnostics: what is known of the position is forgotten.
    pub fn require_reindex(&mut self) {
        self.find_position();
        self.homed = Homed::Relative;
    }

    /// Takes a command.
    pub fn command(&mut self, command: Command) {
        self.servo.command(command, &self.tuning);
    }

    /// To be called when the configuration has changed. A change of ratio or sign starts the position anew.
    pub fn reconfigured(&mut self) {
        let before = self.turned_ratio();
        self.tuning = Tuning::of(&self.config);
        if self.turned_ratio() != before {
            self.find_position();
        }
    }

    /// Loses or gets back its supply. It comes back as configured and written, and knows its position as after power-on.
    pub fn power(&mut self, is_on: bool) {
        if is_on && !self.is_powered {
            self.config.load();
            self.tuning = Tuning::of(&self.config);
            self.servo = Servo::default();
            self.tunnel = Tunnel::default();
            self.channels = Default::default();
            self.milliseconds = 0;
            self.find_position();
        }
        self.is_powered = is_on;
    }

    /// One step: from what the sensors show to the motor's torque, motor side.
    pub fn step(&mut self, sensors: Sensors, step_s: f64) -> f64 {
        self.sensors = sensors;
        if !self.is_powered {
            return 0.0;
        }
        let measured = Measured {
            position_rev: self.exact_position_rev(),
            velocity_rev_s: self.velocity_rev_s(),
            motor_torque_nm: sensors.motor_torque_nm,
            bus_v: BUS_V,
            temperature_c: TEMPERATURE_C,
        };
        self.servo.step(&measured, &self.tuning, step_s) * self.output_sign()
    }

    /// Another millisecond has passed.
    pub fn tick(&mut self) {
        self.milliseconds = self.milliseconds.wrapping_add(1);
        if self.is_powered {
            self.emit_periodic();
        }
    }
}

/// The value within plus and minus half of `span`, whole spans away.
fn balanced(value: f64, span: f64) -> f64 {
    if span == 0.0 {
        return 0.0;
    }
    value - (value / span).round() * span
}

#[cfg(test)]
mod tests {
    use super::*;

    fn controller(rotor_rev: f64, link_rev: f64, is_homed: bool) -> Controller {
        let mut config = Config::factory([1; 16]);
        config.configure("motor_position.rotor_to_output_ratio", 0.01);
        if !link_rev.is_nan() {
            config.configure("motor_position.output.reference_source", 1.0);
        }
        let sensors = Sensors {
            rotor_rev,
            link_rev,
            ..Sensors::default()
        };
        Controller::new([1; 16], config, sensors, is_homed)
    }

    #[test]
    fn without_an_encoder_at_the_joint_whole_rotor_turns_are_unknown_until_somebody_tells() {
        let mut drive = controller(20.3, f64::NAN, false);
        assert_eq!(drive.homed(), Homed::Rotor);
        assert!((drive.position_rev() - 0.003).abs() < 1e-4);
        drive.set_nearest(0.2);
        assert_eq!(drive.homed(), Homed::Output);
        assert!((drive.position_rev() - 0.203).abs() < 1e-4);
        drive.set_exact(-0.4);
        assert!((drive.position_rev() + 0.4).abs() < 1e-4);
    }

    #[test]
    fn an_encoder_at_the_joint_tells_them() {
        let drive = controller(-20.3, -0.203, false);
        assert_eq!(drive.homed(), Homed::Output);
        assert!((drive.position_rev() + 0.203).abs() < 1e-4);
    }

    #[test]
    fn a_configured_offset_survives_power_once_written_and_whole_turns_do_not() {
        let mut drive = controller(20.3, f64::NAN, true);
        drive.configure_output(0.0);
        assert!(drive.position_rev().abs() < 1e-4);
        drive.config.save();
        drive.power(false);
        drive.power(true);
        assert_eq!(drive.homed(), Homed::Rotor);
        assert!(drive.position_rev().abs() < 1e-4);
    }

    #[test]
    fn the_reported_position_has_sixteen_bits_behind_the_point() {
        let drive = controller(20.3, f64::NAN, true);
        let steps = drive.position_rev() * 65_536.0;
        assert_eq!(steps, steps.round());
    }
}
