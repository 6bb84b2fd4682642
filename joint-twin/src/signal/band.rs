//! The bands in which motions and torques are looked at.

use joint_model::filter::FilterError;

use super::smooth::low_pass;

/// Above this nothing is compared, in hertz: torque sensors of arms are low-passed at 8 Hz and more (KUKA LWR4), and no arm is
/// moved faster on purpose. Between 4 and 15 Hz the names on three real arms stay.
pub const COMPARED_HZ: f64 = 8.0;

/// Motion above this is noise, in hertz: no joint of an arm is moved faster on purpose. Twice any band that is compared, so that what is
/// bent (friction's step at a reversal) is bent before it is band-limited.
pub const MOTION_HZ: f64 = 30.0;
/// Part of the sampling rate up to which a band goes where the rate is low: what a filter forwards and backwards leaves of half the rate
/// is nothing then.
const OF_RATE: f64 = 0.2;

/// A band's end at a sampling rate, both in hertz.
pub fn up_to(end_hz: f64, rate_hz: f64) -> f64 {
    end_hz.min(OF_RATE * rate_hz)
}

/// A low-pass without delay.
#[derive(Clone, Copy, Debug)]
pub struct Band {
    cutoff_hz: f64,
    rate_hz: f64,
}

impl Band {
    /// Up to a frequency, or as far as the rate goes.
    pub fn of(rate_hz: f64, end_hz: f64) -> Self {
        Self {
            cutoff_hz: up_to(end_hz, rate_hz),
            rate_hz,
        }
    }

    /// What lies in the band.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn limit(&self, values: &[f64]) -> Result<Vec<f64>, FilterError> {
        low_pass(values, self.cutoff_hz, self.rate_hz)
    }
}
