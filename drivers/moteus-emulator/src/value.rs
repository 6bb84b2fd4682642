//! Register values as they travel: four encodings, and what their numbers mean.
//!
//! Source: moteus, protocol/registers.md, "Mappings". The most negative integer stands for NaN.

/// How a register's value is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// One byte.
    Int8,
    /// Two bytes.
    Int16,
    /// Four bytes.
    Int32,
    /// IEEE 754 single precision.
    Float,
}

impl Encoding {
    /// The encoding that two bits of a subframe name.
    pub fn from_bits(bits: u8) -> Self {
        [Self::Int8, Self::Int16, Self::Int32, Self::Float][usize::from(bits & 3)]
    }

    /// Bytes of a value.
    pub fn bytes(self) -> usize {
        [1, 2, 4, 4][self as usize]
    }
}

/// A value as written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// One byte.
    Int8(i8),
    /// Two bytes.
    Int16(i16),
    /// Four bytes.
    Int32(i32),
    /// Single precision.
    Float(f32),
}

/// What one step of the integer encodings is worth: int8, int16, int32.
pub type Scale = [f64; 3];

/// Revolutions.
pub const POSITION: Scale = [0.01, 0.0001, 0.00001];
/// Revolutions a second.
pub const VELOCITY: Scale = [0.1, 0.00025, 0.00001];
/// Revolutions a second squared.
pub const ACCELERATION: Scale = [0.05, 0.001, 0.00001];
/// Nm.
pub const TORQUE: Scale = [0.5, 0.01, 0.001];
/// A share of one.
pub const SHARE: Scale = [1.0 / 127.0, 1.0 / 32_767.0, 1.0 / 2_147_483_647.0];
/// V.
pub const VOLTAGE: Scale = [0.5, 0.1, 0.001];
/// Degrees Celsius, and also A.
pub const TEMPERATURE: Scale = [1.0, 0.1, 0.001];
/// s.
pub const TIME: Scale = [0.01, 0.001, 0.000_001];
/// W.
pub const POWER: Scale = [10.0, 0.05, 0.0001];

impl Value {
    /// A physical value. What an integer cannot hold becomes its largest or smallest but one; what is not finite becomes the
    /// integer that stands for NaN.
    pub fn physical(value: f64, scale: Scale, encoding: Encoding) -> Self {
        let limited = |scale: f64, most: f64| (value / scale).clamp(-most, most);
        if encoding == Encoding::Float {
            return Self::Float(value as f32);
        }
        if !value.is_finite() {
            return match encoding {
                Encoding::Int8 => Self::Int8(i8::MIN),
                Encoding::Int16 => Self::Int16(i16::MIN),
                _ => Self::Int32(i32::MIN),
            };
        }
        match encoding {
            Encoding::Int8 => Self::Int8(limited(scale[0], f64::from(i8::MAX)) as i8),
            Encoding::Int16 => Self::Int16(limited(scale[1], f64::from(i16::MAX)) as i16),
            _ => Self::Int32(limited(scale[2], f64::from(i32::MAX)) as i32),
        }
    }

    /// A whole number; its lowest bits where the encoding is too short.
    pub fn whole(value: i32, encoding: Encoding) -> Self {
        match encoding {
            Encoding::Int8 => Self::Int8(value as i8),
            Encoding::Int16 => Self::Int16(value as i16),
            Encoding::Int32 => Self::Int32(value),
            Encoding::Float => Self::Float(value as f32),
        }
    }

    /// The physical value meant.
    pub fn to_physical(self, scale: Scale) -> f64 {
        match self {
            Self::Int8(i8::MIN) | Self::Int16(i16::MIN) | Self::Int32(i32::MIN) => f64::NAN,
            Self::Int8(raw) => f64::from(raw) * scale[0],
            Self::Int16(raw) => f64::from(raw) * scale[1],
            Self::Int32(raw) => f64::from(raw) * scale[2],
            Self::Float(value) => f64::from(value),
        }
    }

    /// The whole number meant.
    pub fn to_whole(self) -> i32 {
        match self {
            Self::Int8(raw) => i32::from(raw),
            Self::Int16(raw) => i32::from(raw),
            Self::Int32(raw) => raw,
            Self::Float(value) => value as i32,
        }
    }

    /// Reads one from the front of `bytes` and moves past it.
    pub fn take(bytes: &mut &[u8], encoding: Encoding) -> Option<Self> {
        let (head, rest) = bytes.split_at_checked(encoding.bytes())?;
        *bytes = rest;
        Some(match encoding {
            Encoding::Int8 => Self::Int8(head[0] as i8),
            Encoding::Int16 => Self::Int16(i16::from_le_bytes([head[0], head[1]])),
            Encoding::Int32 => {
                Self::Int32(i32::from_le_bytes([head[0], head[1], head[2], head[3]]))
            }
            Encoding::Float => {
                Self::Float(f32::from_le_bytes([head[0], head[1], head[2], head[3]]))
            }
        })
    }

    /// Appends it.
    pub fn put(self, out: &mut Vec<u8>) {
        match self {
            Self::Int8(raw) => out.extend_from_slice(&raw.to_le_bytes()),
            Self::Int16(raw) => out.extend_from_slice(&raw.to_le_bytes()),
            Self::Int32(raw) => out.extend_from_slice(&raw.to_le_bytes()),
            Self::Float(value) => out.extend_from_slice(&value.to_le_bytes()),
        }
    }
}

/// Reads a number of 7-bit groups, lowest first, of at most 32 bits.
pub fn take_varuint(bytes: &mut &[u8]) -> Option<u32> {
    let mut value = 0_u32;
    for shift in [0, 7, 14, 21, 28] {
        let (first, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u32::from(first & 0x7f) << shift;
        if first & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// Appends a number in 7-bit groups, lowest first.
pub fn put_varuint(mut value: u32, out: &mut Vec<u8>) {
    while value > 0x7f {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_saturate_one_short_of_what_stands_for_nan() {
        let at = |value| Value::physical(value, POSITION, Encoding::Int16);
        assert_eq!(at(0.5), Value::Int16(5000));
        assert_eq!(at(-1e9), Value::Int16(-32_767));
        assert_eq!(at(1e9), Value::Int16(32_767));
        assert_eq!(at(f64::NAN), Value::Int16(i16::MIN));
        assert!(Value::Int16(i16::MIN).to_physical(POSITION).is_nan());
        assert!(Value::Int8(-128).to_physical(SHARE).is_nan());
    }

    #[test]
    fn values_and_numbers_come_back_from_bytes() {
        let values = [
            Value::Int8(-3),
            Value::Int16(-300),
            Value::Int32(70_000),
            Value::Float(-0.25),
        ];
        for value in values {
            let (mut out, encoding) = (Vec::new(), [0, 1, 2, 3].map(Encoding::from_bits));
            value.put(&mut out);
            let encoding = encoding[values
                .iter()
                .position(|other| *other == value)
                .expect("one of them")];
            assert_eq!(Value::take(&mut &out[..], encoding), Some(value));
            assert_eq!(Value::take(&mut &out[1..], encoding), None);
        }
        for number in [0, 127, 128, 0x158, u32::MAX] {
            let mut out = Vec::new();
            put_varuint(number, &mut out);
            assert_eq!(take_varuint(&mut &out[..]), Some(number));
        }
        assert_eq!(take_varuint(&mut &[0x80; 6][..]), None);
    }
}
