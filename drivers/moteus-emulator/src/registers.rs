//! Frames: the registers that they read and write, the pieces of the diagnostic stream that they carry.
//!
//! Source: moteus, protocol/can.md (subframes) and protocol/registers.md (registers); what is refused with which number, and
//! what ends a frame early: mjbots/mjlib, multiplex/micro_server.cc.

use crate::controller::{Controller, FIRMWARE, MODEL, REGISTER_MAP};
use crate::fdcanusb::FRAME_BYTES;
use crate::servo::{Command, Mode};
use crate::value::{
    ACCELERATION, Encoding, POSITION, POWER, SHARE, TEMPERATURE, TIME, TORQUE, VELOCITY, VOLTAGE,
    Value, put_varuint, take_varuint,
};

/// The channel of the diagnostic stream; 2 and 3 are the auxiliary ports' (moteus, protocol/diagnostic.md).
const DIAGNOSTIC_CHANNEL: u32 = 1;
/// Bytes of a frame that a piece of the stream leaves to its own head.
const STREAM_HEAD_BYTES: usize = 5;

/// Subframe types.
mod subframe {
    pub const WRITE: u32 = 0x00;
    pub const READ: u32 = 0x10;
    pub const REPLY: u8 = 0x20;
    pub const WRITE_ERROR: u8 = 0x30;
    pub const READ_ERROR: u8 = 0x31;
    pub const CLIENT_TO_SERVER: u32 = 0x40;
    pub const SERVER_TO_CLIENT: u8 = 0x41;
    pub const CLIENT_POLL: u32 = 0x42;
    pub const SERVER_TO_CLIENT_FLOW: u8 = 0x43;
    pub const CLIENT_POLL_FLOW: u32 = 0x44;
    pub const NOP: u32 = 0x50;
}

/// Numbers of refusals.
mod refusal {
    pub const UNKNOWN: u32 = 1;
    pub const READ_ONLY: u32 = 2;
}

/// How a write went.
enum Written {
    Yes,
    Unknown,
    ReadOnly,
    /// The frame is for another drive: one with another UUID.
    NotForUs,
}

/// A frame on its way through a drive.
struct Exchange<'a> {
    rest: &'a [u8],
    reply: Vec<u8>,
    /// Whether anybody hears the reply.
    is_answered: bool,
    command: Option<Command>,
    /// For another drive after all.
    discarded: bool,
}

impl Controller {
    /// Does what a frame's subframes ask, in their order; what it answers, or `None` if it was for another drive.
    ///
    /// A command acts when the frame has been read to its end or to what cannot be read. Where no answer is wanted nothing
    /// leaves the diagnostic stream.
    pub fn process(&mut self, data: &[u8], is_answered: bool) -> Option<Vec<u8>> {
        let mut exchange = Exchange {
            rest: data,
            reply: Vec::new(),
            is_answered,
            command: None,
            discarded: false,
        };
        // Nothing after what cannot be read is looked at.
        while self.subframe(&mut exchange).is_some() {}
        if exchange.discarded {
            return None;
        }
        if let Some(command) = exchange.command {
            self.command(command);
        }
        exchange.reply.truncate(FRAME_BYTES);
        Some(exchange.reply)
    }

    fn subframe(&mut self, exchange: &mut Exchange) -> Option<()> {
        let kind = take_varuint(&mut exchange.rest)?;
        match kind {
            subframe::NOP => Some(()),
            0x00..0x10 => self.write_registers(kind - subframe::WRITE, exchange),
            0x10..0x20 => self.read_registers(kind - subframe::READ, exchange),
            subframe::CLIENT_TO_SERVER => self.stream_in(exchange),
            subframe::CLIENT_POLL => self.stream_out(exchange),
            subframe::CLIENT_POLL_FLOW => self.stream_out_numbered(exchange),
            _ => None,
        }
    }

    fn write_registers(&mut self, kind: u32, exchange: &mut Exchange) -> Option<()> {
        let (encoding, count) = counted(kind, exchange)?;
        let first = take_varuint(&mut exchange.rest)?;
        for index in 0..count {
            let value = Value::take(&mut exchange.rest, encoding)?;
            let register = first.wrapping_add(index);
            let refused = match self.write(register, value, &mut exchange.command) {
                Written::Yes => continue,
                Written::Unknown => refusal::UNKNOWN,
                Written::ReadOnly => refusal::READ_ONLY,
                Written::NotForUs => {
                    exchange.discarded = true;
                    return None;
                }
            };
            refuse(
                subframe::WRITE_ERROR,
                register,
                refused,
                &mut exchange.reply,
            );
        }
        Some(())
    }

    fn read_registers(&mut self, kind: u32, exchange: &mut Exchange) -> Option<()> {
        let (encoding, count) = counted(kind, exchange)?;
        let first = take_varuint(&mut exchange.rest)?;
        let start = exchange.reply.len();
        exchange.reply.push(subframe::REPLY | kind as u8);
        if kind & 3 == 0 {
            put_varuint(count, &mut exchange.reply);
        }
        put_varuint(first, &mut exchange.reply);
        for index in 0..count {
            let register = first.wrapping_add(index);
            let Some(value) = self.read(register, encoding) else {
                exchange.reply.truncate(start);
                refuse(
                    subframe::READ_ERROR,
                    register,
                    refusal::UNKNOWN,
                    &mut exchange.reply,
                );
                return None;
            };
            // what a frame cannot carry is not asked for further
            if exchange.reply.len() > FRAME_BYTES {
                return None;
            }
            value.put(&mut exchange.reply);
        }
        Some(())
    }

    fn stream_in(&mut self, exchange: &mut Exchange) -> Option<()> {
        let channel = take_varuint(&mut exchange.rest)?;
        let length = take_varuint(&mut exchange.rest)? as usize;
        let (bytes, rest) = exchange.rest.split_at_checked(length)?;
        if channel != DIAGNOSTIC_CHANNEL {
            return None;
        }
        exchange.rest = rest;
        for line in self.tunnel.take(bytes) {
            self.diagnose(&line);
        }
        if exchange.is_answered {
            let piece = self.tunnel.piece(room(exchange));
            put_piece(
                subframe::SERVER_TO_CLIENT,
                None,
                &piece,
                &mut exchange.reply,
            );
        }
        Some(())
    }

    fn stream_out(&mut self, exchange: &mut Exchange) -> Option<()> {
        let channel = take_varuint(&mut exchange.rest)?;
        let at_most = take_varuint(&mut exchange.rest)? as usize;
        if channel != DIAGNOSTIC_CHANNEL || !exchange.is_answered {
            return None;
        }
        let room = room(exchange);
        let piece = self.tunnel.piece(room.min(at_most));
        put_piece(
            subframe::SERVER_TO_CLIENT,
            None,
            &piece,
            &mut exchange.reply,
        );
        Some(())
    }

    fn stream_out_numbered(&mut self, exchange: &mut Exchange) -> Option<()> {
        let channel = take_varuint(&mut exchange.rest)?;
        let (acknowledged, rest) = exchange.rest.split_first()?;
        exchange.rest = rest;
        let at_most = take_varuint(&mut exchange.rest)? as usize;
        if channel != DIAGNOSTIC_CHANNEL || !exchange.is_answered {
            return None;
        }
        let room = room(exchange);
        let (number, piece) = self.tunnel.numbered_piece(*acknowledged, room.min(at_most));
        put_piece(
            subframe::SERVER_TO_CLIENT_FLOW,
            Some(number),
            &piece,
            &mut exchange.reply,
        );
        Some(())
    }

    /// Writes a register. Those of the command belong to the mode written before them in the same frame.
    fn write(&mut self, register: u32, value: Value, command: &mut Option<Command>) -> Written {
        match register {
            0x000 => {
                let Some(mode) = Mode::from_command(value.to_whole()) else {
                    return Written::Unknown;
                };
                *command = Some(Command {
                    mode,
                    ..Command::default()
                });
                Written::Yes
            }
            0x01c | 0x01d | 0x020..=0x02d | 0x040..=0x048 => {
                if let Some(command) = command
                    && !set_field(command, register, value)
                {
                    return Written::Unknown;
                }
                Written::Yes
            }
            0x130 => {
                self.set_nearest(value.to_physical(POSITION));
                Written::Yes
            }
            0x131 => {
                self.set_exact(value.to_physical(POSITION));
                Written::Yes
            }
            0x132 => {
                self.require_reindex();
                Written::Yes
            }
            0x133 => {
                self.servo.recapture();
                Written::Yes
            }
            0x154..=0x157 => {
                let at = (register - 0x154) as usize * 4;
                let word: [u8; 4] = core::array::from_fn(|index| self.uuid[at + index]);
                if i32::from_le_bytes(word) == value.to_whole() {
                    Written::Yes
                } else {
                    Written::NotForUs
                }
            }
            _ if self.read(register, Encoding::Int32).is_some() => Written::ReadOnly,
            _ => Written::Unknown,
        }
    }

    /// Reads a register; `None` for one that there is not, or not in this encoding.
    fn read(&self, register: u32, encoding: Encoding) -> Option<Value> {
        let physical = |value: f64, scale| Some(Value::physical(value, scale, encoding));
        let whole = |value: i32| Some(Value::whole(value, encoding));
        let (parts, trajectory) = (self.servo.parts(), self.servo.trajectory());
        let command = self.servo.commanded();
        match register {
            0x000 => whole(self.servo.mode() as i32),
            0x001 => physical(self.position_rev(), POSITION),
            0x002 => physical(self.velocity_rev_s(), VELOCITY),
            0x003 => physical(self.torque_nm(), TORQUE),
            0x004 => physical(self.q_current_a(), TEMPERATURE),
            0x005 => physical(0.0, TEMPERATURE),
            0x006 | 0x052 => physical(zero_if_absent(self.link_encoder_rev()), POSITION),
            0x007 => physical(self.power_w(), POWER),
            0x00a => physical(0.0, TEMPERATURE),
            0x00b => whole(i32::from(trajectory.done)),
            0x00c => whole(self.homed() as i32),
            0x00d => physical(self.bus_v(), VOLTAGE),
            0x00e => physical(self.temperature_c(), TEMPERATURE),
            0x00f => whole(i32::from(self.servo.code())),
            0x01c => physical(command.q_current_a, TEMPERATURE),
            0x01d => physical(command.d_current_a, TEMPERATURE),
            0x020..=0x02d | 0x040..=0x048 => self.read_command(command, register, encoding),
            0x030 => physical(parts.proportional_nm, TORQUE),
            0x031 => physical(parts.integral_nm, TORQUE),
            0x032 => physical(parts.derivative_nm, TORQUE),
            0x033 => physical(command.feedforward_nm, TORQUE),
            0x034 | 0x03a => physical(parts.command_nm, TORQUE),
            0x038 => physical(trajectory.position_rev.unwrap_or(f64::NAN), POSITION),
            0x039 => physical(trajectory.velocity_rev_s, VELOCITY),
            0x03b => physical(parts.error_rev, POSITION),
            0x03c => physical(parts.error_rev_s, VELOCITY),
            0x03d => physical(self.torque_nm() - parts.command_nm, TORQUE),
            0x050 => physical(self.rotor_encoder_rev(), POSITION),
            0x051 => physical(self.sensors.rotor_rev_s, VELOCITY),
            0x053 if self.has_link_encoder() => physical(self.velocity_rev_s(), VELOCITY),
            0x053..=0x055 => physical(0.0, POSITION),
            0x058 => whole(if self.has_link_encoder() {
                0b1111
            } else {
                0b0011
            }),
            0x070 => whole(self.milliseconds as i32),
            0x100 => only_four_bytes(MODEL as i32, encoding),
            0x101 => only_four_bytes(FIRMWARE as i32, encoding),
            0x102 => only_four_bytes(REGISTER_MAP, encoding),
            0x120..=0x122 => {
                only_four_bytes(self.serial[(register - 0x120) as usize] as i32, encoding)
            }
            0x140 | 0x141 => whole(0),
            0x150..=0x153 => {
                let at = (register - 0x150) as usize * 4;
                let word: [u8; 4] = core::array::from_fn(|index| self.uuid[at + index]);
                only_four_bytes(i32::from_le_bytes(word), encoding)
            }
            0x158 => whole(1),
            _ => None,
        }
    }

    fn read_command(&self, command: &Command, register: u32, encoding: Encoding) -> Option<Value> {
        let physical = |value: f64, scale| Some(Value::physical(value, scale, encoding));
        match register {
            0x020 => physical(command.position_rev, POSITION),
            0x021 => physical(command.velocity_rev_s, VELOCITY),
            0x022 | 0x042 => physical(command.feedforward_nm, TORQUE),
            0x023 | 0x043 => physical(command.kp_scale, SHARE),
            0x024 | 0x044 => physical(command.kd_scale, SHARE),
            0x025 | 0x045 => physical(command.max_torque_nm, TORQUE),
            0x026 => physical(command.stop_position_rev, POSITION),
            0x027 | 0x046 => physical(command.timeout_s, TIME),
            0x028 => physical(command.velocity_limit_rev_s, VELOCITY),
            0x029 => physical(command.acceleration_limit_rev_s2, ACCELERATION),
            0x02b | 0x047 => physical(command.ilimit_scale, SHARE),
            0x02d | 0x048 => Some(Value::whole(i32::from(command.ignore_bounds), encoding)),
            0x040 => physical(command.bounds_rev[0], POSITION),
            0x041 => physical(command.bounds_rev[1], POSITION),
            _ => None,
        }
    }
}

/// Sets what a register of the command means; false for one that is not emulated.
fn set_field(command: &mut Command, register: u32, value: Value) -> bool {
    match register {
        0x01c => command.q_current_a = value.to_physical(TEMPERATURE),
        0x01d => command.d_current_a = value.to_physical(TEMPERATURE),
        0x020 => command.position_rev = value.to_physical(POSITION),
        0x021 => command.velocity_rev_s = value.to_physical(VELOCITY),
        0x022 | 0x042 => command.feedforward_nm = value.to_physical(TORQUE),
        0x023 | 0x043 => command.kp_scale = value.to_physical(SHARE),
        0x024 | 0x044 => command.kd_scale = value.to_physical(SHARE),
        0x025 | 0x045 => command.max_torque_nm = value.to_physical(TORQUE),
        0x026 => command.stop_position_rev = value.to_physical(POSITION),
        0x027 | 0x046 => command.timeout_s = value.to_physical(TIME),
        0x028 => command.velocity_limit_rev_s = value.to_physical(VELOCITY),
        0x029 => command.acceleration_limit_rev_s2 = value.to_physical(ACCELERATION),
        0x02b | 0x047 => command.ilimit_scale = value.to_physical(SHARE),
        0x02d | 0x048 => command.ignore_bounds = value.to_whole() != 0,
        0x040 => command.bounds_rev[0] = value.to_physical(POSITION),
        0x041 => command.bounds_rev[1] = value.to_physical(POSITION),
        // A fixed voltage or current asked for is not given; NaN asks for none.
        0x02a | 0x02c => return value.to_physical(VOLTAGE).is_nan(),
        _ => return false,
    }
    true
}

fn counted(kind: u32, exchange: &mut Exchange) -> Option<(Encoding, u32)> {
    let count = match kind & 3 {
        0 => take_varuint(&mut exchange.rest)?,
        count => count,
    };
    Some((Encoding::from_bits((kind >> 2) as u8), count))
}

fn refuse(kind: u8, register: u32, number: u32, reply: &mut Vec<u8>) {
    reply.push(kind);
    put_varuint(register, reply);
    put_varuint(number, reply);
}

fn room(exchange: &Exchange) -> usize {
    FRAME_BYTES.saturating_sub(exchange.reply.len() + STREAM_HEAD_BYTES)
}

fn put_piece(kind: u8, number: Option<u8>, piece: &[u8], reply: &mut Vec<u8>) {
    reply.push(kind);
    put_varuint(DIAGNOSTIC_CHANNEL, reply);
    reply.extend(number);
    put_varuint(piece.len() as u32, reply);
    reply.extend_from_slice(piece);
}

fn only_four_bytes(value: i32, encoding: Encoding) -> Option<Value> {
    (encoding == Encoding::Int32).then_some(Value::Int32(value))
}

/// An encoder that is not there reads as 0.
fn zero_if_absent(value: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::controller::Sensors;
    use moteus_protocol::Register;
    use moteus_protocol::command::{PositionCommand, PositionFormat, StopCommand};
    use moteus_protocol::query::{QueryFormat, QueryResult};
    use moteus_protocol::{CanFdFrame, Resolution};

    fn drive() -> Controller {
        let mut config = Config::factory([9; 16]);
        config.configure("motor.poles", 14.0);
        config.configure("motor_position.rotor_to_output_ratio", 0.1);
        let sensors = Sensors {
            rotor_rev: 2.5,
            link_rev: f64::NAN,
            ..Sensors::default()
        };
        Controller::new([3; 16], config, sensors, true)
    }

    #[test]
    fn what_the_makers_crate_asks_is_answered_in_every_encoding() {
        for (resolution, tolerance) in [
            (Resolution::Int8, 0.01),
            (Resolution::Int16, 1e-4),
            (Resolution::Int32, 2e-5),
            (Resolution::Float, 2e-5),
        ] {
            let mut format = QueryFormat::default();
            format.position = resolution;
            format.velocity = resolution;
            format.voltage = resolution;
            let mut frame = CanFdFrame::new();
            format.serialize(&mut frame);
            let reply = drive().process(frame.payload(), true).expect("for us");
            let result = QueryResult::parse_data(&reply);
            assert!(
                (f64::from(result.position) - 0.25).abs() < tolerance,
                "{resolution:?}"
            );
            assert!(
                (f64::from(result.voltage) - 24.0).abs() < 0.26,
                "{resolution:?}"
            );
            assert_eq!(result.fault, 0);
        }
    }

    #[test]
    fn what_the_makers_crate_commands_arrives() {
        let mut drive = drive();
        let mut command = PositionCommand::new();
        command.position = Some(f32::NAN);
        command.velocity = Some(0.5);
        command.kp_scale = Some(0.25);
        command.maximum_torque = Some(2.0);
        command.watchdog_timeout = Some(0.2);
        let mut frame = CanFdFrame::new();
        command.serialize(&mut frame, &PositionFormat::default());
        drive.process(frame.payload(), true).expect("for us");
        let arrived = *drive.servo().commanded();
        assert_eq!(arrived.mode, Mode::Position);
        assert!(arrived.position_rev.is_nan() && arrived.kd_scale == 1.0);
        let numbers = [
            arrived.velocity_rev_s,
            arrived.kp_scale,
            arrived.max_torque_nm,
        ];
        assert_eq!(numbers, [0.5, 0.25, 2.0]);
        assert!((arrived.timeout_s - 0.2).abs() < 1e-7);

        let mut frame = CanFdFrame::new();
        StopCommand::serialize(&mut frame);
        drive.process(frame.payload(), true).expect("for us");
        assert_eq!(drive.servo().commanded().mode, Mode::Stopped);
    }

    #[test]
    fn registers_that_are_not_there_are_refused_by_number() {
        // read int8 0x3ff; nothing after it is looked at
        assert_eq!(
            drive().process(&[0x11, 0xff, 0x07, 0x11, 0x00], true),
            Some(vec![0x31, 0xff, 0x07, 1])
        );
        // write int8 0x00d, which is read only, then read the mode
        assert_eq!(
            drive().process(&[0x01, 0x0d, 0x01, 0x11, 0x00], true),
            Some(vec![0x30, 0x0d, 2, 0x21, 0x00, 0x00])
        );
        // mode 6 sets voltages
        assert_eq!(
            drive().process(&[0x01, 0x00, 0x06], true),
            Some(vec![0x30, 0x00, 1])
        );
    }

    #[test]
    fn a_frame_for_another_uuid_is_not_answered_and_does_nothing() {
        let word = i32::from_le_bytes([3; 4]);
        let mut frame = vec![0x09, 0xd4, 0x02];
        frame.extend(word.to_le_bytes());
        frame.extend([0x11, 0x00]);
        assert_eq!(drive().process(&frame, true), Some(vec![0x21, 0x00, 0x00]));
        frame[3] ^= 1;
        assert_eq!(drive().process(&frame, true), None);
    }

    #[test]
    fn every_register_the_makers_crate_names_is_known_or_belongs_to_what_is_left_out() {
        // phases and voltages, fixed voltage and current, ports, clock trim, and those that are written only
        let left_out = |register: u32| matches!(register, 0x010..=0x01b | 0x01e | 0x02a | 0x02c | 0x05c..=0x06c | 0x071..=0x07f | 0x110 | 0x130..=0x133 | 0x154..=0x157);
        for address in 0..0x200_u16 {
            if Register::from_address(address).is_none() {
                continue;
            }
            let known = drive().read(u32::from(address), Encoding::Int32).is_some();
            assert_eq!(known, !left_out(u32::from(address)), "{address:#x}");
        }
    }
}
