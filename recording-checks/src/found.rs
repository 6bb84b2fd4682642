//! An effect that is read off the samples, without a twin.

use robot::Effect;

/// Standard errors that a finding is away from nothing. Samples are not as independent and noise not as normal as the errors are made
/// for: five would do where they were, and one of a hundred joints has a finding by chance then.
pub(crate) const SURE: f64 = 7.0;
/// The same in nats of likelihood.
pub fn sure_nats() -> f64 {
    0.5 * SURE * SURE
}
/// Losses below this part are a recorder's hiccup.
pub(crate) const LOST_MIN: f64 = 0.002;

/// An effect found in samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// With the value found.
    pub effect: Effect,
    /// Standard error of that value.
    pub std: f64,
    /// The count or measurement that decided, in one sentence.
    pub because: String,
}
