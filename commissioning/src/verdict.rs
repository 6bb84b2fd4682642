//! What a step comes to.

use serde::{Deserialize, Serialize};

/// One line for people, and the number that decided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What was seen, and what to change where that will not do.
    pub told: String,
    /// The number.
    pub value: f64,
    /// What it was held against.
    pub limit: f64,
    /// Of both.
    pub unit: String,
}

impl Finding {
    /// A number, what it was held against, and a line that says so.
    pub fn new(value: f64, limit: f64, unit: &str, told: impl Into<String>) -> Self {
        Self {
            told: told.into(),
            value,
            limit,
            unit: unit.to_owned(),
        }
    }
}

/// Where a step stands.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// Not decided yet.
    Waiting,
    /// It may go on.
    Passed(Finding),
    /// It may not.
    Refused(Finding),
    /// The loop has stopped for safety; its report says why.
    Stopped,
}
