//! One bus's port: a pseudo-terminal, and the lines that come in on it.

use std::ffi::CStr;
use std::fs;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::fdcanusb::LINE_BYTES;

/// Bytes for a reader that is slow. An adapter drops what its buffer does not hold.
const WAITING_BYTES: usize = 1 << 16;

/// A pseudo-terminal. The other side opens [`Port::path`].
#[derive(Debug)]
pub(crate) struct Port {
    ours: OwnedFd,
    /// Kept open, so that the port stays while nobody has it open.
    _theirs: OwnedFd,
    path: PathBuf,
    link: Option<PathBuf>,
    line: Vec<u8>,
    is_too_long: bool,
    waiting: Vec<u8>,
}

impl Port {
    /// Opens one, and names it `link` too if given.
    ///
    /// # Errors
    /// What the system says.
    pub fn open(link: Option<&Path>) -> std::io::Result<Self> {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&ours)?;
        unlockpt(&ours)?;
        let name = ptsname(&ours, Vec::new())?;
        let theirs = open_raw(&name)?;
        rustix::io::ioctl_fionbio(&ours, true)?;
        let path = PathBuf::from(name.to_string_lossy().into_owned());
        if let Some(link) = link {
            name_too(link, &path)?;
        }
        Ok(Self {
            ours,
            _theirs: theirs,
            path,
            link: link.map(Path::to_path_buf),
            line: Vec::new(),
            is_too_long: false,
            waiting: Vec::new(),
        })
    }

    /// What the other side opens.
    pub fn path(&self) -> &Path {
        self.link.as_deref().unwrap_or(&self.path)
    }

    /// For waiting on it.
    pub fn fd(&self) -> BorrowedFd<'_> {
        self.ours.as_fd()
    }

    /// Reads what is there; the lines that it completes.
    ///
    /// # Errors
    /// What the system says, but not that nothing is there.
    pub fn read_lines(&mut self) -> std::io::Result<Vec<Vec<u8>>> {
        let mut lines = Vec::new();
        let mut buffer = [0; 4096];
        loop {
            let read = match rustix::io::read(&self.ours, &mut buffer) {
                Ok(0) | Err(Errno::AGAIN | Errno::INTR) => return Ok(lines),
                Ok(read) => read,
                Err(error) => return Err(error.into()),
            };
            for byte in &buffer[..read] {
                if !matches!(byte, b'\r' | b'\n') {
                    self.is_too_long |= self.line.len() >= LINE_BYTES;
                    if !self.is_too_long {
                        self.line.push(*byte);
                    }
                    continue;
                }
                let line = std::mem::take(&mut self.line);
                if !std::mem::take(&mut self.is_too_long) {
                    lines.push(line);
                }
            }
        }
    }

    /// Writes as much as the other side has room for; the rest waits, and what does not fit there is lost.
    ///
    /// # Errors
    /// What the system says, but not that there is no room.
    pub fn write(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        if self.waiting.len() + bytes.len() <= WAITING_BYTES {
            self.waiting.extend_from_slice(bytes);
        }
        while !self.waiting.is_empty() {
            match rustix::io::write(&self.ours, &self.waiting) {
                Ok(written) => drop(self.waiting.drain(..written)),
                Err(Errno::AGAIN | Errno::INTR) => return Ok(()),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        let is_ours = |link: &&PathBuf| fs::read_link(link).is_ok_and(|target| target == self.path);
        if let Some(link) = self.link.as_ref().filter(is_ours) {
            let _ = fs::remove_file(link);
        }
    }
}

/// The other side, without echo, line editing or translation.
fn open_raw(name: &CStr) -> std::io::Result<OwnedFd> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let theirs = rustix::fs::open(name, flags, Mode::empty())?;
    let mut settings = tcgetattr(&theirs)?;
    settings.make_raw();
    tcsetattr(&theirs, OptionalActions::Now, &settings)?;
    Ok(theirs)
}

/// A symbolic link takes the place of another, and of nothing else.
fn name_too(link: &Path, path: &Path) -> std::io::Result<()> {
    if fs::symlink_metadata(link).is_ok_and(|found| found.is_symlink()) {
        fs::remove_file(link)?;
    }
    std::os::unix::fs::symlink(path, link)
}
