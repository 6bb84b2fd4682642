//! Ends a computation that nobody waits for any more.
//!
//! Whoever asks for it raises a flag. The work looks at it between items that are worked on at once and between the sets of names that are
//! scored, and unwinds from there, as `salsa` and `rustc` do: hundreds of functions in between need no second result.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    /// Of the work that this thread does now.
    static FLAG: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// The flag was raised before the work was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("stopped")]
pub struct Stopped;

/// Does the work, unless or until `flag` is raised.
///
/// # Errors
/// [`Stopped`] if it was raised before the work was done.
pub fn unless_raised<R>(flag: &Arc<AtomicBool>, work: impl FnOnce() -> R) -> Result<R, Stopped> {
    // what the work has changed when it unwinds is dropped with it
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        under(Some(flag.clone()), || {
            look();
            work()
        })
    }));
    outcome.or_else(|payload| match payload.downcast::<Stopped>() {
        Ok(stopped) => Err(*stopped),
        Err(other) => resume_unwind(other),
    })
}

/// Unwinds if the flag of this thread's work is raised.
pub fn look() {
    let is_raised = FLAG.with_borrow(|flag| {
        let flag = flag.as_ref();
        // nothing else is handed over with it
        flag.is_some_and(|flag| flag.load(Ordering::Relaxed))
    });
    if is_raised {
        resume_unwind(Box::new(Stopped));
    }
}

/// The flag of this thread's work, for threads that help with it.
pub(crate) fn flag() -> Option<Arc<AtomicBool>> {
    FLAG.with_borrow(Clone::clone)
}

/// Works under that flag: a thread that waits may help with another's work meanwhile.
pub(crate) fn under<R>(flag: Option<Arc<AtomicBool>>, work: impl FnOnce() -> R) -> R {
    struct Before(Option<Arc<AtomicBool>>);
    impl Drop for Before {
        fn drop(&mut self) {
            FLAG.set(self.0.take());
        }
    }
    let _before = Before(FLAG.replace(flag));
    work()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;
    use crate::on_all_cores::OnAllCores;

    #[test]
    fn a_raised_flag_ends_the_work_on_every_thread_and_no_other_work() {
        let flag = Arc::new(AtomicBool::new(false));
        let done = std::sync::atomic::AtomicUsize::new(0);
        let stopped = unless_raised(&flag, || {
            (0..10_000_usize)
                .on_all_cores(|k| {
                    if k == 20 {
                        flag.store(true, Ordering::Relaxed);
                    }
                    done.fetch_add(1, Ordering::Relaxed);
                    std::thread::yield_now();
                })
                .count()
        });
        assert_eq!(stopped, Err(Stopped));
        assert!(done.load(Ordering::Relaxed) < 10_000);
        let other = unless_raised(&Arc::default(), || (0..100).on_all_cores(|k| k).count());
        assert_eq!(other, Ok(100));
    }

    #[test]
    fn what_else_unwinds_goes_on() {
        let unwound =
            catch_unwind(|| unless_raised(&Arc::default(), || resume_unwind(Box::new("other"))));
        let payload = unwound.map(|never: Result<(), Stopped>| never).unwrap_err();
        assert_eq!(payload.downcast_ref(), Some(&"other"));
    }
}
