//! The monotonic clock and sleeping to an instant on it.

/// Nanoseconds on `CLOCK_MONOTONIC`.
pub fn monotonic_ns() -> u64 {
    let mut now = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: `now` is a valid timespec for the call; CLOCK_MONOTONIC always exists, so the call cannot fail.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut now) };
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Sleeps until `instant_ns` on the monotonic clock; returns at once if that has passed.
///
/// An absolute instant does not drift: the time between reading a clock and going to sleep is not added to every
/// period. Returns early, with `false`, when a signal interrupts the sleep.
pub fn sleep_until(instant_ns: u64) -> bool {
    let instant = libc::timespec {
        tv_sec: (instant_ns / 1_000_000_000) as libc::time_t,
        tv_nsec: (instant_ns % 1_000_000_000) as libc::c_long,
    };
    // SAFETY: `instant` is a valid timespec; with TIMER_ABSTIME the remaining time is not written, so null is allowed.
    let outcome = unsafe {
        libc::clock_nanosleep(
            libc::CLOCK_MONOTONIC,
            libc::TIMER_ABSTIME,
            &instant,
            std::ptr::null_mut(),
        )
    };
    outcome == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sleep_ends_at_its_instant_or_later_and_at_once_if_that_has_passed() {
        let begun_ns = monotonic_ns();
        assert!(sleep_until(0));
        let instant_ns = monotonic_ns() + 1_000_000;
        assert!(sleep_until(instant_ns));
        assert!(monotonic_ns() >= instant_ns && instant_ns > begun_ns);
    }
}
