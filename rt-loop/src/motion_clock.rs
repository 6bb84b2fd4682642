//! Where the trajectory stands: it keeps the loop's time while joints can follow, and waits while they cannot.

use shm_types::messages::LoopState;

use crate::cycle::CycleConfig;

/// How long after a wait the trajectory takes to come back to full speed.
const RAMP_S: f64 = 0.3;

/// Time along the trajectory, and how fast it passes.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionClock {
    time_ns: u64,
    rate: f64,
    cycle: u64,
}

impl Default for MotionClock {
    fn default() -> Self {
        Self {
            time_ns: 0,
            rate: 1.0,
            cycle: 0,
        }
    }
}

impl MotionClock {
    /// Where the trajectory stands in `cycle`, after the loop was in `state` up to then.
    pub fn time_at_ns(&self, config: &CycleConfig, state: LoopState, cycle: u64) -> u64 {
        if !matches!(state, LoopState::Running | LoopState::Holding) {
            return self.time_ns;
        }
        let elapsed_ns = cycle
            .saturating_sub(self.cycle)
            .saturating_mul(config.period_ns);
        self.time_ns
            .saturating_add((elapsed_ns as f64 * self.rate).round() as u64)
    }

    /// How fast it passes, 0 to 1.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Moves on to `cycle`.
    pub fn advance(&mut self, config: &CycleConfig, state: LoopState, cycle: u64) {
        self.time_ns = self.time_at_ns(config, state, cycle);
        self.cycle = cycle;
    }

    /// Takes the state of this cycle: joints that stand still or sag make the trajectory wait, and it starts again gently.
    pub fn enter(&mut self, config: &CycleConfig, state: LoopState) {
        match state {
            LoopState::Damping | LoopState::SafeStop | LoopState::Faulted => self.rate = 0.0,
            LoopState::Running => self.rate = (self.rate + config.period_s() / RAMP_S).min(1.0),
            LoopState::Initialising
            | LoopState::Ready
            | LoopState::Enabling
            | LoopState::Holding => (),
        }
    }
}
