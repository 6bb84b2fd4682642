//! What a master needs of a cable: frames out, frames in, and the clock they are timed with. A network interface is one, and
//! virtual drives in virtual time are another.

use std::thread::sleep;
use std::time::Duration;

use crate::socket::{FRAME_MAX, RawSocket, SocketError, now_ns};

/// One place at a cable. What comes back over the cable comes to every place.
pub trait Link: Send {
    /// Nanoseconds of the clock of whoever is at this end.
    fn now_ns(&self) -> u64;

    /// Sends a frame; whether it was taken. Never waits.
    fn send(&self, frame: &[u8]) -> bool;

    /// A frame that came from outside, and its length; `None` if there is none. Never waits.
    fn receive(&self, buffer: &mut [u8; FRAME_MAX]) -> Option<usize>;

    /// Waits for a frame, at most so long.
    fn wait(&self, timeout_ns: u64);

    /// Lets time pass, whatever comes meanwhile.
    fn sleep(&self, for_ns: u64);
}

/// A cable at which places can be had.
pub trait Cable: Send {
    /// Another place.
    ///
    /// # Errors
    /// [`SocketError`] in one line.
    fn open(&self) -> Result<Box<dyn Link>, SocketError>;
}

impl Link for RawSocket {
    fn now_ns(&self) -> u64 {
        now_ns()
    }

    fn send(&self, frame: &[u8]) -> bool {
        Self::send(self, frame)
    }

    fn receive(&self, buffer: &mut [u8; FRAME_MAX]) -> Option<usize> {
        Self::receive(self, buffer)
    }

    fn wait(&self, timeout_ns: u64) {
        Self::wait(self, timeout_ns);
    }

    fn sleep(&self, for_ns: u64) {
        sleep(Duration::from_nanos(for_ns));
    }
}
