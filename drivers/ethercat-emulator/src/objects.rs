//! The object dictionary of a slave: typed entries, who may write them and when, and which can be mapped into process data.
//!
//! Source: ETG.1000.6, section 5.6.7 (objects), Table 41 (abort codes).

use std::collections::BTreeMap;

/// Why a transfer is refused (ETG.1000.6, Table 41).
pub mod abort {
    #![allow(missing_docs, reason = "the names are those of the specification")]
    pub const TOGGLE: u32 = 0x0503_0000;
    pub const COMMAND: u32 = 0x0504_0001;
    pub const UNSUPPORTED_ACCESS: u32 = 0x0601_0000;
    pub const READ_ONLY: u32 = 0x0601_0002;
    pub const NO_OBJECT: u32 = 0x0602_0000;
    pub const NOT_MAPPABLE: u32 = 0x0604_0041;
    pub const MAPPING_TOO_LONG: u32 = 0x0604_0042;
    pub const TOO_LONG: u32 = 0x0607_0012;
    pub const TOO_SHORT: u32 = 0x0607_0013;
    pub const NO_SUB_INDEX: u32 = 0x0609_0011;
    pub const VALUE_RANGE: u32 = 0x0609_0030;
    pub const VALUE_TOO_HIGH: u32 = 0x0609_0031;
    pub const VALUE_TOO_LOW: u32 = 0x0609_0032;
    pub const DEVICE_STATE: u32 = 0x0800_0022;
}

/// Data types (ETG.1000.6, Table 64).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the types")]
pub enum DataType {
    I8 = 2,
    I16 = 3,
    I32 = 4,
    U8 = 5,
    U16 = 6,
    U32 = 7,
    Text = 9,
}

impl DataType {
    /// Bytes of a number.
    pub fn length(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 => 4,
            Self::Text => 0,
        }
    }

    /// Smallest and largest number.
    fn range(self) -> (i64, i64) {
        match self {
            Self::I8 => (i64::from(i8::MIN), i64::from(i8::MAX)),
            Self::I16 => (i64::from(i16::MIN), i64::from(i16::MAX)),
            Self::I32 => (i64::from(i32::MIN), i64::from(i32::MAX)),
            Self::U8 => (0, i64::from(u8::MAX)),
            Self::U16 => (0, i64::from(u16::MAX)),
            Self::U32 => (0, i64::from(u32::MAX)),
            Self::Text => (0, 0),
        }
    }
}

/// Who may write an entry, and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// The master only reads.
    ReadOnly,
    /// The master may write at any time.
    ReadWrite,
    /// The master may write before process data run.
    WritePreOp,
}

/// Which process data an entry can be part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mappable {
    /// None.
    No,
    /// Outputs.
    Rx,
    /// Inputs.
    Tx,
}

/// One entry: an object's value or a part of it.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Of the value.
    pub data_type: DataType,
    /// Who may write.
    pub access: Access,
    /// Where it can be mapped.
    pub mappable: Mappable,
    /// What it is called.
    pub name: String,
    /// The number.
    pub value: i64,
    /// The text, of a text.
    pub text: Vec<u8>,
    /// Smallest and largest number that may be written.
    pub range: (i64, i64),
}

impl Entry {
    /// A number that the master only reads.
    pub fn new(data_type: DataType, name: &str, value: i64) -> Self {
        Self {
            data_type,
            access: Access::ReadOnly,
            mappable: Mappable::No,
            name: name.to_owned(),
            value,
            text: Vec::new(),
            range: data_type.range(),
        }
    }

    /// A text that the master only reads.
    pub fn text(name: &str, text: &str) -> Self {
        Self {
            text: text.as_bytes().to_vec(),
            ..Self::new(DataType::Text, name, 0)
        }
    }

    /// One that the master may write.
    #[must_use]
    pub fn writable(mut self) -> Self {
        self.access = Access::ReadWrite;
        self
    }

    /// One that the master may write before process data run.
    #[must_use]
    pub fn pre_op(mut self) -> Self {
        self.access = Access::WritePreOp;
        self
    }

    /// One that can be mapped into outputs, and written.
    #[must_use]
    pub fn rx(mut self) -> Self {
        self.mappable = Mappable::Rx;
        self.writable()
    }

    /// One that can be mapped into inputs.
    #[must_use]
    pub fn tx(mut self) -> Self {
        self.mappable = Mappable::Tx;
        self
    }

    /// One that takes these numbers only.
    #[must_use]
    pub fn within(mut self, smallest: i64, largest: i64) -> Self {
        self.range = (smallest, largest);
        self
    }

    /// Length in bytes.
    pub fn length(&self) -> usize {
        match self.data_type {
            DataType::Text => self.text.len(),
            number => number.length(),
        }
    }

    /// Its bytes as they are sent.
    pub fn bytes(&self) -> Vec<u8> {
        match self.data_type {
            DataType::Text => self.text.clone(),
            number => self.value.to_le_bytes()[..number.length()].to_vec(),
        }
    }

    /// The number that bytes of its length stand for.
    pub fn decode(&self, bytes: &[u8]) -> i64 {
        let mut wide = [0; 8];
        wide[..bytes.len().min(8)].copy_from_slice(&bytes[..bytes.len().min(8)]);
        let raw = i64::from_le_bytes(wide);
        match self.data_type {
            DataType::I8 => i64::from(raw as i8),
            DataType::I16 => i64::from(raw as i16),
            DataType::I32 => i64::from(raw as i32),
            _ => raw,
        }
    }
}

/// All entries by index and sub-index.
#[derive(Clone, Debug, Default)]
pub struct Dictionary {
    entries: BTreeMap<(u16, u8), Entry>,
    names: BTreeMap<u16, String>,
}

impl Dictionary {
    /// Adds an object of one value.
    pub fn variable(&mut self, index: u16, entry: Entry) {
        self.names.insert(index, entry.name.clone());
        self.entries.insert((index, 0), entry);
    }

    /// Adds an object of several: sub-index 0 counts them, the others follow from 1.
    pub fn record(&mut self, index: u16, name: &str, parts: impl IntoIterator<Item = Entry>) {
        let numbered = parts
            .into_iter()
            .zip(1..)
            .map(|(part, sub_index)| (sub_index, part));
        self.sparse(index, name, numbered);
    }

    /// The same where sub-indices are left out.
    pub fn sparse(&mut self, index: u16, name: &str, parts: impl IntoIterator<Item = (u8, Entry)>) {
        self.names.insert(index, name.to_owned());
        let mut last = 0;
        for (sub_index, part) in parts {
            last = sub_index.max(last);
            self.entries.insert((index, sub_index), part);
        }
        let count = Entry::new(DataType::U8, "Number of entries", i64::from(last));
        self.entries.insert((index, 0), count);
    }

    /// An entry.
    pub fn entry(&self, index: u16, sub_index: u8) -> Option<&Entry> {
        self.entries.get(&(index, sub_index))
    }

    /// An entry to change from within.
    pub fn entry_mut(&mut self, index: u16, sub_index: u8) -> Option<&mut Entry> {
        self.entries.get_mut(&(index, sub_index))
    }

    /// A number; 0 where there is no such entry.
    pub fn number(&self, index: u16, sub_index: u8) -> i64 {
        self.entry(index, sub_index).map_or(0, |entry| entry.value)
    }

    /// Sets a number from within, wrapped as its type wraps.
    pub fn set(&mut self, index: u16, sub_index: u8, value: i64) {
        if let Some(entry) = self.entry_mut(index, sub_index) {
            entry.value = entry.decode(&value.to_le_bytes()[..entry.data_type.length()]);
        }
    }

    /// Whether there is such an object, and which sub-index is its last.
    pub fn last_sub_index(&self, index: u16) -> Option<u8> {
        let (&(_, sub_index), _) = self
            .entries
            .range((index, 0)..=(index, u8::MAX))
            .next_back()?;
        Some(sub_index)
    }

    /// An object's name.
    pub fn name(&self, index: u16) -> &str {
        self.names.get(&index).map_or("", String::as_str)
    }

    /// All objects.
    pub fn indices(&self) -> impl Iterator<Item = u16> + '_ {
        self.names.keys().copied()
    }

    /// The parts of an object from a sub-index on.
    pub fn parts(&self, index: u16, from: u8) -> impl Iterator<Item = (u8, &Entry)> {
        self.entries
            .range((index, from)..=(index, u8::MAX))
            .map(|(&(_, sub_index), entry)| (sub_index, entry))
    }

    /// Reads for the master.
    ///
    /// # Errors
    /// An abort code.
    pub fn upload(&self, index: u16, sub_index: u8) -> Result<Vec<u8>, u32> {
        let last = self.last_sub_index(index).ok_or(abort::NO_OBJECT)?;
        match self.entry(index, sub_index) {
            Some(entry) => Ok(entry.bytes()),
            // a gap in a record is there and empty
            None if sub_index < last => Err(abort::UNSUPPORTED_ACCESS),
            None => Err(abort::NO_SUB_INDEX),
        }
    }

    /// Reads a whole object for the master: sub-index 0 takes two bytes then (ETG.1000.6, 5.6.2.1).
    ///
    /// # Errors
    /// An abort code.
    pub fn upload_all(&self, index: u16, from: u8) -> Result<Vec<u8>, u32> {
        self.check_complete(index, from)?;
        let mut bytes = Vec::new();
        for (sub_index, entry) in self.parts(index, from) {
            bytes.extend(entry.bytes());
            if sub_index == 0 {
                bytes.push(0);
            }
        }
        Ok(bytes)
    }

    fn check_complete(&self, index: u16, from: u8) -> Result<(), u32> {
        let last = self.last_sub_index(index).ok_or(abort::NO_OBJECT)?;
        if from > 1 || last == 0 {
            return Err(abort::UNSUPPORTED_ACCESS);
        }
        Ok(())
    }

    /// What writing these bytes to an entry would make of it.
    ///
    /// # Errors
    /// An abort code.
    pub fn check(
        &self,
        index: u16,
        sub_index: u8,
        bytes: &[u8],
        process_data_run: bool,
    ) -> Result<i64, u32> {
        let last = self.last_sub_index(index).ok_or(abort::NO_OBJECT)?;
        let entry = self.entry(index, sub_index).ok_or(if sub_index > last {
            abort::NO_SUB_INDEX
        } else {
            abort::UNSUPPORTED_ACCESS
        })?;
        match entry.access {
            Access::ReadOnly => return Err(abort::READ_ONLY),
            Access::WritePreOp if process_data_run => return Err(abort::DEVICE_STATE),
            Access::WritePreOp | Access::ReadWrite => {}
        }
        if bytes.len() > entry.length() {
            return Err(abort::TOO_LONG);
        }
        if bytes.len() < entry.length() {
            return Err(abort::TOO_SHORT);
        }
        let value = entry.decode(bytes);
        if value > entry.range.1 {
            return Err(abort::VALUE_TOO_HIGH);
        }
        if value < entry.range.0 {
            return Err(abort::VALUE_TOO_LOW);
        }
        Ok(value)
    }

    /// Splits what a master writes to a whole object into its parts.
    ///
    /// # Errors
    /// An abort code.
    pub fn split(&self, index: u16, from: u8, bytes: &[u8]) -> Result<Vec<(u8, Vec<u8>)>, u32> {
        self.check_complete(index, from)?;
        let (mut parts, mut rest) = (Vec::new(), bytes);
        for (sub_index, entry) in self.parts(index, from) {
            if rest.is_empty() {
                break;
            }
            let length = entry.length();
            let padding = usize::from(sub_index == 0);
            if rest.len() < length {
                return Err(abort::TOO_SHORT);
            }
            parts.push((sub_index, rest[..length].to_vec()));
            rest = rest.get(length + padding..).unwrap_or(&[]);
        }
        if rest.is_empty() {
            Ok(parts)
        } else {
            Err(abort::TOO_LONG)
        }
    }
}
