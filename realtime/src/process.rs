//! The process itself: its name, its end with its parent.

use std::ffi::CString;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Names the calling thread, and with it the process in `ps` and `top` (15 bytes are kept).
pub fn set_name(name: &str) {
    let Ok(name) = CString::new(name) else { return };
    // SAFETY: PR_SET_NAME reads a NUL-terminated string that lives through the call.
    unsafe { libc::prctl(libc::PR_SET_NAME, name.as_ptr()) };
}

/// Makes `command` start in a process group of its own, so that Ctrl-C in a terminal reaches the supervisor alone,
/// and have the kernel send it SIGTERM when the thread that started it ends.
pub fn bind_to_parent(command: &mut Command) {
    let parent = std::process::id();
    command.process_group(0);
    // SAFETY: between fork and exec only async-signal-safe calls are made (prctl, getppid, _exit); nothing is allocated.
    unsafe {
        command.pre_exec(move || {
            libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM);
            // The parent may have ended before prctl took effect; then no signal would ever come.
            if libc::getppid() as u32 != parent {
                libc::_exit(1);
            }
            Ok(())
        });
    }
}

/// Process id of the parent.
pub fn parent_id() -> u32 {
    // SAFETY: getppid takes nothing and cannot fail.
    unsafe { libc::getppid() as u32 }
}

/// Effective user id.
pub fn user_id() -> u32 {
    // SAFETY: geteuid takes nothing and cannot fail.
    unsafe { libc::geteuid() }
}

/// Sends `signal` to the process `pid`; `false` if there is none or it is not ours.
pub fn send_signal(pid: u32, signal: i32) -> bool {
    // Zero and what does not fit mean whole groups of processes to the kernel.
    match libc::pid_t::try_from(pid) {
        // SAFETY: kill takes plain numbers; a wrong pid is reported by its result.
        Ok(pid) if pid > 0 => unsafe { libc::kill(pid, signal) == 0 },
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg_attr(miri, ignore = "Miri has no prctl")]
    fn a_thread_is_named() {
        let name = || std::fs::read_to_string("/proc/thread-self/comm").unwrap_or_default();
        set_name("a name of more than fifteen bytes");
        assert_eq!(name(), "a name of more \n");
        set_name("not\0a name");
        assert_eq!(name(), "a name of more \n");
    }

    #[test]
    #[cfg_attr(miri, ignore = "Miri has no kill")]
    fn no_group_of_processes_is_signalled() {
        assert!(send_signal(std::process::id(), 0));
        assert!(!send_signal(0, 0));
        assert!(!send_signal(u32::MAX, 0));
    }
}
