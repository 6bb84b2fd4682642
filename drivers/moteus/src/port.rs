//! The serial port of an fdcanusb adapter: frames out and in, without waiting and without the heap.

use moteus_protocol::CanFdFrame;
use moteus_protocol::fdcanusb::{
    EncodeOptions, Line, MAX_LINE_LENGTH, compute_crc8, encode_can_send, is_checksum_error,
    parse_line, strip_checksum,
};
use rt_loop::driver::OpenError;
use rustix::io::Errno;

use crate::host::{Host, Serial};

/// Lines that are sent at once: a joint each, and one to spare.
const OUT_BYTES: usize = MAX_LINE_LENGTH * (shm_types::JOINTS_MAX + 1);
/// More than an adapter holds (fdcanusb, fw/can_manager.cc, `kBufferSize`).
const IN_BYTES: usize = 4096;

/// Why nothing goes through a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PortError {
    /// It took less than was to be sent.
    Full,
    /// It is gone.
    Gone,
}

/// A port, open as long as it is there.
pub(crate) struct Port {
    path: String,
    serial: Option<Box<dyn Serial>>,
    /// Whether lines are sent with a checksum: until an adapter says that it does not know them.
    checksums: bool,
    /// Whether a line has come with a right one: then all must.
    has_checksums: bool,
    /// Whether a frame has come: then the adapter has understood.
    is_understood: bool,
    out: [u8; OUT_BYTES],
    out_filled: usize,
    input: [u8; IN_BYTES],
    input_filled: usize,
    /// Whether the adapter said last that the bus is off.
    is_bus_off: bool,
    /// Frames and lines that were refused or could not be read.
    refused: u64,
}

impl Port {
    /// Opens a port for this program alone.
    ///
    /// # Errors
    /// [`OpenError::Hardware`]: why not, and what to do.
    pub fn open(host: &dyn Host, path: &str) -> Result<Self, OpenError> {
        let told = |reason: &str| OpenError::Hardware(format!("{path}: {reason}"));
        let serial = host.open(path).map_err(|error| match error {
            Errno::NOENT | Errno::NXIO | Errno::NODEV => {
                told("no such port; plug the adapter in, and see ls /dev/serial/by-id")
            }
            Errno::ACCESS | Errno::PERM => {
                told("no permission; add the user to the group that owns it, often dialout")
            }
            Errno::WOULDBLOCK | Errno::BUSY => told("in use by another program; end that"),
            Errno::NOTTY => told("is no serial port; name the adapter's"),
            other => told(&format!("{other}; check the adapter")),
        })?;
        Ok(Self {
            path: path.to_owned(),
            serial: Some(serial),
            checksums: true,
            has_checksums: false,
            is_understood: false,
            out: [0; OUT_BYTES],
            out_filled: 0,
            input: [0; IN_BYTES],
            input_filled: 0,
            is_bus_off: false,
            refused: 0,
        })
    }

    /// As named in the robot file.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Whether it is there.
    pub fn is_open(&self) -> bool {
        self.serial.is_some()
    }

    /// Whether its bus has switched itself off, as the adapter told when it was last asked.
    pub fn is_bus_off(&self) -> bool {
        self.is_bus_off
    }

    /// Asks the adapter how its bus is (mjbots fdcanusb, README, "can status"). Its answer comes with the frames.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn ask_status(&mut self) -> Result<(), PortError> {
        const QUESTION: &[u8] = b"can status";
        let room = &mut self.out[self.out_filled..];
        // a checksum is a blank, `*`, two digits; the line's end comes last
        if room.len() < QUESTION.len() + 5 {
            return Err(PortError::Full);
        }
        room[..QUESTION.len()].copy_from_slice(QUESTION);
        let mut length = QUESTION.len();
        if self.checksums {
            room[length] = b' ';
            let digits = compute_crc8(&room[..=length]);
            let digit = |value: u8| b"0123456789ABCDEF"[usize::from(value & 0x0f)];
            room[length + 1..length + 4].copy_from_slice(&[
                b'*',
                digit(digits >> 4),
                digit(digits),
            ]);
            length += 4;
        }
        room[length] = b'\n';
        self.out_filled += length + 1;
        self.send()
    }

    /// Tries to open it again; not for the urgent part of a cycle.
    pub fn reopen(&mut self, host: &dyn Host) {
        if self.serial.is_none() {
            self.serial = host.open(&self.path).ok();
            self.out_filled = 0;
            self.input_filled = 0;
            self.is_bus_off = false;
            self.has_checksums = false;
        }
    }

    /// Puts a frame behind those that are to be sent.
    ///
    /// # Errors
    /// [`PortError::Full`] while what was sent before has not gone out.
    pub fn queue(&mut self, frame: &CanFdFrame) -> Result<(), PortError> {
        let options = EncodeOptions {
            checksum: self.checksums,
            ..EncodeOptions::default()
        };
        let room = &mut self.out[self.out_filled..];
        let written = encode_can_send(frame, &options, room).map_err(|_| PortError::Full)?;
        self.out_filled += written;
        Ok(())
    }

    /// Sends what is queued, as far as the port takes it now; the rest goes first the next time.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn send(&mut self) -> Result<(), PortError> {
        let Some(serial) = &mut self.serial else {
            return Err(PortError::Gone);
        };
        if self.out_filled == 0 {
            return Ok(());
        }
        match serial.write(&self.out[..self.out_filled]) {
            Ok(sent) => {
                self.out.copy_within(sent..self.out_filled, 0);
                self.out_filled -= sent;
                if self.out_filled == 0 {
                    Ok(())
                } else {
                    Err(PortError::Full)
                }
            }
            Err(Errno::AGAIN | Errno::INTR) => Err(PortError::Full),
            Err(_) => {
                self.serial = None;
                Err(PortError::Gone)
            }
        }
    }

    /// Whether what was sent before is still waiting.
    pub fn is_behind(&self) -> bool {
        self.out_filled > 0
    }

    /// Reads what is there and hands over the frames in it. One call of `read` a call: it never reads for longer than an
    /// adapter can fill.
    ///
    /// # Errors
    /// [`PortError::Gone`].
    pub fn receive(&mut self, mut take: impl FnMut(&CanFdFrame)) -> Result<(), PortError> {
        let Some(serial) = &mut self.serial else {
            return Err(PortError::Gone);
        };
        if self.input_filled == IN_BYTES {
            // no line is so long
            self.input_filled = 0;
        }
        match serial.read(&mut self.input[self.input_filled..]) {
            Ok(0) | Err(Errno::AGAIN | Errno::INTR) => return Ok(()),
            Ok(read) => self.input_filled += read,
            Err(_) => {
                self.serial = None;
                return Err(PortError::Gone);
            }
        }
        let mut start = 0;
        let is_end = |byte: &u8| matches!(byte, b'\r' | b'\n');
        while let Some(length) = self.input[start..self.input_filled].iter().position(is_end) {
            let (content, had_checksum, is_right) =
                strip_checksum(&self.input[start..start + length]);
            start += length + 1;
            // the end of a line may be two characters
            if content.is_empty() {
                continue;
            }
            self.has_checksums |= had_checksum && is_right;
            // a device that sends checksums sends them with every line
            let is_refused = if had_checksum {
                !is_right
            } else {
                self.has_checksums
            };
            if is_refused {
                self.refused += 1;
                continue;
            }
            match parse_line(content) {
                Line::Rcv(frame) => {
                    self.is_bus_off = false;
                    self.is_understood = true;
                    take(&frame);
                }
                Line::Ok => {}
                Line::Err(text) => {
                    self.refused += 1;
                    self.checksums =
                        self.is_understood && self.checksums || is_checksum_error(text);
                }
                Line::Other(text) => match bus_off(text) {
                    Some(is_off) => self.is_bus_off = is_off,
                    None => self.refused += u64::from(!text.is_empty()),
                },
            }
        }
        self.input.copy_within(start..self.input_filled, 0);
        self.input_filled -= start;
        Ok(())
    }
}

/// What an adapter's account of its bus says of the bus being off; `None` for other lines.
fn bus_off(line: &[u8]) -> Option<bool> {
    const KEY: &[u8] = b"busoff=";
    let at = line.windows(KEY.len()).position(|part| part == KEY)?;
    Some(line.get(at + KEY.len()) == Some(&b'1'))
}

/// Waits until one of the ports has something to read, or for so long.
pub(crate) fn wait(host: &dyn Host, ports: &[Port], wait_ns: u64) {
    // A port that is gone is not waited for.
    let mut open = ports.iter().filter_map(|port| port.serial.as_deref());
    host.wait(&mut open, wait_ns);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A computer on which nothing can be opened.
    struct Refusing(Errno);

    impl Host for Refusing {
        fn now_ns(&self) -> u64 {
            0
        }

        fn open(&self, _: &str) -> Result<Box<dyn Serial>, Errno> {
            Err(self.0)
        }

        fn wait(&self, _: &mut dyn Iterator<Item = &dyn Serial>, _: u64) {}

        fn sleep(&self, _: u64) {}
    }

    #[test]
    fn a_port_that_does_not_open_is_told_with_what_to_do() {
        for (reason, told) in [
            (Errno::NOENT, "no such port; plug the adapter in"),
            (Errno::ACCESS, "no permission; add the user to the group"),
            (Errno::WOULDBLOCK, "in use by another program; end that"),
            (Errno::NOTTY, "is no serial port"),
            (Errno::IO, "check the adapter"),
        ] {
            let error = Port::open(&Refusing(reason), "/dev/a")
                .err()
                .expect("refused");
            let line = error.to_string();
            assert!(
                line.starts_with("/dev/a: ") && line.contains(told),
                "{line}"
            );
            assert!(!line.contains('\n'), "{line}");
        }
    }

    #[test]
    fn what_an_adapter_says_of_its_bus_is_read() {
        assert_eq!(bus_off(b"lec=0 dlec=0 err=0 warn=0 busoff=1"), Some(true));
        assert_eq!(bus_off(b"lec=0 dlec=0 err=0 warn=0 busoff=0"), Some(false));
        assert_eq!(bus_off(b"busoff="), Some(false));
        assert_eq!(bus_off(b"OK"), None);
    }

    /// A line that came, and a port to read it with.
    struct Said(Vec<u8>);

    impl Serial for Said {
        fn write(&mut self, bytes: &[u8]) -> Result<usize, Errno> {
            Ok(bytes.len())
        }

        fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Errno> {
            let length = self.0.len().min(buffer.len());
            buffer[..length].copy_from_slice(&self.0[..length]);
            self.0.drain(..length);
            if length == 0 {
                Err(Errno::AGAIN)
            } else {
                Ok(length)
            }
        }
    }

    struct Saying(&'static [u8]);

    impl Host for Saying {
        fn now_ns(&self) -> u64 {
            0
        }

        fn open(&self, _: &str) -> Result<Box<dyn Serial>, Errno> {
            Ok(Box::new(Said(self.0.to_vec())))
        }

        fn wait(&self, _: &mut dyn Iterator<Item = &dyn Serial>, _: u64) {}

        fn sleep(&self, _: u64) {}
    }

    fn frames(lines: &'static [u8]) -> (usize, u64) {
        let mut port = Port::open(&Saying(lines), "a").expect("it opens");
        let mut count = 0;
        port.receive(|_| count += 1).expect("it is there");
        (count, port.refused)
    }

    #[test]
    fn lines_without_their_checksum_are_refused_once_one_had_it() {
        let right = b"rcv 0100 210000 *2C\r\n";
        let crc = compute_crc8(b"rcv 0100 210000 ");
        assert_eq!(crc, 0x2c, "of the line above");
        assert_eq!(frames(right), (1, 0));
        assert_eq!(frames(b"rcv 0100 210000\r\n"), (1, 0));
        assert_eq!(frames(b"rcv 0100 210001 *2C\r\n"), (0, 1));
        assert_eq!(frames(b"rcv 0100 210000 *2C\nrcv 0100 210001\n"), (1, 1));
    }
}
