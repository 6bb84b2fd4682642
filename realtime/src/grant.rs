//! Asking for real-time treatment, and reporting what was granted.

use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::Write;

use serde::{Deserialize, Serialize};

use crate::cores::usable_cores;

/// What a thread asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Request {
    /// SCHED_FIFO priority, 1 to 99; `None` leaves the default scheduler.
    pub fifo_priority: Option<u8>,
    /// Core to run on; `None` leaves the choice to the kernel.
    pub core: Option<usize>,
    /// Lock all memory and touch stack and heap beforehand.
    pub lock_memory: bool,
    /// Keep cores out of deep sleep, which costs wake-up time.
    pub hold_dma_latency: bool,
}

/// What was granted: each field is read back from the kernel.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grant {
    /// The SCHED_FIFO priority the thread has; `None` on the default scheduler.
    pub fifo_priority: Option<u8>,
    /// The one core the thread may run on; `None` if there are several.
    pub core: Option<usize>,
    /// Whether memory is locked.
    pub memory_locked: bool,
    /// Whether `/dev/cpu_dma_latency` is held at 0.
    pub dma_latency_held: bool,
    /// What was asked for and refused, one line each, with the kernel's reason.
    pub refused: Vec<String>,
}

impl fmt::Display for Grant {
    /// What was granted, without what was refused.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.fifo_priority {
            Some(priority) => write!(f, "SCHED_FIFO {priority}")?,
            None => f.write_str("ordinary scheduler")?,
        }
        match self.core {
            Some(core) => write!(f, ", core {core}")?,
            None => f.write_str(", any core")?,
        }
        f.write_str(if self.memory_locked {
            ", memory locked"
        } else {
            ", memory not locked"
        })?;
        f.write_str(if self.dma_latency_held {
            ", deep sleep off"
        } else {
            ", deep sleep possible"
        })
    }
}

/// Held for as long as the grant shall last.
#[derive(Debug)]
pub struct Held {
    _dma_latency: Option<File>,
}

/// Applies `request` to the calling thread; what is refused is reported, never an error.
pub fn apply(request: &Request) -> (Grant, Held) {
    let mut refused = Vec::new();
    let mut note = |what: &str, error: std::io::Error| refused.push(format!("{what}: {error}"));

    if let Some(core) = request.core {
        // The library panics on a core the system cannot have.
        if !usable_cores().contains(&core) {
            note(
                &format!("pinning to core {core}"),
                std::io::Error::other("not a core this process may use"),
            );
        } else if !core_affinity::set_for_current(core_affinity::CoreId { id: core }) {
            note(
                &format!("pinning to core {core}"),
                std::io::Error::last_os_error(),
            );
        }
    }
    let mut memory_locked = false;
    if request.lock_memory {
        prefault_heap();
        // SAFETY: mlockall takes flags only and changes no memory contents.
        if unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } == 0 {
            memory_locked = true;
        } else {
            note("locking memory (mlockall)", std::io::Error::last_os_error());
        }
        prefault_stack();
    }
    let mut dma_latency = None;
    if request.hold_dma_latency {
        match hold_dma_latency() {
            Ok(file) => dma_latency = Some(file),
            Err(error) => note("holding /dev/cpu_dma_latency at 0", error),
        }
    }
    if let Some(priority) = request.fifo_priority {
        let parameters = libc::sched_param {
            sched_priority: i32::from(priority),
        };
        // SAFETY: pid 0 is the calling thread; `parameters` is valid for the call.
        if unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) } != 0 {
            note(
                &format!("SCHED_FIFO priority {priority}"),
                std::io::Error::last_os_error(),
            );
        }
    }
    let grant = Grant {
        fifo_priority: granted_fifo_priority(),
        core: granted_core(),
        memory_locked,
        dma_latency_held: dma_latency.is_some(),
        refused,
    };
    (
        grant,
        Held {
            _dma_latency: dma_latency,
        },
    )
}

fn hold_dma_latency() -> std::io::Result<File> {
    let mut file = OpenOptions::new()
        .write(true)
        .open("/dev/cpu_dma_latency")?;
    file.write_all(&0_i32.to_ne_bytes())?;
    Ok(file)
}

fn granted_fifo_priority() -> Option<u8> {
    let mut parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: pid 0 is the calling thread; `parameters` is valid for writing.
    let policy = unsafe {
        libc::sched_getparam(0, &mut parameters);
        libc::sched_getscheduler(0)
    };
    // The kernel may add SCHED_RESET_ON_FORK to the policy.
    (policy & !libc::SCHED_RESET_ON_FORK == libc::SCHED_FIFO)
        .then_some(parameters.sched_priority as u8)
}

fn granted_core() -> Option<usize> {
    match usable_cores().as_slice() {
        [core] => Some(*core),
        _ => None,
    }
}

/// Bytes of stack touched in advance; the default stack is 8 MiB, the cycle needs far less.
const STACK_PREFAULT_BYTES: usize = 512 * 1024;
/// Bytes of heap touched in advance and kept by the allocator.
const HEAP_PREFAULT_BYTES: usize = 8 * 1024 * 1024;

#[inline(never)]
fn prefault_stack() {
    let mut stack = [0_u8; STACK_PREFAULT_BYTES];
    std::hint::black_box(&mut stack[..]);
}

fn prefault_heap() {
    // SAFETY: mallopt takes plain numbers; it only tells the allocator to keep freed memory instead of giving it back.
    unsafe {
        libc::mallopt(libc::M_TRIM_THRESHOLD, -1);
        libc::mallopt(libc::M_MMAP_MAX, 0);
    }
    let heap = vec![1_u8; HEAP_PREFAULT_BYTES];
    std::hint::black_box(&heap[..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg_attr(miri, ignore = "Miri has no sched_getparam")]
    fn a_refused_wish_is_reported_and_not_claimed() {
        let cores = usable_cores();
        let request = Request {
            fifo_priority: None,
            core: Some(cores.iter().max().copied().unwrap_or(0) + 4096),
            lock_memory: false,
            hold_dma_latency: false,
        };
        let (grant, _held) = apply(&request);
        assert_eq!(grant.refused.len(), 1, "{:?}", grant.refused);
        assert_ne!(grant.core, request.core);
        assert!(!grant.memory_locked && !grant.dma_latency_held);
    }
}
