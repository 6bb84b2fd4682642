//! Where the objects of an axis lie in a slave's process data, and how they are read and written.

use ethercat_wire::frame::{u16_at, u32_at};

/// Objects of the next axis of a slave begin this much later (ETG.6010).
pub const AXIS_OFFSET: u16 = 0x800;

/// One mapped entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mapped {
    /// Object.
    pub index: u16,
    /// Part of it.
    pub sub_index: u8,
    /// Bits.
    pub bits: u8,
    /// First bit in the process data.
    pub at_bit: usize,
}

/// Outputs that a joint needs: first byte of each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the objects")]
pub struct OutputFields {
    pub controlword: usize,
    pub mode: usize,
    pub position: Option<usize>,
    pub velocity: Option<usize>,
    pub torque: Option<usize>,
    pub torque_offset: Option<usize>,
}

/// Inputs that a joint needs: first byte of each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the objects")]
pub struct InputFields {
    pub statusword: usize,
    pub mode: Option<usize>,
    pub position: usize,
    pub velocity: Option<usize>,
    pub torque: Option<usize>,
    pub error_code: Option<usize>,
    pub link_position: Option<usize>,
}

fn find(mapping: &[Mapped], axis: u8, index: u16, sub_index: u8, bits: u8) -> Option<usize> {
    let index = index + AXIS_OFFSET * u16::from(axis);
    let wanted = |entry: &&Mapped| {
        (entry.index, entry.sub_index, entry.bits) == (index, sub_index, bits)
            && entry.at_bit.is_multiple_of(8)
    };
    mapping.iter().find(wanted).map(|entry| entry.at_bit / 8)
}

impl OutputFields {
    /// Finds them.
    ///
    /// # Errors
    /// The object without which nothing goes.
    pub fn of(mapping: &[Mapped], axis: u8) -> Result<Self, u16> {
        let find = |index: u16, bits: u8| find(mapping, axis, index, 0, bits);
        Ok(Self {
            controlword: find(0x6040, 16).ok_or(0x6040_u16)?,
            mode: find(0x6060, 8).ok_or(0x6060_u16)?,
            position: find(0x607a, 32),
            velocity: find(0x60ff, 32),
            torque: find(0x6071, 16),
            torque_offset: find(0x60b2, 16),
        })
    }
}

impl InputFields {
    /// Finds them.
    ///
    /// # Errors
    /// The object without which nothing goes.
    pub fn of(mapping: &[Mapped], axis: u8) -> Result<Self, u16> {
        let find =
            |index: u16, sub_index: u8, bits: u8| find(mapping, axis, index, sub_index, bits);
        Ok(Self {
            statusword: find(0x6041, 0, 16).ok_or(0x6041_u16)?,
            mode: find(0x6061, 0, 8),
            position: find(0x6064, 0, 32).ok_or(0x6064_u16)?,
            velocity: find(0x606c, 0, 32),
            torque: find(0x6077, 0, 16),
            error_code: find(0x603f, 0, 16),
            link_position: find(0x60e4, 1, 32),
        })
    }
}

/// What an axis says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the objects")]
pub struct Inputs {
    pub statusword: u16,
    pub mode: Option<i8>,
    pub position: i32,
    pub velocity: Option<i32>,
    pub torque: Option<i16>,
    pub error_code: u16,
    pub link_position: Option<i32>,
}

impl Inputs {
    /// Reads them; what lies beyond the end is zero.
    pub fn read(fields: &InputFields, bytes: &[u8]) -> Self {
        let long = |at: usize| u32_at(bytes, at) as i32;
        Self {
            statusword: u16_at(bytes, fields.statusword),
            mode: fields
                .mode
                .and_then(|at| bytes.get(at))
                .map(|byte| *byte as i8),
            position: long(fields.position),
            velocity: fields.velocity.map(long),
            torque: fields.torque.map(|at| u16_at(bytes, at) as i16),
            error_code: fields.error_code.map_or(0, |at| u16_at(bytes, at)),
            link_position: fields.link_position.map(long),
        }
    }
}

/// What an axis is told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the objects")]
pub struct Outputs {
    pub controlword: u16,
    pub mode: i8,
    pub position: i32,
    pub velocity: i32,
    pub torque: i16,
    pub torque_offset: i16,
}

impl Outputs {
    /// Writes them; what has no place is left out.
    pub fn write(&self, fields: &OutputFields, bytes: &mut [u8]) {
        let mut put = |at: Option<usize>, value: &[u8]| {
            if let Some(target) = at.and_then(|at| bytes.get_mut(at..at + value.len())) {
                target.copy_from_slice(value);
            }
        };
        put(Some(fields.controlword), &self.controlword.to_le_bytes());
        put(Some(fields.mode), &self.mode.to_le_bytes());
        put(fields.position, &self.position.to_le_bytes());
        put(fields.velocity, &self.velocity.to_le_bytes());
        put(fields.torque, &self.torque.to_le_bytes());
        put(fields.torque_offset, &self.torque_offset.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(index: u16, bits: u8, at_bit: usize) -> Mapped {
        Mapped {
            index,
            sub_index: 0,
            bits,
            at_bit,
        }
    }

    #[test]
    fn objects_are_found_by_axis_and_length() {
        let mapping = [
            entry(0x6040, 16, 0),
            entry(0x6060, 8, 16),
            entry(0x6840, 16, 24),
            entry(0x6860, 8, 40),
            entry(0x6871, 16, 48),
        ];
        let first = OutputFields::of(&mapping, 0).expect("both are there");
        assert_eq!((first.controlword, first.mode, first.torque), (0, 2, None));
        let second = OutputFields::of(&mapping, 1).expect("both are there");
        assert_eq!(
            (second.controlword, second.mode, second.torque),
            (3, 5, Some(6))
        );
        assert_eq!(OutputFields::of(&mapping, 2), Err(0x6040));
        assert_eq!(OutputFields::of(&[entry(0x6040, 32, 0)], 0), Err(0x6040));
    }

    #[test]
    fn what_is_written_lies_where_it_belongs_and_nothing_beyond_the_end() {
        let fields = OutputFields {
            controlword: 0,
            mode: 2,
            torque: Some(3),
            position: Some(90),
            ..OutputFields::default()
        };
        let mut bytes = [0xee; 6];
        let outputs = Outputs {
            controlword: 0x0f,
            mode: 10,
            torque: -2,
            position: 7,
            ..Outputs::default()
        };
        outputs.write(&fields, &mut bytes);
        assert_eq!(bytes, [0x0f, 0, 10, 0xfe, 0xff, 0xee]);
    }

    #[test]
    fn inputs_beyond_the_end_are_zero() {
        let fields = InputFields {
            statusword: 1,
            position: 400,
            torque: Some(2),
            ..InputFields::default()
        };
        let inputs = Inputs::read(&fields, &[0, 0x37, 0x12]);
        assert_eq!(
            (inputs.statusword, inputs.position, inputs.torque),
            (0x1237, 0, Some(0))
        );
    }
}
