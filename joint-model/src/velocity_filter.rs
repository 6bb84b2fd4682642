//! Joint velocity from position: the backward difference through a Butterworth low-pass.

use crate::filter::{Butterworth, FilterError};

/// One joint's velocity observer. PA10-05, section V: 200 Hz, fifth order in PA10-03.
#[derive(Clone, Debug)]
pub struct VelocityFilter {
    filter: Option<Butterworth>,
    before: Option<(u64, f64)>,
    velocity_rad_s: f64,
}

impl VelocityFilter {
    /// An observer for samples at `rate_hz`; a cut-off of 0 leaves the difference as it is.
    ///
    /// # Errors
    /// [`FilterError`] for an order or cut-off that cannot be.
    pub fn new(order: usize, cutoff_hz: f64, rate_hz: f64) -> Result<Self, FilterError> {
        let filter = if cutoff_hz > 0.0 {
            Some(Butterworth::design(order, cutoff_hz, rate_hz)?)
        } else {
            None
        };
        Ok(Self {
            filter,
            before: None,
            velocity_rad_s: 0.0,
        })
    }

    /// Takes the position of a cycle and gives the velocity. Skipped cycles count as time, a repeated one is ignored.
    pub fn observe(&mut self, cycle: u64, position_rad: f64, period_s: f64) -> f64 {
        let before = self.before.replace((cycle, position_rad));
        let Some((cycle_before, position_before_rad)) = before else {
            return self.velocity_rad_s;
        };
        let cycles = cycle.saturating_sub(cycle_before);
        if cycles == 0 {
            return self.velocity_rad_s;
        }
        let difference_rad_s = (position_rad - position_before_rad) / (cycles as f64 * period_s);
        self.velocity_rad_s = match &mut self.filter {
            Some(filter) => filter.step(difference_rad_s),
            None => difference_rad_s,
        };
        self.velocity_rad_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_motion_is_seen_as_it_is_even_with_cycles_missing() {
        let period_s = 1.0 / 1500.0;
        let mut filter = VelocityFilter::new(5, 200.0, 1500.0).expect("a usual filter");
        let mut velocity = 0.0;
        for cycle in (0..400).filter(|cycle| cycle % 7 != 3) {
            velocity = filter.observe(cycle, 0.3 * cycle as f64 * period_s, period_s);
        }
        assert!((velocity - 0.3).abs() < 1e-6, "{velocity}");
    }
}
