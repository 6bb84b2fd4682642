//! Frames: what is asked of a drive in a cycle, and what it answers. No port, no clock, no heap.

use moteus_protocol::command::{PositionCommand, PositionFormat};
use moteus_protocol::{
    CanFdFrame, READ_FLOAT, READ_INT8, Register, Resolution, Subframe, SubframeType, WRITE_INT8,
    WriteCanData, calculate_arbitration_id, parse_arbitration_id, parse_frame, scaling,
};

/// Torque that 16 bits carry, in steps of 0.01 Nm (moteus, protocol/registers.md, "Torque"); above it a float is sent.
const INT16_TORQUE_MAX_NM: f64 = 327.67;

/// What a drive is to do, at its output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Ask {
    /// Nothing new.
    Query,
    /// No current; ends faults and timeouts.
    Stop,
    /// Windings shorted.
    Brake,
    /// No velocity, by the drive's own damping.
    ZeroVelocity,
    /// Position control with its parts scaled, and a torque added.
    Position(Aim),
}

/// What position control aims at. NaN is "not controlled".
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Aim {
    pub position_rev: f64,
    pub velocity_rev_s: f64,
    pub torque_nm: f64,
    pub kp_scale: f64,
    pub kd_scale: f64,
    pub torque_max_nm: f64,
}

impl Aim {
    /// The torque alone.
    pub fn torque(torque_nm: f64, torque_max_nm: f64) -> Self {
        Self {
            position_rev: f64::NAN,
            velocity_rev_s: 0.0,
            torque_nm,
            kp_scale: 0.0,
            kd_scale: 0.0,
            torque_max_nm,
        }
    }
}

/// The frame for the drive `id`: what to do, and the question how it is.
pub(crate) fn frame(id: u8, ask: &Ask, has_link_encoder: bool) -> CanFdFrame {
    let mut frame = CanFdFrame::new();
    frame.arbitration_id = calculate_arbitration_id(0, id as i8, 0, true);
    match ask {
        Ask::Query => {}
        Ask::Stop => write_mode(&mut frame, 0),
        Ask::Brake => write_mode(&mut frame, 15),
        Ask::ZeroVelocity => write_mode(&mut frame, 12),
        Ask::Position(aim) => write_aim(&mut frame, aim),
    }
    write_query(&mut frame, has_link_encoder);
    frame
}

fn write_mode(frame: &mut CanFdFrame, mode: i8) {
    let mut data = WriteCanData::new(frame);
    data.write_u8(WRITE_INT8 | 1);
    data.write_u8(Register::Mode.address() as u8);
    data.write_i8(mode);
}

fn write_aim(frame: &mut CanFdFrame, aim: &Aim) {
    let mut format = PositionFormat::default();
    let mut command = PositionCommand::new();
    command.position = Some(aim.position_rev as f32);
    command.feedforward_torque = Some(aim.torque_nm as f32);
    command.kp_scale = Some(aim.kp_scale as f32);
    command.kd_scale = Some(aim.kd_scale as f32);
    command.maximum_torque = Some(aim.torque_max_nm as f32);
    let is_torque_alone = aim.position_rev.is_nan() && aim.kp_scale == 0.0 && aim.kd_scale == 0.0;
    if is_torque_alone {
        // NaN and nothing need no more than a byte each
        format.position = Resolution::Int8;
        format.kp_scale = Resolution::Int8;
        format.kd_scale = Resolution::Int8;
    } else {
        format.kp_scale = Resolution::Int16;
        format.kd_scale = Resolution::Int16;
        command.velocity = Some(aim.velocity_rev_s as f32);
        // The reference comes from the loop: no trajectory of the drive's own may lie between. Negative is no limit.
        command.velocity_limit = Some(-1.0);
        command.accel_limit = Some(-1.0);
        format.velocity_limit = Resolution::Int8;
        format.accel_limit = Resolution::Int8;
    }
    if aim.torque_max_nm <= INT16_TORQUE_MAX_NM {
        format.maximum_torque = Resolution::Int16;
    }
    command.serialize(frame, &format);
}

/// Mode; position; torque; the rotor's encoder and its velocity, and the joint's where there is one; home state, supply,
/// temperature and fault.
fn write_query(frame: &mut CanFdFrame, has_link_encoder: bool) {
    let encoders = if has_link_encoder { 3 } else { 2 };
    let mut data = WriteCanData::new(frame);
    data.write_u8(READ_INT8 | 1);
    data.write_u8(Register::Mode.address() as u8);
    data.write_u8(READ_FLOAT | 1);
    data.write_u8(Register::Position.address() as u8);
    data.write_u8(READ_FLOAT | 1);
    data.write_u8(Register::Torque.address() as u8);
    data.write_u8(READ_FLOAT | encoders);
    data.write_u8(Register::Encoder0Position.address() as u8);
    data.write_u8(READ_INT8);
    data.write_u8(4);
    data.write_u8(Register::HomeState.address() as u8);
}

/// Bytes of a command in the mode that the loop uses, for what a bus can carry.
pub(crate) fn command_bytes(
    is_torque_alone: bool,
    torque_max_nm: f64,
    has_link_encoder: bool,
) -> usize {
    let torque = Aim::torque(0.0, torque_max_nm);
    let aim = if is_torque_alone {
        torque
    } else {
        Aim {
            kp_scale: 1.0,
            ..torque
        }
    };
    usize::from(frame(1, &Ask::Position(aim), has_link_encoder).size)
}

/// Bytes of the answer to [`write_query`].
pub(crate) fn answer_bytes(has_link_encoder: bool) -> usize {
    if has_link_encoder { 36 } else { 32 }
}

/// How a drive is, at its output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Answer {
    pub mode: i32,
    pub position_rev: f64,
    pub torque_nm: f64,
    /// Of the rotor, 0 to 1.
    pub rotor_encoder_rev: f64,
    /// Of the rotor.
    pub rotor_rev_s: f64,
    /// Of the joint, 0 to 1; NaN where there is none.
    pub link_encoder_rev: f64,
    pub home: i32,
    pub supply_v: f64,
    pub temperature_c: f64,
    pub fault: i32,
}

/// Positions and speeds further out than this are no drive's: turns that its own counter holds (fw/motor_position.h), and
/// above the speed at which its encoder works, 28000 turns a minute (fw/bldc_servo_control.h).
const REV_MAX: f64 = 32_768.0;
const REV_S_MAX: f64 = 467.0;

impl Answer {
    /// Who answered and what; `None` for a frame that is no answer to [`write_query`] or has something no drive says.
    pub fn of(frame: &CanFdFrame, has_link_encoder: bool) -> Option<(u8, Self)> {
        let (source, _, _) = parse_arbitration_id(frame.arbitration_id);
        let mut answer = Self {
            link_encoder_rev: f64::NAN,
            ..Self::default()
        };
        let mut seen = 0_u32;
        for subframe in parse_frame(frame.payload()) {
            let Subframe::Register {
                subframe_type: SubframeType::Response,
                register,
                value: Some(value),
                ..
            } = subframe
            else {
                continue;
            };
            let physical = |scale| f64::from(value.to_f32(scale));
            let bit = match register {
                0x000 => {
                    answer.mode = value.to_i32();
                    0
                }
                0x001 => {
                    answer.position_rev = physical(&scaling::POSITION);
                    1
                }
                0x003 => {
                    answer.torque_nm = physical(&scaling::TORQUE);
                    2
                }
                0x050 => {
                    answer.rotor_encoder_rev = physical(&scaling::POSITION);
                    3
                }
                0x051 => {
                    answer.rotor_rev_s = physical(&scaling::VELOCITY);
                    4
                }
                0x052 => {
                    answer.link_encoder_rev = physical(&scaling::POSITION);
                    5
                }
                0x00c => {
                    answer.home = value.to_i32();
                    6
                }
                0x00d => {
                    answer.supply_v = physical(&scaling::VOLTAGE);
                    7
                }
                0x00e => {
                    answer.temperature_c = physical(&scaling::TEMPERATURE);
                    8
                }
                0x00f => {
                    answer.fault = value.to_i32();
                    9
                }
                _ => continue,
            };
            seen |= 1 << bit;
        }
        let wanted = if has_link_encoder {
            0b11_1111_1111
        } else {
            0b11_1101_1111
        };
        (seen & wanted == wanted && answer.is_sound(has_link_encoder))
            .then_some((source as u8, answer))
    }

    fn is_sound(&self, has_link_encoder: bool) -> bool {
        let link_is_sound = !has_link_encoder || self.link_encoder_rev.abs() <= REV_MAX;
        (0..=15).contains(&self.mode)
            && self.position_rev.abs() <= REV_MAX
            && self.torque_nm.is_finite()
            && (0.0..=1.0).contains(&self.rotor_encoder_rev)
            && self.rotor_rev_s.abs() <= REV_S_MAX
            && link_is_sound
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn aim() -> Aim {
        Aim {
            position_rev: 0.25,
            velocity_rev_s: 0.5,
            torque_nm: 3.0,
            kp_scale: 0.5,
            kd_scale: 1.0,
            torque_max_nm: 40.0,
        }
    }

    #[test]
    fn a_torque_and_its_question_are_a_frame_of_32_bytes() {
        let torque = Ask::Position(Aim::torque(1.5, 40.0));
        assert!(frame(1, &torque, false).size <= 32);
        assert!(frame(1, &torque, true).size <= 32);
        let longest = Ask::Position(Aim {
            torque_max_nm: 1000.0,
            ..aim()
        });
        assert!(frame(1, &longest, true).size <= 48);
        assert!(command_bytes(true, 40.0, false) <= 32 && command_bytes(false, 1000.0, true) <= 48);
    }

    #[test]
    fn a_frame_goes_to_its_drive_and_asks_for_an_answer() {
        assert_eq!(frame(5, &Ask::Stop, false).arbitration_id, 0x8005);
    }

    fn answer(parts: &[(u16, f32)]) -> CanFdFrame {
        let mut frame = CanFdFrame::new();
        frame.arbitration_id = 0x0300;
        let mut data = WriteCanData::new(&mut frame);
        for (register, value) in parts {
            data.write_u8(0x2d);
            data.write_u8(*register as u8);
            data.write_f32(*value);
        }
        frame
    }

    const WHOLE: [(u16, f32); 9] = [
        (0x000, 10.0),
        (0x001, 0.25),
        (0x003, 2.0),
        (0x050, 0.5),
        (0x051, 3.0),
        (0x00c, 2.0),
        (0x00d, 24.0),
        (0x00e, 30.0),
        (0x00f, 0.0),
    ];

    #[test]
    fn an_answer_is_taken_whole_or_not_at_all() {
        let (id, read) = Answer::of(&answer(&WHOLE), false).expect("whole");
        assert_eq!(
            (id, read.mode, read.position_rev, read.home),
            (3, 10, 0.25, 2)
        );
        assert!(
            Answer::of(&answer(&WHOLE), true).is_none(),
            "the joint's encoder is missing"
        );
        for left_out in 0..WHOLE.len() {
            let mut parts = WHOLE.to_vec();
            parts.remove(left_out);
            assert!(Answer::of(&answer(&parts), false).is_none(), "{left_out}");
        }
        for (at, value) in [
            (1, f32::NAN),
            (1, 1e9),
            (2, f32::INFINITY),
            (3, 2.0),
            (4, 1e6),
            (0, 99.0),
        ] {
            let mut parts = WHOLE;
            parts[at].1 = value;
            assert!(
                Answer::of(&answer(&parts), false).is_none(),
                "{at} = {value}"
            );
        }
    }
}
