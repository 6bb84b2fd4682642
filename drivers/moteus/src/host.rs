//! Where the serial ports are, and the clock that goes with them: this computer, or a bench in virtual time.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use realtime::clock::{monotonic_ns, sleep_until};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FlockOperation, Mode, OFlags, flock};
use rustix::io::Errno;
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};

/// Buses at most: one for each joint.
pub const PORTS_MAX: usize = shm_types::JOINTS_MAX;

/// An open serial port. Nothing here waits: `AGAIN` is "not now", other errors are a port that is gone.
pub trait Serial {
    /// Sends as much as the port takes now; how much that was.
    ///
    /// # Errors
    /// What the system says.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Errno>;

    /// Takes what is there; how much that was.
    ///
    /// # Errors
    /// What the system says.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Errno>;

    /// What the system waits on, where it is the system that waits.
    fn fd(&self) -> Option<BorrowedFd<'_>> {
        None
    }
}

/// Where ports are opened and waited for.
pub trait Host {
    /// Nanoseconds of the clock that cycles are planned by.
    fn now_ns(&self) -> u64;

    /// Opens a port for this program alone.
    ///
    /// # Errors
    /// What the system says.
    fn open(&self, path: &str) -> Result<Box<dyn Serial>, Errno>;

    /// Waits until one of the ports, [`PORTS_MAX`] at most, has something to read, or for so long.
    fn wait(&self, ports: &mut dyn Iterator<Item = &dyn Serial>, wait_ns: u64);

    /// Lets time pass, whatever comes meanwhile.
    fn sleep(&self, for_ns: u64);
}

/// This computer.
#[derive(Clone, Copy, Debug)]
pub struct Computer;

impl Host for Computer {
    fn now_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn open(&self, path: &str) -> Result<Box<dyn Serial>, Errno> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let fd = rustix::fs::open(path, flags, Mode::empty())?;
        let mut settings = tcgetattr(&fd)?;
        flock(&fd, FlockOperation::NonBlockingLockExclusive)?;
        settings.make_raw();
        tcsetattr(&fd, OptionalActions::Now, &settings)?;
        tcflush(&fd, QueueSelector::IOFlush)?;
        Ok(Box::new(fd))
    }

    fn wait(&self, ports: &mut dyn Iterator<Item = &dyn Serial>, wait_ns: u64) {
        let mut fds = ports.filter_map(Serial::fd);
        let Some(first) = fds.next() else {
            self.sleep(wait_ns);
            return;
        };
        let mut waited: [PollFd<'_>; PORTS_MAX] =
            std::array::from_fn(|_| PollFd::from_borrowed_fd(first, PollFlags::IN));
        let mut count = 1;
        for (place, fd) in waited[1..].iter_mut().zip(fds) {
            *place = PollFd::from_borrowed_fd(fd, PollFlags::IN);
            count += 1;
        }
        let time = Timespec {
            tv_sec: (wait_ns / 1_000_000_000) as _,
            tv_nsec: (wait_ns % 1_000_000_000) as _,
        };
        // An interrupted wait ends early; whoever waits looks again.
        let _ = poll(&mut waited[..count], Some(&time));
    }

    fn sleep(&self, for_ns: u64) {
        sleep_until(monotonic_ns() + for_ns);
    }
}

impl Serial for OwnedFd {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Errno> {
        rustix::io::write(self, bytes)
    }

    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Errno> {
        rustix::io::read(self, buffer)
    }

    fn fd(&self) -> Option<BorrowedFd<'_>> {
        Some(self.as_fd())
    }
}
