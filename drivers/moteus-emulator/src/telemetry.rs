//! Telemetry as the diagnostic stream carries it: a binary schema that tells what the binary data that follows is made of.
//!
//! Source: mjbots/mjlib, telemetry/README.md and telemetry/format.h (type numbers, field layout).

use crate::value::put_varuint;

/// A value with its type.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// True or false.
    Bool(bool),
    /// One byte.
    U8(u8),
    /// Four bytes.
    U32(u32),
    /// Eight bytes.
    U64(u64),
    /// Eight bytes with sign.
    I64(i64),
    /// Single precision.
    F32(f32),
    /// A number with names for its values.
    Enum(u32, &'static [(u32, &'static str)]),
    /// So many of one kind; at least one.
    Array(Vec<Node>),
    /// Fields by name.
    Object(Vec<(&'static str, Node)>),
}

impl Node {
    /// A physical value.
    pub fn number(value: f64) -> Self {
        Self::F32(value as f32)
    }

    /// The type, as `tel schema` gives it.
    pub fn schema(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.write_schema(&mut out);
        out
    }

    /// The value, as binary `tel get` gives it.
    pub fn data(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.write_data(&mut out);
        out
    }

    /// The value as text: a line a field, as `tel get` gives it after `tel fmt NAME 1`.
    pub fn text(&self, name: &str) -> String {
        match self {
            Self::Object(fields) => fields
                .iter()
                .map(|(field, node)| node.text(&format!("{name}.{field}")))
                .collect(),
            Self::Array(items) => items
                .iter()
                .enumerate()
                .map(|(index, node)| node.text(&format!("{name}.{index}")))
                .collect(),
            _ => format!("{name} {}\r\n", self.printed()),
        }
    }

    fn printed(&self) -> String {
        match self {
            Self::Bool(value) => u8::from(*value).to_string(),
            Self::U8(value) => value.to_string(),
            Self::U32(value) | Self::Enum(value, _) => value.to_string(),
            Self::U64(value) => value.to_string(),
            Self::I64(value) => value.to_string(),
            Self::F32(value) if value.is_nan() => "nan".to_owned(),
            Self::F32(value) => format!("{value:.6}"),
            Self::Array(_) | Self::Object(_) => String::new(),
        }
    }

    fn write_schema(&self, out: &mut Vec<u8>) {
        match self {
            Self::Bool(_) => out.push(2),
            Self::I64(_) => out.extend([3, 8]),
            Self::U8(_) => out.extend([4, 1]),
            Self::U32(_) => out.extend([4, 4]),
            Self::U64(_) => out.extend([4, 8]),
            Self::F32(_) => out.push(7),
            Self::Enum(_, names) => {
                // its number is a varuint
                out.extend([17, 6]);
                put_varuint(names.len() as u32, out);
                for (value, name) in *names {
                    put_varuint(*value, out);
                    put_string(name, out);
                }
            }
            Self::Array(items) => {
                out.push(19);
                put_varuint(items.len() as u32, out);
                if let Some(first) = items.first() {
                    first.write_schema(out);
                }
            }
            Self::Object(fields) => {
                out.extend([16, 0]);
                for (name, node) in fields {
                    // no flags, its name, no other names, its type, no default
                    out.push(0);
                    put_string(name, out);
                    out.push(0);
                    node.write_schema(out);
                    out.push(0);
                }
                // a field of the final type ends it
                out.extend([0; 5]);
            }
        }
    }

    fn write_data(&self, out: &mut Vec<u8>) {
        match self {
            Self::Bool(value) => out.push(u8::from(*value)),
            Self::U8(value) => out.push(*value),
            Self::U32(value) => out.extend(value.to_le_bytes()),
            Self::U64(value) => out.extend(value.to_le_bytes()),
            Self::I64(value) => out.extend(value.to_le_bytes()),
            Self::F32(value) => out.extend(value.to_le_bytes()),
            Self::Enum(value, _) => put_varuint(*value, out),
            Self::Array(items) => items.iter().for_each(|node| node.write_data(out)),
            Self::Object(fields) => fields.iter().for_each(|(_, node)| node.write_data(out)),
        }
    }
}

fn put_string(text: &str, out: &mut Vec<u8>) {
    put_varuint(text.len() as u32, out);
    out.extend_from_slice(text.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_is_its_fields_then_the_final_one() {
        let node = Node::Object(vec![
            ("a", Node::U8(5)),
            ("b", Node::Array(vec![Node::Bool(true); 2])),
        ]);
        let schema = [
            16, 0, // an object without flags
            0, 1, b'a', 0, 4, 1, 0, // a: one byte without sign
            0, 1, b'b', 0, 19, 2, 2, 0, // b: two flags
            0, 0, 0, 0, 0,
        ];
        assert_eq!(node.schema(), schema);
        assert_eq!(node.data(), [5, 1, 1]);
        assert_eq!(node.text("x"), "x.a 5\r\nx.b.0 1\r\nx.b.1 1\r\n");
    }
}
