//! Long work: outside of the interpreter's lock, on threads of its own, until it is done or Ctrl-C is pressed.

use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

use joint_twin::stop::unless_raised;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::errors::input;

/// Between two looks at whether Ctrl-C was pressed: nobody waits longer without noticing.
const LOOK: Duration = Duration::from_millis(50);

/// What work knows of who waits for it.
pub struct Waiting {
    steps: Sender<(usize, usize)>,
    flag: Arc<AtomicBool>,
}

impl Waiting {
    /// Tells how far the work is.
    pub fn tell(&self, done: usize, of: usize) {
        // nobody listens any more where the work was given up
        let _ = self.steps.send((done, of));
    }

    /// Whether somebody still waits: work that does not look by itself asks this.
    pub fn is_there(&self) -> bool {
        // nothing else is handed over with it
        !self.flag.load(Ordering::Relaxed)
    }
}

/// Does the work on so many threads, or one a core, and calls `progress` with what it tells.
///
/// The threads end with the work: a process that is forked afterwards has none that it could wait for.
///
/// # Errors
/// What `progress` or a signal's handler raises; the work is then given up.
pub fn detached<R: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Waiting) -> R + Send,
) -> PyResult<R> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(input)?;
    let flag = Arc::new(AtomicBool::new(false));
    let (steps, sent) = channel();
    py.detach(move || {
        std::thread::scope(|scope| {
            let waiting = Waiting {
                steps,
                flag: flag.clone(),
            };
            // what waits ends with the work, and so does the wait for steps
            let worker = scope.spawn({
                let flag = flag.clone();
                move || pool.install(|| unless_raised(&flag, move || work(&waiting)))
            });
            let mut raised = None;
            loop {
                let called = match sent.recv_timeout(LOOK) {
                    Ok(step) if raised.is_none() => Python::attach(|py| {
                        let call = |progress: &Py<PyAny>| progress.call1(py, step).map(|_| ());
                        progress.map_or(Ok(()), call)
                    }),
                    Err(RecvTimeoutError::Timeout) if raised.is_none() => {
                        Python::attach(|py| py.check_signals())
                    }
                    Err(RecvTimeoutError::Disconnected) => break,
                    _ => Ok(()),
                };
                if let Err(error) = called {
                    raised = Some(error);
                    // nothing else is handed over with it
                    flag.store(true, Ordering::Relaxed);
                }
            }
            match (worker.join(), raised) {
                (Err(payload), _) => resume_unwind(payload),
                (Ok(_), Some(error)) => Err(error),
                (Ok(Ok(result)), None) => Ok(result),
                (Ok(Err(stopped)), None) => Err(PyKeyboardInterrupt::new_err(stopped.to_string())),
            }
        })
    })
}
