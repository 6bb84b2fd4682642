//! One process of an instance, as its supervisor sees it.

use std::os::unix::process::ExitStatusExt;
use std::time::{Duration, Instant};

use realtime::clock::monotonic_ns;
use realtime::process::send_signal;
use serde::Serialize;
use shm_types::bus::Reader;
use shm_types::messages::Heartbeat;
use shm_types::topics::Role;

/// A service that ended during a run and was started again.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Restart {
    /// Which one.
    pub role: String,
    /// Since the loop's start.
    pub at_s: f64,
    /// How it ended.
    pub reason: String,
    /// From being started again to its first heartbeat; `None` if the run ended before that.
    pub back_after_ms: Option<f64>,
}

/// A service that ends this often in a row before it gave a sign of life is broken.
const FAILED_STARTS_MAX: usize = 20;
/// How a process ends that somebody else has killed, which says nothing about it.
const KILLED: &str = "signal 9";

/// Whether the service of `role`, which has just ended for `reason`, is not worth another start.
pub fn is_broken(restarts: &[Restart], role: Role, reason: &str) -> bool {
    let mut reason = reason;
    let mut failed_starts = 0;
    let of_role = restarts.iter().rev().filter(|r| r.role == role.name());
    for restart in of_role.take_while(|r| r.back_after_ms.is_none()) {
        failed_starts += usize::from(reason != KILLED);
        reason = &restart.reason;
    }
    failed_starts >= FAILED_STARTS_MAX
}

/// A process that was started and may have ended.
#[derive(Debug)]
pub struct Child {
    role: Role,
    process: std::process::Child,
    heartbeat: Reader<Heartbeat>,
    started: Instant,
    started_at_ns: u64,
    first_sign: Option<Instant>,
    last_sign: Instant,
}

impl Child {
    /// A process just started.
    pub fn new(role: Role, process: std::process::Child, heartbeat: Reader<Heartbeat>) -> Self {
        let now = Instant::now();
        Self {
            role,
            process,
            heartbeat,
            started: now,
            started_at_ns: monotonic_ns(),
            first_sign: None,
            last_sign: now,
        }
    }

    /// What it is.
    pub fn role(&self) -> Role {
        self.role
    }

    /// Its process id.
    pub fn process_id(&self) -> u32 {
        self.process.id()
    }

    /// Takes its heartbeats. Those of a predecessor in the same role do not count.
    pub fn listen(&mut self) {
        while let Some(heartbeat) = self.heartbeat.take() {
            if heartbeat.process_id == u64::from(self.process.id()) {
                self.last_sign = Instant::now();
                self.first_sign.get_or_insert(self.last_sign);
            }
        }
    }

    /// Monotonic clock at its start.
    pub fn started_at_ns(&self) -> u64 {
        self.started_at_ns
    }

    /// Whether it has given a sign of life.
    pub fn is_ready(&self) -> bool {
        self.first_sign.is_some()
    }

    /// From its start to its first sign of life.
    pub fn ready_after(&self) -> Option<Duration> {
        self.first_sign.map(|sign| sign - self.started)
    }

    /// Whether it has been silent for longer than `limit`.
    pub fn is_silent(&self, limit: Duration) -> bool {
        self.last_sign.elapsed() > limit
    }

    /// How it ended, if it has.
    pub fn ended(&mut self) -> Option<String> {
        let status = self.process.try_wait().ok().flatten()?;
        Some(match (status.code(), status.signal()) {
            (Some(code), _) => format!("exit code {code}"),
            (None, Some(libc::SIGBUS)) => {
                "signal 7: shared memory is full; free space in /dev/shm".to_owned()
            }
            (None, Some(signal)) => format!("signal {signal}"),
            (None, None) => "unknown end".to_owned(),
        })
    }

    /// Ends it at once.
    pub fn kill(&mut self) {
        // It may have ended by itself meanwhile.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }

    /// Asks it to end and waits; kills it after `patience`. `false` if that was needed.
    pub fn stop(&mut self, patience: Duration) -> bool {
        if self.ended().is_some() {
            return true;
        }
        send_signal(self.process.id(), libc::SIGTERM);
        let asked = Instant::now();
        while self.ended().is_none() {
            if asked.elapsed() > patience {
                self.kill();
                return false;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn restarts(reason: &str, back_after_ms: Option<f64>, count: usize) -> Vec<Restart> {
        let restart = Restart {
            role: "relay".to_owned(),
            at_s: 0.0,
            reason: reason.to_owned(),
            back_after_ms,
        };
        vec![restart; count]
    }

    #[test]
    fn a_service_that_fails_at_every_start_is_broken() {
        let mut ended = restarts("exit code 2", None, FAILED_STARTS_MAX);
        assert!(is_broken(&ended, Role::Relay, "exit code 2"));
        assert!(!is_broken(&ended[1..], Role::Relay, "exit code 2"));
        assert!(!is_broken(&ended, Role::Estimator, "exit code 2"));
        ended.extend(restarts("exit code 2", Some(30.0), 1));
        assert!(!is_broken(&ended, Role::Relay, "exit code 2"), "it came up");
    }

    #[test]
    fn one_that_is_killed_at_every_start_is_not() {
        let killed = restarts(KILLED, None, 10 * FAILED_STARTS_MAX);
        assert!(!is_broken(&killed, Role::Relay, KILLED));
    }
}
