//! The line protocol between a computer and an fdcanusb adapter: text lines in, CAN frames out, and back.
//!
//! ```text
//! computer → adapter   can send 8001 01000A1100 bF *5C
//! adapter → computer   OK *C4
//!                      rcv 0100 2100002F0100... *1B
//! ```
//! Source: mjbots, moteus documentation, integration/uart.md (lines, checksum) and protocol/can.md (identifiers). The
//! checksum is that of the serial port of a moteus, which speaks the same lines: allowed at first, and asked for once a line
//! has come with one. An adapter's own flags after the data are read and dropped: the bus of the emulator has no bit rates.

use arrayvec::ArrayVec;

/// Bytes in the longest CAN-FD frame.
pub const FRAME_BYTES: usize = 64;
/// Characters of the longest line that is taken: a frame of 64 bytes with a 29-bit identifier, flags and checksum has 155.
pub const LINE_BYTES: usize = 512;
/// One past the largest identifier of an extended frame.
const ID_END: u32 = 1 << 29;

/// A CAN-FD frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Arbitration identifier; see [`Frame::route`] for what moteus makes of it.
    pub id: u32,
    /// What it carries.
    pub data: ArrayVec<u8, FRAME_BYTES>,
}

/// From whom to whom a frame goes: the parts of a moteus identifier (moteus, protocol/can.md, "CAN ID").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Route {
    /// The upper 13 bits, equal on all drives of a bus.
    pub prefix: u16,
    /// Who sent it, 7 bits.
    pub source: u8,
    /// For whom it is, 7 bits; 0x7f is everybody.
    pub destination: u8,
    /// Whether an answer is wanted.
    pub reply: bool,
}

impl Frame {
    /// The parts of its identifier.
    pub fn route(&self) -> Route {
        Route {
            prefix: (self.id >> 16) as u16,
            source: (self.id >> 8) as u8 & 0x7f,
            destination: self.id as u8 & 0x7f,
            reply: self.id & 0x8000 != 0,
        }
    }
}

/// What a line asks of the adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Send this frame on the bus.
    Send(Frame),
    /// Tell how the bus is.
    Status,
}

/// Why a line is refused. The text is what follows `ERR`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// No command of the protocol.
    #[error("unknown command")]
    Command,
    /// The checksum is wrong, or missing where one is asked for. Clients look for this word.
    #[error("checksum")]
    Checksum,
    /// The identifier is no hexadecimal number of at most 29 bits.
    #[error("bad id")]
    Id,
    /// There is no data.
    #[error("insufficient options")]
    NoData,
    /// The data is no whole number of hexadecimal bytes, or more than 64.
    #[error("data invalid length")]
    DataLength,
    /// The data has something that is no hexadecimal digit.
    #[error("invalid data")]
    Data,
}

/// The state of one side of the line: whether it asks for checksums.
#[derive(Clone, Copy, Debug, Default)]
pub struct Adapter {
    checksums: bool,
}

impl Adapter {
    /// Reads a line without its end. `None` for one that asks nothing.
    ///
    /// # Errors
    /// [`LineError`]: the answer is `ERR` and its text.
    pub fn read(&mut self, line: &[u8]) -> Result<Option<Request>, LineError> {
        let line = self.verified(line)?.trim_ascii();
        if line.is_empty() {
            return Ok(None);
        }
        let mut words = line
            .split(|byte| *byte == b' ')
            .filter(|word| !word.is_empty());
        if words.next() != Some(b"can") {
            return Err(LineError::Command);
        }
        match words.next() {
            Some(b"send" | b"std" | b"ext") => {
                let id = id(words.next().ok_or(LineError::NoData)?)?;
                let data = data(words.next().ok_or(LineError::NoData)?)?;
                Ok(Some(Request::Send(Frame { id, data })))
            }
            Some(b"status") => Ok(Some(Request::Status)),
            _ => Err(LineError::Command),
        }
    }

    /// Writes a line with its end, and with a checksum if the other side uses them.
    pub fn write(&self, content: &str, out: &mut Vec<u8>) {
        let start = out.len();
        out.extend_from_slice(content.as_bytes());
        if self.checksums {
            out.push(b' ');
            let crc = crc8(&out[start..]);
            out.extend_from_slice(format!("*{crc:02X}").as_bytes());
        }
        out.extend_from_slice(b"\r\n");
    }

    /// Writes a frame that came from the bus.
    pub fn write_frame(&self, frame: &Frame, out: &mut Vec<u8>) {
        let mut line = format!("rcv {:04X} ", frame.id);
        for byte in &frame.data {
            line.push_str(&format!("{byte:02X}"));
        }
        self.write(&line, out);
    }

    /// The line without its checksum. One that is right is asked for from then on.
    fn verified<'a>(&mut self, line: &'a [u8]) -> Result<&'a [u8], LineError> {
        let claimed = match line {
            [content @ .., b'*', high, low] => byte(*high, *low).map(|crc| (content, crc)),
            _ => None,
        };
        match claimed {
            Some((content, crc)) if crc8(content) == crc => {
                self.checksums = true;
                Ok(content)
            }
            Some(_) => Err(LineError::Checksum),
            None if self.checksums => Err(LineError::Checksum),
            None => Ok(line),
        }
    }
}

/// CRC-8 with polynomial 0x97, most significant bit first, from 0 (moteus, integration/uart.md).
pub fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc: u8, _| {
            let shifted = crc << 1;
            if crc & 0x80 == 0 {
                shifted
            } else {
                shifted ^ 0x97
            }
        })
    })
}

fn id(digits: &[u8]) -> Result<u32, LineError> {
    if digits.len() > 8 {
        return Err(LineError::Id);
    }
    let value = digits.iter().try_fold(0_u32, |value, digit| {
        Some(value << 4 | u32::from(nibble(*digit)?))
    });
    value.filter(|id| *id < ID_END).ok_or(LineError::Id)
}

fn data(digits: &[u8]) -> Result<ArrayVec<u8, FRAME_BYTES>, LineError> {
    if !digits.len().is_multiple_of(2) || digits.len() > 2 * FRAME_BYTES {
        return Err(LineError::DataLength);
    }
    digits
        .chunks_exact(2)
        .map(|pair| byte(pair[0], pair[1]).ok_or(LineError::Data))
        .collect()
}

fn byte(high: u8, low: u8) -> Option<u8> {
    Some(nibble(high)? << 4 | nibble(low)?)
}

fn nibble(digit: u8) -> Option<u8> {
    (digit as char).to_digit(16).map(|value| value as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use moteus_protocol::fdcanusb as maker;

    fn send(line: &str) -> Result<Option<Request>, LineError> {
        Adapter::default().read(line.as_bytes())
    }

    #[test]
    fn a_line_of_the_makers_manual_is_read() {
        // moteus, protocol/can.md, "Example"
        let Ok(Some(Request::Send(frame))) = send("can send 8001 01000a07206000200150ff140400130d")
        else {
            panic!("no frame");
        };
        let route = Route {
            prefix: 0,
            source: 0,
            destination: 1,
            reply: true,
        };
        assert_eq!((frame.route(), frame.data.len()), (route, 16));
    }

    #[test]
    fn what_the_makers_crate_writes_is_read_and_what_is_written_it_reads() {
        let mut frame = moteus_protocol::CanFdFrame::new();
        frame.arbitration_id = 0x0012_8103;
        frame.size = 20;
        for (index, byte) in frame.data[..20].iter_mut().enumerate() {
            *byte = (index * 37) as u8;
        }
        let mut line = [0; maker::MAX_LINE_LENGTH];
        let options = maker::EncodeOptions {
            checksum: true,
            ..Default::default()
        };
        let length = maker::encode_can_send(&frame, &options, &mut line).expect("room");
        let mut adapter = Adapter::default();
        let Ok(Some(Request::Send(read))) = adapter.read(&line[..length - 1]) else {
            panic!("no frame");
        };
        assert_eq!(
            (read.id, &read.data[..]),
            (frame.arbitration_id, frame.payload())
        );

        let mut out = Vec::new();
        adapter.write_frame(&read, &mut out);
        let (content, had_checksum, valid) = maker::strip_checksum(out.trim_ascii_end());
        assert!(had_checksum && valid);
        let maker::Line::Rcv(back) = maker::parse_line(content) else {
            panic!("no frame");
        };
        assert_eq!(
            (back.arbitration_id, back.payload()),
            (read.id, &read.data[..])
        );
    }

    #[test]
    fn checksums_are_asked_for_once_one_has_come() {
        let mut adapter = Adapter::default();
        assert!(adapter.read(b"can send 8001 50 bF").is_ok());
        let crc = crc8(b"can send 8001 50 bF ");
        assert!(
            adapter
                .read(format!("can send 8001 50 bF *{crc:02X}").as_bytes())
                .is_ok()
        );
        assert_eq!(
            adapter.read(b"can send 8001 50 bF"),
            Err(LineError::Checksum)
        );
        let wrong = format!("can send 8001 50 bF *{:02X}", crc ^ 1);
        assert_eq!(adapter.read(wrong.as_bytes()), Err(LineError::Checksum));
    }

    #[test]
    fn the_checksum_is_the_makers() {
        for text in ["OK ", "", "can send 8001 50 bF ", "rcv 0100 2100 "] {
            assert_eq!(crc8(text.as_bytes()), maker::compute_crc8(text.as_bytes()));
        }
    }

    #[test]
    fn lines_that_are_none_are_told_why() {
        assert_eq!(send("  "), Ok(None));
        assert_eq!(send("can status"), Ok(Some(Request::Status)));
        assert_eq!(send("tel stop"), Err(LineError::Command));
        assert_eq!(send("can send"), Err(LineError::NoData));
        assert_eq!(send("can send 8001"), Err(LineError::NoData));
        assert_eq!(send("can send 20000000 50"), Err(LineError::Id));
        assert_eq!(send("can send 80z1 50"), Err(LineError::Id));
        assert_eq!(send("can send 8001 5"), Err(LineError::DataLength));
        assert_eq!(send("can send 8001 5g"), Err(LineError::Data));
        assert_eq!(
            send(&format!("can send 8001 {}", "50".repeat(65))),
            Err(LineError::DataLength)
        );
    }
}
