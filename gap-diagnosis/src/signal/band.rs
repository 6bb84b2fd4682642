//! The band in which torques along the recorded motion are compared.

use joint_model::filter::FilterError;

use super::smooth::low_pass;

/// Above this nothing is compared, in hertz: torque sensors of arms are low-passed at 8 Hz and more (KUKA LWR4), and no arm is
/// moved faster on purpose. Between 4 and 15 Hz the names on three real arms stay.
pub const COMPARED_HZ: f64 = 8.0;

/// A low-pass without delay; nothing is taken off where the rate cannot hold more anyway.
#[derive(Clone, Copy, Debug)]
pub struct Band {
    cutoff_hz: Option<f64>,
    rate_hz: f64,
}

impl Band {
    /// Up to a frequency, at a rate.
    pub fn of(rate_hz: f64, cutoff_hz: f64) -> Self {
        /// Of the rate: a filter's design fails at one half.
        const MOST: f64 = 0.45;
        Self {
            cutoff_hz: Some(cutoff_hz).filter(|cutoff_hz| *cutoff_hz < MOST * rate_hz),
            rate_hz,
        }
    }

    /// What lies in the band.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn limit(&self, values: &[f64]) -> Result<Vec<f64>, FilterError> {
        match self.cutoff_hz {
            Some(cutoff_hz) => low_pass(values, cutoff_hz, self.rate_hz),
            None => Ok(values.to_vec()),
        }
    }
}
