//! The bar a terminal shows during a run.

use indicatif::{ProgressBar, ProgressStyle};
use shm_types::instance::RunConfig;
use shm_types::messages::{LoopState, LoopStatus};

/// Shows how far the run is and how the loop does. Nothing where there is no terminal.
pub struct Progress {
    bar: ProgressBar,
    period_s: f64,
}

impl Progress {
    /// A bar over the run's cycles.
    pub fn new(config: &RunConfig) -> Self {
        let bar = ProgressBar::new(config.cycles);
        let style = ProgressStyle::with_template("{bar:32} {prefix} {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Self {
            bar,
            period_s: config.period_ns as f64 * 1e-9,
        }
    }

    /// Moves on.
    pub fn show(&self, status: &LoopStatus) {
        let state =
            LoopState::from_raw(status.state).map_or("?".to_owned(), |state| format!("{state:?}"));
        self.bar.set_prefix(format!(
            "{:6.2} s",
            status.header.cycle as f64 * self.period_s
        ));
        self.bar.set_message(format!(
            "{state}, woke {:.0} µs late, {} missed deadlines",
            status.wakeup_lateness_ns as f64 * 1e-3,
            status.missed_deadlines
        ));
        self.bar.set_position(status.header.cycle);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
