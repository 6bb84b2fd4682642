//! The bench as a process: a pseudo-terminal for each bus, by the wall clock.

use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use realtime::clock::monotonic_ns;
use realtime::grant::{Request, apply};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::bench::Bench;
use crate::pty::Port;

/// As the emulated plant's own process: below the loop and the controller.
const FIFO_PRIORITY: u8 = 70;
/// Sleeps at most this long: the joints move on, and a port that was closed comes back.
const SLEEP_MAX_NS: u64 = 1_000_000;

/// The ports of a bench.
#[derive(Debug)]
pub struct Ports {
    ports: Vec<Option<Port>>,
    links: Vec<Option<PathBuf>>,
}

impl Ports {
    /// Opens a port for each bus. `link` names the first; a number is put behind it for the others.
    ///
    /// # Errors
    /// What the system says, with the name.
    pub fn open(buses: usize, link: Option<&str>) -> io::Result<Self> {
        let links: Vec<Option<PathBuf>> = (0..buses)
            .map(|bus| {
                link.map(|link| match bus {
                    0 => PathBuf::from(link),
                    _ => PathBuf::from(format!("{link}{}", bus + 1)),
                })
            })
            .collect();
        let ports = links.iter().map(|link| {
            Port::open(link.as_deref()).map(Some).map_err(|error| {
                let name = link.as_deref().unwrap_or("a pseudo-terminal".as_ref());
                io::Error::new(error.kind(), format!("{}: {error}", name.display()))
            })
        });
        Ok(Self {
            ports: ports.collect::<io::Result<_>>()?,
            links,
        })
    }

    /// What the other side opens for a bus.
    pub fn path(&self, bus: usize) -> PathBuf {
        let port = self.ports[bus].as_ref();
        port.map(|port| port.path().to_path_buf())
            .unwrap_or_default()
    }

    /// Answers on the ports until `stop` is set. What else is done with the bench, `beside`, is asked for in every millisecond, and
    /// must not take long.
    ///
    /// # Errors
    /// What the system says.
    pub fn serve(
        &mut self,
        bench: &mut Bench,
        stop: &AtomicBool,
        mut beside: impl FnMut(&mut Bench),
    ) -> io::Result<()> {
        let _held = apply(&Request {
            fifo_priority: Some(FIFO_PRIORITY),
            core: None,
            lock_memory: false,
            hold_dma_latency: false,
        });
        bench.advance_to(monotonic_ns());
        while !stop.load(Ordering::Relaxed) {
            self.open_and_close(bench)?;
            self.wait(bench)?;
            for bus in 0..self.ports.len() {
                self.exchange(bench, bus)?;
            }
            bench.advance_to(monotonic_ns());
            beside(bench);
        }
        Ok(())
    }

    fn open_and_close(&mut self, bench: &Bench) -> io::Result<()> {
        for (bus, port) in self.ports.iter_mut().enumerate() {
            let is_open = bench.is_open(bus);
            if is_open && port.is_none() {
                *port = Some(Port::open(self.links[bus].as_deref())?);
            } else if !is_open {
                *port = None;
            }
        }
        Ok(())
    }

    /// Until something came, an answer is due, or the longest sleep is over.
    fn wait(&self, bench: &Bench) -> io::Result<()> {
        let mut waited: Vec<PollFd<'_>> = self
            .ports
            .iter()
            .flatten()
            .map(|port| PollFd::from_borrowed_fd(port.fd(), PollFlags::IN))
            .collect();
        let now_ns = monotonic_ns();
        let due_ns = bench
            .next_answer_ns()
            .map(|due_ns| due_ns.saturating_sub(now_ns));
        let sleep_ns = due_ns.unwrap_or(SLEEP_MAX_NS).min(SLEEP_MAX_NS);
        let sleep = Timespec {
            tv_sec: 0,
            tv_nsec: sleep_ns as _,
        };
        match poll(&mut waited, Some(&sleep)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    fn exchange(&mut self, bench: &mut Bench, bus: usize) -> io::Result<()> {
        let Some(port) = &mut self.ports[bus] else {
            return Ok(());
        };
        for line in port.read_lines()? {
            bench.take_line(bus, monotonic_ns(), &line);
        }
        let mut answers = Vec::new();
        bench.read(bus, monotonic_ns(), &mut answers);
        port.write(&answers)
    }
}
