//! What is true about a case: the answer that stays sealed until predictions are written.

use std::collections::BTreeMap;

use robot::Effect;
use robot::Stage;
use serde::{Deserialize, Serialize};

use crate::rig::RigKind;
use crate::unlisted::Unlisted;

/// What kind of answer a case has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CaseKind {
    /// Nothing but tolerance and noise.
    NoGap,
    /// One effect of the list.
    OneEffect,
    /// Two effects of the list.
    TwoEffects,
    /// A law on no list.
    Unknown,
    /// An effect that this motion cannot tell from another.
    Pair,
}

impl CaseKind {
    /// All kinds.
    pub const ALL: [Self; 5] = [
        Self::NoGap,
        Self::OneEffect,
        Self::TwoEffects,
        Self::Unknown,
        Self::Pair,
    ];
}

/// The truth about one case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Label {
    /// Name of the case's folder.
    pub case: String,
    /// What kind of answer it has.
    pub kind: CaseKind,
    /// What kind of robot it is about.
    pub rig: RigKind,
    /// Gap over noise that was asked for; 0 without a gap. What was reached stands with each effect.
    pub level: f64,
    /// Effects of the list.
    pub effects: Vec<TrueEffect>,
    /// The law on no list.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unlisted: Option<TrueUnlisted>,
    /// Effects that this motion cannot tell apart, the true one first; empty where it can.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pair: Vec<String>,
    /// Per joint: rms of the disturbance torque between this plant without effects and the exact nominal one, 0 to 15 Hz,
    /// joint side.
    pub noise_nm: Vec<f64>,
    /// SHA-256 of the case's files, by name.
    pub files: BTreeMap<String, String>,
}

/// One effect that was in the plant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueEffect {
    /// None where it acts on the whole arm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// What it was, as a change against the robot file.
    pub effect: Effect,
    /// Stage it belongs to.
    pub stage: Stage,
    /// Rms of the disturbance torque between the runs with and without it, over the noise, at the joint where that is
    /// largest.
    pub gap_to_noise: f64,
    /// Names that are as right as its own, because no recording of such a rig can tell them apart.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub equivalents: Vec<String>,
}

/// A law on no list that was in the plant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueUnlisted {
    /// The joint on whose link it acted.
    pub joint: String,
    /// What it was.
    pub law: Unlisted,
    /// How strong, joint side.
    pub nm: f64,
    /// As that of [`TrueEffect`].
    pub gap_to_noise: f64,
    /// Part of its square that an effect of the list has in common with it on this motion, by name; none where that is nothing.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub in_common: BTreeMap<String, f64>,
}

impl TrueUnlisted {
    /// Part of it that a name may take.
    pub fn in_common(&self, name: &str) -> f64 {
        self.in_common.get(name).copied().unwrap_or(0.0)
    }
}
