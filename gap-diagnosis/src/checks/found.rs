//! An effect that is read off the samples, without a twin.

use robot::Effect;

/// Fewer rows than this tell nothing.
pub(crate) const ROWS_MIN: usize = 200;

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
