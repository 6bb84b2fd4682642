//! What one check found: what is, what should be, what mends it, and what it costs to leave it.

use serde::Serialize;

/// How far something is from what the loop needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// As it should be.
    Good,
    /// The machine does not tell.
    Unknown,
    /// The loop works, with more jitter or less safety than there could be.
    Weak,
    /// The loop does not get what it asks for.
    Missing,
}

impl Verdict {
    /// For a line's beginning.
    pub fn label(self) -> &'static str {
        match self {
            Self::Good => "ok",
            Self::Unknown => "unknown",
            Self::Weak => "weak",
            Self::Missing => "missing",
        }
    }
}

/// One line of `flexspline doctor`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub about: &'static str,
    /// The judgement.
    pub verdict: Verdict,
    /// What is.
    pub is: String,
    /// What should be.
    pub wanted: String,
    /// The command, file or setting that mends it; none where nothing can.
    pub mend: Option<String>,
    /// What it costs not to.
    pub cost: &'static str,
}

/// What does not depend on the machine: what should be, what mends it, what it costs not to.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// What is looked at.
    pub about: &'static str,
    /// What should be.
    pub wanted: &'static str,
    /// What mends it.
    pub mend: &'static str,
    /// What it costs not to.
    pub cost: &'static str,
}

impl Rule {
    /// The finding that this is so.
    pub fn finds(&self, verdict: Verdict, is: impl Into<String>) -> Finding {
        Finding {
            about: self.about,
            verdict,
            is: is.into(),
            wanted: self.wanted.to_owned(),
            mend: Some(self.mend.to_owned()),
            cost: self.cost,
        }
    }

    /// As it should be, or else `otherwise`.
    pub fn finds_good_if(&self, good: bool, otherwise: Verdict, is: impl Into<String>) -> Finding {
        self.finds(if good { Verdict::Good } else { otherwise }, is)
    }

    /// The machine does not show `source`.
    pub fn finds_nothing(&self, source: &str) -> Finding {
        self.finds(Verdict::Unknown, format!("{source} cannot be read here"))
    }
}
