//! Room for an instance, whose its directory is, and what dead instances have left.

use super::finding::{Finding, Rule, Verdict};

/// Shared memory of one instance of sixteen joints, rounded up.
const SHARED_MEMORY_BYTES: u64 = 64 << 20;
/// Its files in `/tmp`, rounded up.
const FILES_BYTES: u64 = 16 << 20;

const SHARED_MEMORY: Rule = Rule {
    about: "room in /dev/shm",
    wanted: "64 MiB for each instance",
    mend: "mount -o remount,size=256M /dev/shm; in a container --shm-size 256m",
    cost: "an instance does not start, or is killed by the kernel when it touches memory that is not there",
};

const FILES: Rule = Rule {
    about: "room in /tmp",
    wanted: "16 MiB for each instance",
    mend: "remove what fills it: du -xh /tmp | sort -h | tail",
    cost: "an instance does not start, or cannot write its report",
};

/// Whether one more instance fits into `/dev/shm`.
pub fn shared_memory(free_bytes: Option<u64>) -> Finding {
    room(&SHARED_MEMORY, "/dev/shm", free_bytes, SHARED_MEMORY_BYTES)
}

/// Whether one more instance fits into `/tmp`.
pub fn files(free_bytes: Option<u64>) -> Finding {
    room(&FILES, "/tmp", free_bytes, FILES_BYTES)
}

fn room(rule: &Rule, place: &str, free_bytes: Option<u64>, wanted_bytes: u64) -> Finding {
    match free_bytes {
        None => rule.finds_nothing(place),
        Some(free_bytes) => rule.finds_good_if(
            free_bytes >= wanted_bytes,
            Verdict::Missing,
            format!("{} MiB free", free_bytes >> 20),
        ),
    }
}

const DIRECTORY: Rule = Rule {
    about: "directory of instances",
    wanted: "yours alone, or not there yet",
    mend: "",
    cost: "no instance starts: whoever may enter it could read the robot's state and command it",
};

/// Whether the user's directory of instances is his alone; `refusal` is what a start would say.
pub fn directory(refusal: Option<String>) -> Finding {
    let (verdict, is) = match refusal {
        None => (Verdict::Good, "yours alone, or not there yet".to_owned()),
        Some(refusal) => (Verdict::Missing, refusal),
    };
    Finding {
        mend: None,
        ..DIRECTORY.finds(verdict, is)
    }
}

const LEFTOVERS: Rule = Rule {
    about: "left by dead instances",
    wanted: "nothing",
    mend: "",
    cost: "memory that nobody uses; the next instance of that name wipes it before it starts",
};

/// An instance of the user that has a directory or a lock file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seen {
    /// Its name.
    pub name: String,
    /// What its files in `/dev/shm` begin with.
    pub ipc_prefix: String,
    /// Whether somebody holds its lock.
    pub running: bool,
}

/// What the user's instances have left that do not run any more. `shared_memory` names the user's files in `/dev/shm`.
pub fn leftovers(seen: &[Seen], shared_memory: &[String]) -> Finding {
    let running: Vec<&Seen> = seen.iter().filter(|instance| instance.running).collect();
    let dead: Vec<&str> = seen
        .iter()
        .filter(|instance| !instance.running)
        .map(|instance| instance.name.as_str())
        .collect();
    let orphans: Vec<&str> = shared_memory
        .iter()
        .map(String::as_str)
        .filter(|file| {
            is_ours(file)
                && !running
                    .iter()
                    .any(|live| file.starts_with(&live.ipc_prefix))
        })
        .collect();
    if dead.is_empty() && orphans.is_empty() {
        let is = match running.len() {
            0 => "nothing".to_owned(),
            count => format!("nothing; {count} running"),
        };
        return LEFTOVERS.finds(Verdict::Good, is);
    }
    let names = match dead.as_slice() {
        [] => "instances no longer known".to_owned(),
        names => names.join(", "),
    };
    Finding {
        mend: Some(removal(&dead, &orphans)),
        ..LEFTOVERS.finds(
            Verdict::Weak,
            format!("{names}; {} files in /dev/shm", orphans.len()),
        )
    }
}

/// The commands that remove what is left.
fn removal(dead: &[&str], orphans: &[&str]) -> String {
    let mut prefixes: Vec<&str> = orphans.iter().map(|file| &file[..PREFIX_BYTES]).collect();
    prefixes.sort_unstable();
    prefixes.dedup();
    let start = dead
        .first()
        .map(|name| format!("flexspline run --instance {name} wipes it"));
    let remove = (!prefixes.is_empty()).then(|| {
        let globs: Vec<String> = prefixes
            .iter()
            .map(|prefix| format!("/dev/shm/{prefix}*"))
            .collect();
        format!("rm {}", globs.join(" "))
    });
    [start, remove]
        .into_iter()
        .flatten()
        .collect::<Vec<_>>()
        .join(", or ")
}

/// `fs`, ten digits in base 36, a dot: see [`shm_types::instance::Instance::ipc_prefix`].
const PREFIX_BYTES: usize = 13;

fn is_ours(file: &str) -> bool {
    let bytes = file.as_bytes();
    bytes.len() > PREFIX_BYTES
        && bytes.starts_with(b"fs")
        && bytes[2..PREFIX_BYTES - 1]
            .iter()
            .all(|byte| byte.is_ascii_digit() || byte.is_ascii_lowercase())
        && bytes[PREFIX_BYTES - 1] == b'.'
}

/// Inodes of the files that somebody has locked, from `/proc/locks`. Trying the lock instead could keep an instance from
/// starting that moment.
pub fn locked_inodes(proc_locks: &str) -> Vec<u64> {
    proc_locks
        .lines()
        .filter(|line| line.contains("FLOCK"))
        .filter_map(|line| {
            let place = line
                .split_whitespace()
                .find(|word| word.matches(':').count() == 2)?;
            place.rsplit(':').next()?.parse().ok()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(name: &str, running: bool) -> Seen {
        Seen {
            name: name.to_owned(),
            ipc_prefix: format!("fs{name:0>10}."),
            running,
        }
    }

    #[test]
    fn too_little_room_is_missing_and_unknown_room_is_not() {
        assert_eq!(shared_memory(Some(1 << 30)).verdict, Verdict::Good);
        assert_eq!(shared_memory(Some(60 << 20)).verdict, Verdict::Missing);
        assert_eq!(files(None).verdict, Verdict::Unknown);
    }

    #[test]
    fn only_dead_instances_leave_something() {
        let files = [
            "fs000000arm1.x",
            "fs000000arm2.y",
            "fs000000arm2.z",
            "sem.other",
        ]
        .map(str::to_owned);
        assert_eq!(
            leftovers(&[seen("arm1", true)], &files[..1]).verdict,
            Verdict::Good
        );
        let found = leftovers(&[seen("arm1", true), seen("arm2", false)], &files);
        assert_eq!(
            (found.verdict, found.is.as_str()),
            (Verdict::Weak, "arm2; 2 files in /dev/shm")
        );
        assert_eq!(
            found.mend.as_deref(),
            Some("flexspline run --instance arm2 wipes it, or rm /dev/shm/fs000000arm2.*")
        );
        let unknown = leftovers(&[], &files[1..]);
        assert!(
            unknown.is.starts_with("instances no longer known"),
            "{}",
            unknown.is
        );
    }

    #[test]
    fn locks_are_known_by_their_inode() {
        let text = "1: FLOCK  ADVISORY  WRITE 812 fe:00:1234 0 EOF\n2: POSIX  ADVISORY  READ 9 fe:00:77 0 EOF\n\
                    3: -> FLOCK  ADVISORY  WRITE 9 00:1f:88 0 EOF\n";
        assert_eq!(locked_inodes(text), [1234, 88]);
    }
}
