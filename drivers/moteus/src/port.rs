//! The serial port of an fdcanusb adapter: frames out and in, without waiting and without the heap.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use moteus_protocol::CanFdFrame;
use moteus_protocol::fdcanusb::{
    EncodeOptions, Line, MAX_LINE_LENGTH, encode_can_send, is_checksum_error, parse_line,
    strip_checksum,
};
use rt_loop::driver::OpenError;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FlockOperation, Mode, OFlags, flock};
use rustix::io::Errno;
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};

/// Lines that are sent at once: a joint each, and one to spare.
const OUT_BYTES: usize = MAX_LINE_LENGTH * (shm_types::JOINTS_MAX + 1);
/// More than an adapter holds (fdcanusb, fw/can_manager.cc, `kBufferSize`).
const IN_BYTES: usize = 4096;
/// Buses at most: one for each joint.
pub(crate) const PORTS_MAX: usize = shm_types::JOINTS_MAX;

/// Why nothing goes through a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PortError {
    /// It took less than was to be sent.
    Full,
    /// It is gone.
    Gone,
}

/// A port, open as long as it is there.
#[derive(Debug)]
pub(crate) struct Port {
    path: String,
    fd: Option<OwnedFd>,
    checksums: bool,
    out: [u8; OUT_BYTES],
    out_filled: usize,
    input: [u8; IN_BYTES],
    input_filled: usize,
    /// Frames and lines that were refused or could not be read.
    refused: u64,
}

impl Port {
    /// Opens a port for this program alone.
    ///
    /// # Errors
    /// [`OpenError::Hardware`]: why not, and what to do.
    pub fn open(path: &str) -> Result<Self, OpenError> {
        let told = |reason: &str| OpenError::Hardware(format!("{path}: {reason}"));
        let fd = open_raw(path).map_err(|error| match error {
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
            fd: Some(fd),
            checksums: false,
            out: [0; OUT_BYTES],
            out_filled: 0,
            input: [0; IN_BYTES],
            input_filled: 0,
            refused: 0,
        })
    }

    /// As named in the robot file.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Whether it is there.
    pub fn is_open(&self) -> bool {
        self.fd.is_some()
    }

    /// Tries to open it again; not for the urgent part of a cycle.
    pub fn reopen(&mut self) {
        if self.fd.is_none() {
            self.fd = open_raw(&self.path).ok();
            self.out_filled = 0;
            self.input_filled = 0;
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
        let Some(fd) = &self.fd else {
            return Err(PortError::Gone);
        };
        if self.out_filled == 0 {
            return Ok(());
        }
        match rustix::io::write(fd, &self.out[..self.out_filled]) {
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
                self.fd = None;
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
        let Some(fd) = &self.fd else {
            return Err(PortError::Gone);
        };
        if self.input_filled == IN_BYTES {
            // no line is so long
            self.input_filled = 0;
        }
        match rustix::io::read(fd, &mut self.input[self.input_filled..]) {
            Ok(0) | Err(Errno::AGAIN | Errno::INTR) => return Ok(()),
            Ok(read) => self.input_filled += read,
            Err(_) => {
                self.fd = None;
                return Err(PortError::Gone);
            }
        }
        let mut start = 0;
        let is_end = |byte: &u8| matches!(byte, b'\r' | b'\n');
        while let Some(length) = self.input[start..self.input_filled].iter().position(is_end) {
            let (content, had_checksum, is_right) =
                strip_checksum(&self.input[start..start + length]);
            start += length + 1;
            if had_checksum && !is_right {
                self.refused += 1;
                continue;
            }
            match parse_line(content) {
                Line::Rcv(frame) => take(&frame),
                Line::Ok => {}
                Line::Err(text) => {
                    self.refused += 1;
                    self.checksums |= is_checksum_error(text);
                }
                Line::Other(text) => self.refused += u64::from(!text.is_empty()),
            }
        }
        self.input.copy_within(start..self.input_filled, 0);
        self.input_filled -= start;
        Ok(())
    }
}

/// Waits until one of the ports has something to read, or for so long.
pub(crate) fn wait(ports: &[Port], wait_ns: u64) {
    let Some(first) = ports.iter().find_map(Port::fd) else {
        realtime::clock::sleep_until(realtime::clock::monotonic_ns() + wait_ns);
        return;
    };
    // A port that is gone is not waited for: another one stands in its place, for nothing.
    let mut waited: [PollFd<'_>; PORTS_MAX] =
        std::array::from_fn(|index| match ports.get(index).and_then(Port::fd) {
            Some(fd) => PollFd::from_borrowed_fd(fd, PollFlags::IN),
            None => PollFd::from_borrowed_fd(first, PollFlags::empty()),
        });
    let time = Timespec {
        tv_sec: (wait_ns / 1_000_000_000) as _,
        tv_nsec: (wait_ns % 1_000_000_000) as _,
    };
    // An interrupted wait ends early; whoever waits looks again.
    let _ = poll(&mut waited[..ports.len().min(PORTS_MAX)], Some(&time));
}

impl Port {
    fn fd(&self) -> Option<BorrowedFd<'_>> {
        self.fd.as_ref().map(AsFd::as_fd)
    }
}

fn open_raw(path: &str) -> Result<OwnedFd, Errno> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let fd = rustix::fs::open(path, flags, Mode::empty())?;
    let mut settings = tcgetattr(&fd)?;
    flock(&fd, FlockOperation::NonBlockingLockExclusive)?;
    settings.make_raw();
    tcsetattr(&fd, OptionalActions::Now, &settings)?;
    tcflush(&fd, QueueSelector::IOFlush)?;
    Ok(fd)
}
