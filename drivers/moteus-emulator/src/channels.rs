//! The telemetry channels: what `tel list` shows and `tel get` gives.
//!
//! Names and fields follow the maker's firmware (fw/bldc_servo_structs.h, fw/motor_position.h, fw/firmware_info.cc), so that
//! its tools find what they plot. Fields that belong to what is not emulated are left out.

use crate::controller::{Controller, FAMILY, FIRMWARE, MODEL, REVISION};
use crate::telemetry::Node;

/// The channels, in the order of `tel list`.
pub const NAMES: [&str; 5] = [
    "firmware",
    "git",
    "servo_stats",
    "servo_cmd",
    "motor_position",
];

const MODES: &[(u32, &str)] = &[
    (0, "stopped"),
    (1, "fault"),
    (2, "enabling"),
    (3, "calibrating"),
    (4, "calib_complete"),
    (5, "pwm"),
    (6, "voltage"),
    (7, "voltage_foc"),
    (8, "voltage_dq"),
    (9, "current"),
    (10, "position"),
    (11, "pos_timeout"),
    (12, "zero_vel"),
    (13, "within"),
    (14, "meas_ind"),
    (15, "brake"),
];

const CODES: &[(u32, &str)] = &[
    (0, "success"),
    (32, "calibration_fault"),
    (33, "motor_driver_fault"),
    (34, "over_voltage"),
    (35, "encoder_fault"),
    (36, "motor_not_configured"),
    (37, "pwm_cycle_overrun"),
    (38, "over_temperature"),
    (39, "start_outside_limit"),
    (40, "under_voltage"),
    (41, "config_changed"),
    (42, "theta_invalid"),
    (43, "position_invalid"),
    (44, "driver_enable_fault"),
    (45, "stop_position_deprecated"),
    (46, "timing_violation"),
    (47, "bemf_feedforward_no_accel"),
    (48, "invalid_limits"),
    (49, "position_control_error"),
    (50, "velocity_control_error"),
    (96, "limit.max_velocity"),
    (97, "limit.max_power"),
    (98, "limit.max_voltage"),
    (99, "limit.max_current"),
    (100, "limit.fet_temperature"),
    (101, "limit.motor_temperature"),
    (102, "limit.max_torque"),
    (103, "limit.position_bounds"),
];

const HOMED: &[(u32, &str)] = &[(0, "relative"), (1, "rotor"), (2, "output")];
const ERRORS: &[(u32, &str)] = &[(0, "none")];

impl Controller {
    /// The value of a channel, by its place in [`NAMES`].
    pub(crate) fn channel(&self, index: usize) -> Node {
        match NAMES[index] {
            "firmware" => self.firmware(),
            "git" => git(),
            "servo_stats" => self.servo_stats(),
            "servo_cmd" => self.servo_cmd(),
            _ => self.motor_position(),
        }
    }

    fn firmware(&self) -> Node {
        Node::Object(vec![
            ("version", Node::U32(FIRMWARE)),
            (
                "serial_number",
                Node::Array(self.serial.map(Node::U32).to_vec()),
            ),
            ("model", Node::U32(MODEL)),
            ("family", Node::U8(FAMILY)),
            ("hwrev", Node::U8(REVISION)),
        ])
    }

    fn servo_stats(&self) -> Node {
        let (parts, trajectory) = (self.servo.parts(), self.servo.trajectory());
        let wanted_rev = trajectory.position_rev.unwrap_or(f64::NAN);
        Node::Object(vec![
            ("mode", Node::Enum(self.servo.mode() as u32, MODES)),
            ("fault", Node::Enum(u32::from(self.servo.code()), CODES)),
            ("bus_V", Node::number(self.bus_v())),
            ("filt_bus_V", Node::number(self.bus_v())),
            ("filt_1ms_bus_V", Node::number(self.bus_v())),
            ("fet_temp_C", Node::number(self.temperature_c())),
            ("filt_fet_temp_C", Node::number(self.temperature_c())),
            ("motor_temp_C", Node::number(0.0)),
            ("filt_motor_temp_C", Node::number(0.0)),
            ("d_A", Node::number(0.0)),
            ("q_A", Node::number(self.q_current_a())),
            ("position", Node::number(self.position_rev())),
            ("velocity", Node::number(self.velocity_rev_s())),
            ("torque_Nm", Node::number(self.torque_nm())),
            ("power_W", Node::number(self.power_w())),
            ("velocity_filt", Node::number(self.velocity_rev_s())),
            (
                "pid_position",
                Node::Object(vec![
                    ("integral", Node::number(parts.integral_nm)),
                    ("error", Node::number(parts.error_rev)),
                    ("error_rate", Node::number(parts.error_rev_s)),
                    ("p", Node::number(parts.proportional_nm)),
                    ("d", Node::number(parts.derivative_nm)),
                    (
                        "pd",
                        Node::number(parts.proportional_nm + parts.derivative_nm),
                    ),
                    ("command", Node::number(parts.command_nm)),
                ]),
            ),
            ("control_position", Node::number(wanted_rev)),
            ("control_velocity", Node::number(trajectory.velocity_rev_s)),
            (
                "control_acceleration",
                Node::number(trajectory.acceleration_rev_s2),
            ),
            ("timeout_s", Node::number(self.servo.timeout_s())),
            ("trajectory_done", Node::Bool(trajectory.done)),
            (
                "torque_error_Nm",
                Node::number(self.torque_nm() - parts.command_nm),
            ),
        ])
    }

    fn servo_cmd(&self) -> Node {
        let command = self.servo.commanded();
        Node::Object(vec![
            ("mode", Node::Enum(command.mode as u32, MODES)),
            ("i_d_A", Node::number(command.d_current_a)),
            ("i_q_A", Node::number(command.q_current_a)),
            ("position", Node::number(command.position_rev)),
            ("velocity", Node::number(command.velocity_rev_s)),
            ("max_torque_Nm", Node::number(command.max_torque_nm)),
            ("stop_position", Node::number(command.stop_position_rev)),
            ("feedforward_Nm", Node::number(command.feedforward_nm)),
            ("kp_scale", Node::number(command.kp_scale)),
            ("kd_scale", Node::number(command.kd_scale)),
            ("ilimit_scale", Node::number(command.ilimit_scale)),
            ("velocity_limit", Node::number(command.velocity_limit_rev_s)),
            (
                "accel_limit",
                Node::number(command.acceleration_limit_rev_s2),
            ),
            ("ignore_position_bounds", Node::Bool(command.ignore_bounds)),
            ("timeout_s", Node::number(command.timeout_s)),
            ("bounds_min", Node::number(command.bounds_rev[0])),
            ("bounds_max", Node::number(command.bounds_rev[1])),
        ])
    }

    fn motor_position(&self) -> Node {
        let counts = self.config.number("motor_position.sources.0.cpr");
        let link_counts = self.config.number("motor_position.sources.1.cpr");
        let source = |rev: f64, rev_s: f64, counts: f64| {
            let is_there = !rev.is_nan();
            let shown = if is_there { rev } else { 0.0 };
            Node::Object(vec![
                ("active_velocity", Node::Bool(is_there)),
                ("active_theta", Node::Bool(is_there)),
                ("active_absolute", Node::Bool(is_there)),
                ("raw", Node::U32((shown * counts) as u32)),
                ("offset_value", Node::U32((shown * counts) as u32)),
                ("compensated_value", Node::number(shown * counts)),
                ("filtered_value", Node::number(shown * counts)),
                (
                    "velocity",
                    Node::number(if is_there { rev_s * counts } else { 0.0 }),
                ),
            ])
        };
        let position_rev = self.exact_position_rev();
        Node::Object(vec![
            ("error", Node::Enum(0, ERRORS)),
            (
                "sources",
                Node::Array(vec![
                    source(self.rotor_encoder_rev(), self.sensors.rotor_rev_s, counts),
                    source(self.link_encoder_rev(), self.velocity_rev_s(), link_counts),
                    source(f64::NAN, f64::NAN, counts),
                ]),
            ),
            ("position_relative_valid", Node::Bool(true)),
            (
                "position_raw",
                Node::I64((position_rev * 2_f64.powi(48)) as i64),
            ),
            ("position", Node::number(self.position_rev())),
            ("homed", Node::Enum(self.homed() as u32, HOMED)),
            ("velocity", Node::number(self.velocity_rev_s())),
            ("theta_valid", Node::Bool(true)),
        ])
    }

    /// Says what is to be said of its own accord in this millisecond.
    pub(crate) fn emit_periodic(&mut self) {
        for (index, name) in NAMES.iter().enumerate() {
            let channel = &mut self.channels[index];
            if channel.every_ms == 0 {
                continue;
            }
            channel.next_ms = channel.next_ms.saturating_sub(1);
            if channel.next_ms > 0 {
                continue;
            }
            channel.next_ms = channel.every_ms;
            if self.tunnel.is_read() {
                let said = self.emitted(index, name);
                self.tunnel.say(&said);
            }
        }
    }

    /// A channel's value as the stream carries it, in text or binary as was asked.
    pub(crate) fn emitted(&self, index: usize, name: &str) -> Vec<u8> {
        let node = self.channel(index);
        if self.channels[index].is_text {
            return (node.text(name) + "OK\r\n").into_bytes();
        }
        blob("emit", name, &node.data())
    }
}

/// A line, then a block of bytes with its length before it.
pub(crate) fn blob(word: &str, name: &str, bytes: &[u8]) -> Vec<u8> {
    let mut out = format!("{word} {name}\r\n").into_bytes();
    out.extend((bytes.len() as u32).to_le_bytes());
    out.extend(bytes);
    out
}

/// The firmware's revision: none, this is no firmware.
fn git() -> Node {
    Node::Object(vec![
        ("hash", Node::Array(vec![Node::U8(0); 20])),
        ("dirty", Node::Bool(false)),
        ("timestamp", Node::U64(0)),
    ])
}
