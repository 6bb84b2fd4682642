//! The process that outlives all others of an instance and removes what they leave.
//!
//! Its standard input is a pipe whose other end every process of the instance holds open: when the last one is gone,
//! however it ended, the pipe ends, and the janitor wipes the instance's directory and shared memory. Its standard
//! output is the instance's lock, which it thereby holds until the wiping is done, so that no new instance of that name
//! can start in between.

use std::fs;
use std::io::Read;
use std::os::fd::AsRawFd;

use realtime::clock::monotonic_ns;
use realtime::process::{parent_id, send_signal};
use realtime::wait::readable;
use shm_types::instance::{Instance, InstanceError};

/// How often the janitor looks whether the supervisor still lives.
const LOOK_NS: u64 = 200_000_000;
/// How long the processes have to end by themselves once the supervisor is gone.
const PATIENCE_NS: u64 = 3_000_000_000;

/// Waits for the end of all processes, then wipes. Process ids arrive on standard input, one a line.
///
/// # Errors
/// [`InstanceError::File`] for what could not be removed.
pub fn run(instance: &Instance) -> Result<(), InstanceError> {
    let supervisor = parent_id();
    let mut orphaned_at_ns = None;
    let mut input = std::io::stdin().lock();
    let mut text = Vec::new();
    let mut buffer = [0; 256];
    loop {
        if readable(input.as_raw_fd(), LOOK_NS) {
            match input.read(&mut buffer) {
                Ok(0) | Err(_) => break,
                Ok(length) => text.extend_from_slice(&buffer[..length]),
            }
        }
        if orphaned_at_ns.is_none() && parent_id() != supervisor {
            orphaned_at_ns = Some(monotonic_ns());
        }
        if orphaned_at_ns.is_some_and(|since_ns| monotonic_ns() - since_ns > PATIENCE_NS) {
            kill_remaining(instance, &String::from_utf8_lossy(&text));
        }
    }
    instance.vanish()
}

/// Kills those of the listed processes that still belong to this instance: a number may have been given away since.
fn kill_remaining(instance: &Instance, process_ids: &str) {
    for process_id in process_ids
        .lines()
        .filter_map(|line| line.parse::<u32>().ok())
    {
        let command_line = fs::read(format!("/proc/{process_id}/cmdline")).unwrap_or_default();
        let mut words = command_line.split(|&byte| byte == 0);
        if words.any(|word| word == b"--instance")
            && words.next() == Some(instance.name().as_bytes())
        {
            send_signal(process_id, libc::SIGKILL);
        }
    }
}
