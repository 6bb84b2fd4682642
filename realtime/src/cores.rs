//! Which cores a thread may run on.

use std::io;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// The cores this thread may use, in rising order.
pub fn usable_cores() -> Vec<usize> {
    core_affinity::get_core_ids()
        .unwrap_or_default()
        .into_iter()
        .map(|core| core.id)
        .collect()
}

/// The core the calling thread is on at the moment.
pub fn current_core() -> Option<usize> {
    // SAFETY: takes nothing and returns a number.
    usize::try_from(unsafe { libc::sched_getcpu() }).ok()
}

/// Keeps the calling thread, and what it starts, on `cores`.
///
/// # Errors
/// The kernel's reason: none of them is there, or none may be used.
pub fn stay_on(cores: &[usize]) -> io::Result<()> {
    // SAFETY: an all-zero cpu_set_t is the empty set.
    let mut set: libc::cpu_set_t = unsafe { std::mem::zeroed() };
    for &core in cores {
        if core < libc::CPU_SETSIZE as usize {
            // SAFETY: the core is one that the set has a bit for.
            unsafe { libc::CPU_SET(core, &mut set) };
        }
    }
    // SAFETY: pid 0 is the calling thread; `set` is valid for the call and as long as is said.
    let outcome = unsafe { libc::sched_setaffinity(0, size_of_val(&set), &raw const set) };
    match outcome {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Has `command` start on `cores`, whichever the thread that starts it stays on.
pub fn start_on(command: &mut Command, cores: Vec<usize>) {
    // SAFETY: between fork and exec only a system call is made on memory that is there; nothing is allocated.
    unsafe {
        command.pre_exec(move || {
            // Without it the process runs where its parent does; what it asks for itself is reported.
            let _ = stay_on(&cores);
            Ok(())
        });
    }
}

/// Keeps the thread that made it off one core until it is dropped.
#[derive(Debug)]
pub struct KeptOff {
    all: Vec<usize>,
}

impl KeptOff {
    /// Keeps the calling thread on `all` cores but `core`; `None` if there is no other or the kernel refuses.
    pub fn core(core: usize, all: &[usize]) -> Option<Self> {
        let others: Vec<usize> = all.iter().copied().filter(|&other| other != core).collect();
        stay_on(&others).ok()?;
        Some(Self { all: all.to_vec() })
    }
}

impl Drop for KeptOff {
    fn drop(&mut self) {
        let _ = stay_on(&self.all);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_is_kept_off_a_core_and_let_back() {
        // A thread of its own: the others of this test program stay where they are.
        let checked = std::thread::spawn(|| {
            let all = usable_cores();
            let Some(&last) = all.last() else { return };
            let kept = KeptOff::core(last, &all);
            assert_eq!(kept.is_some(), all.len() > 1, "one core is left for it");
            if kept.is_some() {
                assert!(!usable_cores().contains(&last));
            }
            drop(kept);
            assert_eq!(usable_cores(), all);
        });
        checked.join().expect("the checks hold");
    }

    #[test]
    fn cores_that_are_not_there_are_refused() {
        assert!(stay_on(&[usize::MAX]).is_err());
        assert!(stay_on(&[]).is_err());
    }
}
