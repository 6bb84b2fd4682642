//! The mailbox's only protocol, CoE: SDO transfers and SDO information. Messages in, messages out.
//!
//! Source: ETG.1000.6, sections 5.6.2 (SDO) and 5.6.3 (SDO information); ETG.1000.4, section 5.6 (mailbox header).

use std::collections::VecDeque;

use crate::objects::{Access, Dictionary, Entry, Mappable, abort};
use crate::wire::{u16_at, u32_at};

/// Mailbox header.
const MAILBOX_HEADER: usize = 6;
/// CoE header.
const COE_HEADER: usize = 2;
/// Header of an SDO message.
const SDO_HEADER: usize = 8;
/// Mailbox type of an error, and of CoE.
const TYPE_ERROR: u8 = 0;
const TYPE_COE: u8 = 3;
/// Mailbox error codes (ETG.1000.4, Table 30).
const ERROR_SYNTAX: u16 = 1;
const ERROR_PROTOCOL: u16 = 2;
/// CoE services (ETG.1000.6, Table 28).
const EMERGENCY: u16 = 1;
const SDO_REQUEST: u16 = 2;
const SDO_RESPONSE: u16 = 3;
const SDO_INFORMATION: u16 = 8;
/// The object dictionary does not hold more than this; what a master announces beyond it is refused.
const TRANSFER_MAX: usize = 4096;

/// A master that does not fetch is not answered more than this.
const UNFETCHED_MAX: usize = 8;

/// What the protocol works on: the slave behind the mailbox.
pub trait Objects {
    /// The dictionary, up to date.
    fn dictionary(&mut self) -> &Dictionary;
    /// Writes bytes to an entry.
    ///
    /// # Errors
    /// An abort code.
    fn write(&mut self, index: u16, sub_index: u8, bytes: &[u8]) -> Result<(), u32>;
}

/// A transfer that takes several messages.
#[derive(Clone, Debug)]
enum Transfer {
    Upload {
        rest: VecDeque<u8>,
        toggle: u8,
        target: (u16, u8),
    },
    Download {
        bytes: Vec<u8>,
        length: usize,
        toggle: u8,
        target: (u16, u8),
        complete: bool,
    },
}

/// The protocol's server in a slave.
#[derive(Clone, Debug, Default)]
pub struct Server {
    transfer: Option<Transfer>,
    counter: u8,
    answers: VecDeque<Vec<u8>>,
}

impl Server {
    /// Nothing is under way any more.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// The next message to the master.
    pub fn answer(&self) -> Option<&[u8]> {
        self.answers.front().map(Vec::as_slice)
    }

    /// It lies where the master fetches it.
    pub fn handed_out(&mut self) {
        self.answers.pop_front();
    }

    /// Whether so much waits to be fetched that no further request is looked at.
    pub fn is_busy(&self) -> bool {
        self.answers.len() >= UNFETCHED_MAX
    }

    /// Tells the master of an error (ETG.1000.6, section 5.6.4).
    pub fn emergency(&mut self, error_code: u16, error_register: u8) {
        if self.is_busy() {
            return;
        }
        let mut body = vec![0; 8];
        body[..2].copy_from_slice(&error_code.to_le_bytes());
        body[2] = error_register;
        self.answer_coe(EMERGENCY, &body);
    }

    fn queue(&mut self, kind: u8, body: &[u8]) {
        self.counter = self.counter % 7 + 1;
        let mut message = Vec::with_capacity(MAILBOX_HEADER + body.len());
        message.extend((body.len() as u16).to_le_bytes());
        message.extend([0, 0, 0, kind | self.counter << 4]);
        message.extend(body);
        self.answers.push_back(message);
    }

    fn answer_coe(&mut self, service: u16, body: &[u8]) {
        let mut message = (service << 12).to_le_bytes().to_vec();
        message.extend(body);
        self.queue(TYPE_COE, &message);
    }

    fn answer_sdo(&mut self, command: u8, target: (u16, u8), data: [u8; 4], more: &[u8]) {
        self.answer_coe(SDO_RESPONSE, &sdo(command, target, data, more));
    }

    fn abort(&mut self, target: (u16, u8), code: u32) {
        self.transfer = None;
        // A service of its own, which either side may request (ETG.1000.6, 5.6.2.7): SOEM takes a response for success.
        self.answer_coe(SDO_REQUEST, &sdo(0x80, target, code.to_le_bytes(), &[]));
    }

    fn mailbox_error(&mut self, code: u16) {
        let mut body = 1_u16.to_le_bytes().to_vec();
        body.extend(code.to_le_bytes());
        self.queue(TYPE_ERROR, &body);
    }

    /// Takes a message of the master. `capacity` is the length of the mailbox that answers go into.
    pub fn request(&mut self, message: &[u8], capacity: usize, objects: &mut impl Objects) {
        let length = usize::from(u16_at(message, 0));
        let kind = message.get(5).copied().unwrap_or(0) & 0x0f;
        let Some(body) = message.get(MAILBOX_HEADER..MAILBOX_HEADER + length) else {
            self.mailbox_error(ERROR_SYNTAX);
            return;
        };
        if kind != TYPE_COE {
            self.mailbox_error(ERROR_PROTOCOL);
            return;
        }
        if body.len() < COE_HEADER + 4 {
            self.mailbox_error(ERROR_SYNTAX);
            return;
        }
        let room = capacity.saturating_sub(MAILBOX_HEADER + COE_HEADER);
        match u16_at(body, 0) >> 12 {
            SDO_REQUEST => self.sdo(&body[COE_HEADER..], room, objects),
            SDO_INFORMATION => self.information(&body[COE_HEADER..], room, objects),
            _ => self.mailbox_error(ERROR_PROTOCOL),
        }
    }

    fn sdo(&mut self, body: &[u8], room: usize, objects: &mut impl Objects) {
        let command = body[0];
        let target = (u16_at(body, 1), body[3]);
        match command >> 5 {
            0 => self.download_segment(body, objects),
            1 if body.len() >= SDO_HEADER => self.download(body, target, objects),
            2 => self.upload(command, target, room, objects),
            3 => self.upload_segment(command, room),
            4 => self.transfer = None,
            _ => self.abort(target, abort::COMMAND),
        }
    }

    fn download(&mut self, body: &[u8], target: (u16, u8), objects: &mut impl Objects) {
        let command = body[0];
        let complete = command & 0x10 != 0;
        self.transfer = None;
        if command & 0x02 != 0 {
            let length = if command & 0x01 != 0 {
                4 - usize::from(command >> 2 & 3)
            } else {
                let entry = objects.dictionary().entry(target.0, target.1);
                entry.map_or(4, Entry::length).min(4)
            };
            self.store(target, complete, &body[4..4 + length], objects);
            return;
        }
        let length = u32_at(body, 4) as usize;
        if length > TRANSFER_MAX {
            self.abort(target, abort::TOO_LONG);
            return;
        }
        let bytes = &body[SDO_HEADER..body.len().min(SDO_HEADER + length)];
        if bytes.len() == length {
            self.store(target, complete, bytes, objects);
        } else {
            self.transfer = Some(Transfer::Download {
                bytes: bytes.to_vec(),
                length,
                toggle: 0,
                target,
                complete,
            });
            self.answer_sdo(0x60, target, [0; 4], &[]);
        }
    }

    fn download_segment(&mut self, body: &[u8], objects: &mut impl Objects) {
        let command = body[0];
        let Some(Transfer::Download {
            mut bytes,
            length,
            toggle,
            target,
            complete,
        }) = self.transfer.take()
        else {
            self.abort((0, 0), abort::COMMAND);
            return;
        };
        if command & 0x10 != toggle {
            self.abort(target, abort::TOGGLE);
            return;
        }
        let data = &body[1..];
        // Seven bytes at least; of fewer, the command says how many are padding.
        let unused = if data.len() <= 7 {
            usize::from(command >> 1 & 7)
        } else {
            0
        };
        bytes.extend(&data[..data.len().saturating_sub(unused)]);
        if bytes.len() > length {
            self.abort(target, abort::TOO_LONG);
            return;
        }
        if command & 0x01 != 0 {
            if bytes.len() < length {
                self.abort(target, abort::TOO_SHORT);
                return;
            }
            let written = write(target, complete, &bytes, objects);
            match written {
                Ok(()) => self.answer_coe(SDO_RESPONSE, &segment_answer(0x20 | toggle)),
                Err(code) => self.abort(target, code),
            }
            return;
        }
        self.transfer = Some(Transfer::Download {
            bytes,
            length,
            toggle: toggle ^ 0x10,
            target,
            complete,
        });
        self.answer_coe(SDO_RESPONSE, &segment_answer(0x20 | toggle));
    }

    fn store(
        &mut self,
        target: (u16, u8),
        complete: bool,
        bytes: &[u8],
        objects: &mut impl Objects,
    ) {
        match write(target, complete, bytes, objects) {
            Ok(()) => self.answer_sdo(0x60, target, [0; 4], &[]),
            Err(code) => self.abort(target, code),
        }
    }

    fn upload(&mut self, command: u8, target: (u16, u8), room: usize, objects: &mut impl Objects) {
        self.transfer = None;
        let complete = command & 0x10 != 0;
        let dictionary = objects.dictionary();
        let found = if complete {
            dictionary.upload_all(target.0, target.1)
        } else {
            dictionary.upload(target.0, target.1)
        };
        let bytes = match found {
            Ok(bytes) => bytes,
            Err(code) => return self.abort(target, code),
        };
        let flag = command & 0x10;
        if (1..=4).contains(&bytes.len()) {
            let mut data = [0; 4];
            data[..bytes.len()].copy_from_slice(&bytes);
            let unused = (4 - bytes.len() as u8) << 2;
            self.answer_sdo(0x43 | flag | unused, target, data, &[]);
            return;
        }
        let length = (bytes.len() as u32).to_le_bytes();
        let fits = bytes.len().min(room.saturating_sub(SDO_HEADER));
        self.answer_sdo(0x41 | flag, target, length, &bytes[..fits]);
        if fits < bytes.len() {
            self.transfer = Some(Transfer::Upload {
                rest: bytes[fits..].iter().copied().collect(),
                toggle: 0,
                target,
            });
        }
    }

    fn upload_segment(&mut self, command: u8, room: usize) {
        let Some(Transfer::Upload {
            mut rest,
            toggle,
            target,
        }) = self.transfer.take()
        else {
            self.abort((0, 0), abort::COMMAND);
            return;
        };
        if command & 0x10 != toggle {
            self.abort(target, abort::TOGGLE);
            return;
        }
        let fits = rest.len().min(room.saturating_sub(1).max(7));
        let mut data: Vec<u8> = rest.drain(..fits).collect();
        let unused = 7_usize.saturating_sub(data.len());
        data.resize(data.len() + unused, 0);
        let last = u8::from(rest.is_empty());
        let mut body = vec![toggle | (unused as u8) << 1 | last];
        body.extend(data);
        self.answer_coe(SDO_RESPONSE, &body);
        if last == 0 {
            self.transfer = Some(Transfer::Upload {
                rest,
                toggle: toggle ^ 0x10,
                target,
            });
        }
    }

    fn information(&mut self, body: &[u8], room: usize, objects: &mut impl Objects) {
        const LIST: u8 = 1;
        const OBJECT: u8 = 3;
        const ENTRY: u8 = 5;
        let dictionary = objects.dictionary();
        let data = &body[4..];
        let answer = match body[0] & 0x7f {
            LIST => object_list(dictionary, u16_at(data, 0)),
            OBJECT => object_description(dictionary, u16_at(data, 0)),
            ENTRY if data.len() >= 4 => {
                entry_description(dictionary, u16_at(data, 0), data[2], data[3])
            }
            _ => Err(abort::COMMAND),
        };
        match answer {
            Ok(answer) => self.fragments(body[0] & 0x7f, &answer, room),
            Err(code) => {
                let mut message = vec![7, 0, 0, 0];
                message.extend(code.to_le_bytes());
                self.answer_coe(SDO_INFORMATION, &message);
            }
        }
    }

    fn fragments(&mut self, request: u8, answer: &[u8], room: usize) {
        const INCOMPLETE: u8 = 0x80;
        let size = room.saturating_sub(4).max(2) & !1;
        let count = answer.len().div_ceil(size).max(1);
        for (position, part) in answer.chunks(size).enumerate() {
            let left = (count - 1 - position) as u16;
            let flag = if left > 0 { INCOMPLETE } else { 0 };
            let mut message = vec![(request + 1) | flag, 0];
            message.extend(left.to_le_bytes());
            message.extend(part);
            self.answer_coe(SDO_INFORMATION, &message);
        }
    }
}

fn sdo(command: u8, target: (u16, u8), data: [u8; 4], more: &[u8]) -> Vec<u8> {
    let [low, high] = target.0.to_le_bytes();
    let mut body = vec![command, low, high, target.1];
    body.extend(data);
    body.extend(more);
    body
}

fn segment_answer(command: u8) -> [u8; 8] {
    [command, 0, 0, 0, 0, 0, 0, 0]
}

fn write(
    target: (u16, u8),
    complete: bool,
    bytes: &[u8],
    objects: &mut impl Objects,
) -> Result<(), u32> {
    if !complete {
        return objects.write(target.0, target.1, bytes);
    }
    let mut parts = objects.dictionary().split(target.0, target.1, bytes)?;
    // A list is written with its length at 0, which is set last.
    if let Some(position) = parts.iter().position(|(sub_index, _)| *sub_index == 0)
        && objects
            .dictionary()
            .entry(target.0, 0)
            .is_some_and(|count| count.access != Access::ReadOnly)
    {
        let count = parts.remove(position);
        objects.write(target.0, 0, &[0])?;
        parts.retain(|(sub_index, _)| *sub_index <= count.1[0]);
        parts.push(count);
    } else {
        parts.retain(|(sub_index, _)| *sub_index != 0);
    }
    for (sub_index, bytes) in parts {
        objects.write(target.0, sub_index, &bytes)?;
    }
    Ok(())
}

/// ETG.1000.6, Table 44: how many there are of each list, or one of the lists.
fn object_list(dictionary: &Dictionary, list: u16) -> Result<Vec<u8>, u32> {
    let of_kind = |kind: u16| {
        let wanted = move |index: &u16| {
            let mappable = |to: Mappable| {
                dictionary
                    .parts(*index, 0)
                    .any(|(_, part)| part.mappable == to)
            };
            match kind {
                1 => true,
                2 => mappable(Mappable::Rx),
                3 => mappable(Mappable::Tx),
                // to be stored for replacement, and to be loaded at start-up: none
                _ => false,
            }
        };
        dictionary.indices().filter(wanted).collect::<Vec<u16>>()
    };
    let mut answer = list.to_le_bytes().to_vec();
    match list {
        0 => {
            for kind in 1..=5 {
                answer.extend((of_kind(kind).len() as u16).to_le_bytes());
            }
        }
        1..=5 => {
            for index in of_kind(list) {
                answer.extend(index.to_le_bytes());
            }
        }
        _ => return Err(abort::VALUE_RANGE),
    }
    Ok(answer)
}

fn object_description(dictionary: &Dictionary, index: u16) -> Result<Vec<u8>, u32> {
    const VARIABLE: u8 = 7;
    const RECORD: u8 = 9;
    let last = dictionary.last_sub_index(index).ok_or(abort::NO_OBJECT)?;
    let data_type = dictionary
        .entry(index, last.min(1))
        .map_or(0, |entry| entry.data_type as u16);
    let mut answer = index.to_le_bytes().to_vec();
    answer.extend(data_type.to_le_bytes());
    answer.extend([last, if last == 0 { VARIABLE } else { RECORD }]);
    answer.extend(dictionary.name(index).as_bytes());
    Ok(answer)
}

fn entry_description(
    dictionary: &Dictionary,
    index: u16,
    sub_index: u8,
    value_information: u8,
) -> Result<Vec<u8>, u32> {
    let last = dictionary.last_sub_index(index).ok_or(abort::NO_OBJECT)?;
    let entry = dictionary.entry(index, sub_index);
    if entry.is_none() && sub_index > last {
        return Err(abort::NO_SUB_INDEX);
    }
    let (data_type, bits, access, name) = entry.map_or((0, 0, 0, ""), |entry| {
        let bits = 8 * entry.length() as u16;
        (
            entry.data_type as u16,
            bits,
            access_bits(entry),
            entry.name.as_str(),
        )
    });
    let mut answer = index.to_le_bytes().to_vec();
    // no unit, default or limits follow, whatever was asked
    answer.extend([sub_index, value_information & 0x07]);
    for number in [data_type, bits, access] {
        answer.extend(number.to_le_bytes());
    }
    answer.extend(name.as_bytes());
    Ok(answer)
}

/// ETG.1000.6, Table 49: read in the three states, write in them, mappable.
fn access_bits(entry: &Entry) -> u16 {
    let written = match entry.access {
        Access::ReadOnly => 0,
        Access::WritePreOp => 0x08,
        Access::ReadWrite => 0x38,
    };
    let mapped = match entry.mappable {
        Mappable::No => 0,
        Mappable::Rx => 0x40,
        Mappable::Tx => 0x80,
    };
    0x07 | written | mapped
}
