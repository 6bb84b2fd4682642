//! Which command acts when: the synchronous drive's rule.
//!
//! The drives latch their sensors at the instants `t_k` of the loop's clock. The command computed from sample `k` acts
//! from `t_(k+1)` on, however early it came. So what happens between `t_k` and `t_(k+1)` is settled once command `k - 1`
//! is here, and the emulator may compute sample `k + 1` while the loop is still busy with cycle `k`.

use shm_types::messages::DriveCommand;

/// Commands that came, until their interval has passed.
#[derive(Clone, Debug, Default)]
pub struct CommandLatch {
    waiting: [Option<DriveCommand>; WAITING_MAX],
    acting: Option<DriveCommand>,
}

/// The loop is at most two cycles ahead of the plant; the rest is for one that sends nonsense.
const WAITING_MAX: usize = 8;

impl CommandLatch {
    /// Takes a command; of more than it can hold, the oldest is dropped.
    pub fn push(&mut self, command: DriveCommand) {
        self.waiting.rotate_left(1);
        self.waiting[WAITING_MAX - 1] = Some(command);
    }

    /// Whether the command computed from sample `cycle`, or a later one, has come.
    pub fn has(&self, cycle: u64) -> bool {
        self.waiting
            .iter()
            .flatten()
            .chain(&self.acting)
            .any(|command| command.header.cycle >= cycle)
    }

    /// The command that acts between the latches `cycle` and `cycle + 1`, and whether it is the one meant for it.
    pub fn acting_in(&mut self, cycle: u64) -> (Option<DriveCommand>, bool) {
        for slot in &mut self.waiting {
            if slot.is_some_and(|command| command.header.cycle < cycle) {
                self.acting = slot.take();
            }
        }
        let fresh = self
            .acting
            .is_some_and(|command| command.header.cycle + 1 == cycle);
        (self.acting, fresh)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::messages::Header;

    fn command(cycle: u64) -> DriveCommand {
        DriveCommand {
            header: Header {
                cycle,
                ..Header::default()
            },
            ..DriveCommand::default()
        }
    }

    #[test]
    fn a_command_acts_from_the_next_latch_on_and_is_held_while_none_follows() {
        let mut latch = CommandLatch::default();
        assert_eq!(latch.acting_in(0), (None, false));
        latch.push(command(0));
        latch.push(command(1));
        assert!(latch.has(1) && !latch.has(2));
        assert_eq!(latch.acting_in(0), (None, false), "not before its latch");
        assert_eq!(latch.acting_in(1), (Some(command(0)), true));
        assert_eq!(latch.acting_in(2), (Some(command(1)), true));
        assert_eq!(
            latch.acting_in(3),
            (Some(command(1)), false),
            "held, but stale"
        );
        for cycle in 3..30 {
            latch.push(command(cycle));
        }
        assert_eq!(latch.acting_in(25), (Some(command(24)), true));
    }
}
