//! The gap report: where the simulation parts from the robot, which effect causes it, how far the gap shrinks once it is
//! added. Field names are fixed; other tools read them.
//!
//! Shares are of the gap's energy above the noise floor. SI units, joint side unless a name says motor.
#![forbid(unsafe_code)]

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

use robot::{EffectKind, Stage};

/// The only version there is.
pub const SCHEMA: u32 = 2;

/// A whole report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Name of the robot file's robot.
    pub robot: String,
    /// File names.
    pub recordings: Vec<String>,
    /// Rows of all recordings.
    pub samples: usize,
    /// Length of all recordings.
    pub seconds: f64,
    /// Of the first recording.
    pub sample_rate_hz: f64,
    /// How the twin was driven.
    pub twin: TwinKind,
    /// Wall-clock time of the diagnosis.
    pub compute_seconds: f64,
    /// Effects with one cause seen by several joints.
    pub shared_effects: Vec<SharedEffect>,
    /// In the robot file's order.
    pub joints: Vec<JointReport>,
    /// By what the links' values differ from the file's: where they are wrong by more than their tolerance, and joints have it under the name
    /// of what it does to them, or where within it they take more of a joint's torque than is left.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<LinkChange>,
    /// What was wrong or missing in the data, worst first, in sentences.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub data: Vec<DataFinding>,
}

/// How the twin was driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TwinKind {
    /// By the robot file's controller.
    ClosedLoop,
    /// By gains of the diagnosis' own, which keep it on the recorded motion.
    FollowsMotion,
    /// By the recorded torque alone.
    OpenLoop,
}

/// Something found in the data before anything was computed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DataFinding {
    /// The joint, unless it concerns all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// `note`, `warning` or `error`.
    pub severity: String,
    /// What it is, with the number that decided it.
    pub what: String,
    /// What to change; empty where there is nothing to change.
    pub remedy: String,
}

fn is_false(value: &bool) -> bool {
    !value
}

impl fmt::Display for DataFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(joint) = &self.joint {
            write!(f, "{joint}: ")?;
        }
        f.write_str(&self.what)?;
        match self.remedy.as_str() {
            "" => Ok(()),
            remedy => write!(f, "; {remedy}"),
        }
    }
}

impl DataFinding {
    /// Orders them, worst first.
    pub fn rank(&self) -> usize {
        let worst_first = ["error", "warning", "note"];
        let rank = worst_first.iter().position(|word| *word == self.severity);
        rank.unwrap_or(worst_first.len())
    }
}

/// What is said of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing beyond noise and the tolerance of the robot file's own values.
    NoGap,
    /// The effects bring the gap to the noise floor.
    Explained,
    /// The effects shrink the gap, but structure remains.
    PartlyExplained,
    /// A gap, and no candidate accounts for it.
    Unexplained,
    /// Two or more explanations that this data cannot tell apart.
    Ambiguous,
    /// The data supports no statement; the reason says why.
    InsufficientData,
}

/// A fitted parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// The change against the robot file, except where the file has no such effect.
    pub value: f64,
    /// Standard error.
    pub std: f64,
    /// Whether the value ended at a limit of what was searched: a finding, not a value.
    pub at_bound: bool,
}

/// By what a link's values differ from the file's. Torques tell sums of several links' values alone: other links may be wrong instead.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkChange {
    /// The joint that moves it.
    pub joint: String,
    /// More than the file's.
    pub mass_kg: Parameter,
    /// More than the file's, along the link's axes.
    pub centre_of_mass_m: [Parameter; 3],
    /// About the centre of mass: more than the file's, as a part of it.
    pub inertia_part: Parameter,
}

/// An effect that is named.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NamedEffect {
    /// Identifier.
    pub effect: String,
    /// Calibrated: of the statements made with 0.9, nine in ten are right.
    pub probability: f64,
    /// By the names of the effect's parameters.
    pub parameters: BTreeMap<String, Parameter>,
    /// Which encoder, where the effect has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub side: Option<String>,
    /// Part of the gap's energy, held out and above the noise floor, that the effect takes off, averaged over the orders in which the
    /// named effects can be added (Shapley); of a shared effect its mean over the joints.
    #[serde(default)]
    pub share: f64,
    /// Lower end of its 95 % interval.
    #[serde(default)]
    pub share_low: f64,
    /// Upper end of its 95 % interval.
    #[serde(default)]
    pub share_high: f64,
    /// Shrink with this effect only.
    pub shrink_alone: f64,
    /// Whether it is what the report's `links` do to the joint: no effect of its own to add to a file.
    #[serde(default, skip_serializing_if = "is_false")]
    pub of_links: bool,
}

/// An effect with one cause seen by several joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SharedEffect {
    /// The effect.
    #[serde(flatten)]
    pub effect: NamedEffect,
    /// Who sees it.
    pub joints: Vec<String>,
    /// What it takes off each of these joints' gaps.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub joint_shares: BTreeMap<String, JointShare>,
}

/// A share with its 95 % interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointShare {
    /// Of the joint's gap.
    pub share: f64,
    /// Lower end.
    pub share_low: f64,
    /// Upper end.
    pub share_high: f64,
}

/// An effect, `none` or `unknown`, with its probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Identifier, `none` or `unknown`.
    pub effect: String,
    /// All of a joint's sum to 1.
    pub probability: f64,
}

/// Explanations that this data cannot tell apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Confusable {
    /// Two identifiers.
    pub effects: [String; 2],
    /// `d²`: how far, in noise units, the one is from being imitated by the other; below 9 nobody can tell them apart.
    pub distance: f64,
    /// Why.
    pub reason: String,
}

/// A signal's gap.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SignalGap {
    /// Name of the recording's signal.
    pub signal: String,
    /// Root mean square of the gap over that of the noise floor.
    pub gap_to_noise: f64,
}

/// A range of a variable in which a part of the gap lies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Regime {
    /// `position_rad`, `motor_velocity_rad_s`, `load_nm`, `motor_phase_rad` or `time_s`.
    pub variable: String,
    /// Lower end.
    pub from: f64,
    /// Upper end.
    pub to: f64,
    /// Of the gap's energy above the noise floor.
    pub share: f64,
}

/// A band of frequencies in which a part of the gap lies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BandShare {
    /// Lower end.
    pub from_hz: f64,
    /// Upper end.
    pub to_hz: f64,
    /// Of the gap's energy above the noise floor.
    pub share: f64,
}

/// Where a joint's gap lies.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Where {
    /// The stage it comes from; none without a gap.
    pub stage: Option<Stage>,
    /// How probable each stage is.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub stages: BTreeMap<Stage, f64>,
    /// Largest first.
    pub signals: Vec<SignalGap>,
    /// By variable, then by range.
    pub regimes: Vec<Regime>,
    /// By frequency.
    pub bands: Vec<BandShare>,
}

/// A size before and after the effects are added, and what noise alone would leave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BeforeAfter {
    /// Of the robot file as it is.
    pub before: f64,
    /// With the effects.
    pub after: f64,
    /// Of noise and of the twin itself.
    pub noise_floor: f64,
    /// Whether it was judged on data that was not fitted to.
    pub held_out: bool,
}

/// How far a joint's gap shrinks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Root mean square of the disturbance torque that nobody explains.
    pub torque_rms_nm: BeforeAfter,
    /// Root mean square of the difference between recorded and re-simulated motor position, joint side.
    pub position_rms_rad: BeforeAfter,
    /// `1 - (V_after - V_noise)/(V_before - V_noise)`, V the mean square of the torque on held-out data.
    pub shrink: f64,
    /// Lower end of its 95 % interval.
    pub shrink_low: f64,
    /// Upper end of its 95 % interval.
    pub shrink_high: f64,
}

/// What is left once the effects are added.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Remaining {
    /// Nothing that a model could use.
    White,
    /// Something that depends on motion, load or time.
    Structured,
}

/// One joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointReport {
    /// Name in the robot file.
    pub joint: String,
    /// In a word.
    pub verdict: Verdict,
    /// In a sentence, with the numbers that decided.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub reason: String,
    /// What is named, largest share first.
    pub effects: Vec<NamedEffect>,
    /// Named too, of so small a share that it does not matter: never in the headline, the stage or the verdict.
    #[serde(default)]
    pub minor_effects: Vec<NamedEffect>,
    /// All that was tried, with `none` and `unknown`; most probable first.
    pub candidates: Vec<Candidate>,
    /// Nearest first.
    pub confusable: Vec<Confusable>,
    /// Where it lies.
    #[serde(rename = "where")]
    pub place: Where,
    /// How far it shrinks.
    pub gap: Gap,
    /// What is left.
    pub remaining: Remaining,
    /// Its share of the gap; with those of the effects it adds up to 1.
    #[serde(default)]
    pub remaining_share: f64,
    /// What it depends on, largest share first.
    #[serde(default)]
    pub remaining_over: Vec<RemainsOver>,
    /// What was taken for its torque, where that is one signal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque: Option<JointTorque>,
    /// Where other friction is named too, or more is taken of these two than the file has: what a file can hold that says Coulomb and viscous
    /// friction only, and none below zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plain_friction: Option<PlainFriction>,
}

/// Coulomb and viscous friction in the place of all that is named of friction, the other names beside them; as changes against the file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlainFriction {
    /// Joint side.
    pub coulomb_nm: f64,
    /// Joint side.
    pub viscous_nm_s_rad: f64,
    /// What they leave, held out.
    pub torque_rms_nm: f64,
}

/// What was taken for a joint's torque.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointTorque {
    /// Where it is from.
    pub source: TorqueSource,
    /// So many times as large as recorded: another than 1 is another unit.
    pub unit: f64,
    /// Torques of effects and rest are in newton metres as recorded; the motor's are so many times as much, by the torque constants of
    /// file and report.
    pub motor_per_recorded: f64,
}

/// Where a joint's torque is taken from, the best there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TorqueSource {
    /// `motor_torque_nm`: what the drive reports.
    Drive,
    /// `command_torque_nm`: what the drive was asked for.
    Command,
    /// `joint_torque_nm`: a sensor behind the gear. It does not feel the rotor; `torque_offset` and `torque_constant_error` are its own.
    Sensor,
    /// What the robot file's controller makes of reference and position.
    Controller,
}

impl TorqueSource {
    /// The recording's name of it.
    pub fn signal_name(self) -> &'static str {
        match self {
            Self::Drive => "motor_torque_nm",
            Self::Command => "command_torque_nm",
            Self::Sensor => "joint_torque_nm",
            Self::Controller => "reference_position_rad",
        }
    }
}

/// What the rest depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Remains {
    /// Joint angle.
    Position,
    /// Joint velocity.
    Velocity,
    /// Torque that the gear carries.
    Load,
    /// Time since the recording began.
    Time,
    /// Time since the direction changed.
    SinceReversal,
    /// Angle of the motor within a turn.
    MotorPhase,
    /// Velocity and acceleration of the other joints.
    OtherJoints,
}

/// A variable over which a part of the rest lies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RemainsOver {
    /// The variable.
    pub over: Remains,
    /// Of the gap's energy, held out.
    pub share: f64,
    /// Corners of a straight line through the rest, in the variable's unit; empty where it is no function of one number.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub at: Vec<f64>,
    /// Torque at each corner.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub torque_nm: Vec<f64>,
}

/// Why a report cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// Not a report.
    #[error("this is no gap report: {0}")]
    Json(#[from] serde_json::Error),
    /// From another version.
    #[error("the report has schema {found}; this program reads schema {SCHEMA}")]
    Schema {
        /// Its schema.
        found: u32,
    },
    /// A number that cannot be.
    #[error("joint `{joint}`: {what} is {value}, which it cannot be")]
    Value {
        /// Where.
        joint: String,
        /// What.
        what: String,
        /// The number.
        value: f64,
    },
}

impl Report {
    /// Reads a report that somebody else may have written.
    ///
    /// # Errors
    /// [`ReportError`].
    pub fn from_json(text: &str) -> Result<Self, ReportError> {
        let report: Self = serde_json::from_str(text)?;
        if report.schema != SCHEMA {
            return Err(ReportError::Schema {
                found: report.schema,
            });
        }
        for joint in &report.joints {
            joint.check(report.shared_share(&joint.joint))?;
        }
        Ok(report)
    }

    /// What effects that several joints have take off this one's gap.
    fn shared_share(&self, joint: &str) -> f64 {
        let shared = self.shared_effects.iter();
        shared
            .filter_map(|shared| Some(shared.joint_shares.get(joint)?.share))
            .sum()
    }
}

/// What a torque sensor behind the gear may be wrong by: called as if they were the motor's.
const OF_SENSOR: [EffectKind; 2] = [EffectKind::TorqueOffset, EffectKind::TorqueConstantError];
/// Shares of a joint add up to 1 within this: a report may have been written with three digits of each.
const SHARES_WITHIN: f64 = 0.01;

impl JointReport {
    /// Effects that are named, minor ones too.
    pub fn named(&self) -> impl Iterator<Item = &NamedEffect> {
        self.effects.iter().chain(&self.minor_effects)
    }

    /// Whether an effect that is named of it is its torque sensor's.
    pub fn is_of_sensor(&self, effect: &str) -> bool {
        let is_by_sensor = self
            .torque
            .is_some_and(|torque| torque.source == TorqueSource::Sensor);
        is_by_sensor && OF_SENSOR.iter().any(|kind| kind.name() == effect)
    }

    /// What a newton metre of its effects is of the motor's.
    pub fn motor_per_recorded(&self) -> f64 {
        self.torque.map_or(1.0, |torque| torque.motor_per_recorded)
    }

    /// `shared_share`: what effects that several joints have take.
    fn check(&self, shared_share: f64) -> Result<(), ReportError> {
        let wrong = |what: String, value: f64| ReportError::Value {
            joint: self.joint.clone(),
            what,
            value,
        };
        let named = self.named().map(|e| (&e.effect, e.probability));
        let tried = self.candidates.iter().map(|c| (&c.effect, c.probability));
        for (effect, probability) in named.chain(tried) {
            if !(0.0..=1.0).contains(&probability) {
                return Err(wrong(format!("the probability of {effect}"), probability));
            }
        }
        for effect in self.named() {
            for (name, parameter) in &effect.parameters {
                if !parameter.value.is_finite() {
                    return Err(wrong(
                        format!("{name} of {}", effect.effect),
                        parameter.value,
                    ));
                }
            }
        }
        if let Some(JointTorque {
            unit,
            motor_per_recorded,
            ..
        }) = self.torque
        {
            for (what, factor) in [("unit", unit), ("motor_per_recorded", motor_per_recorded)] {
                if !(factor.is_finite() && factor > 0.0) {
                    return Err(wrong(format!("{what} of its torque"), factor));
                }
            }
        }
        self.check_shares(shared_share, wrong)
    }

    /// Finite, and together all of the gap where shares are told at all.
    fn check_shares(
        &self,
        shared_share: f64,
        wrong: impl Fn(String, f64) -> ReportError,
    ) -> Result<(), ReportError> {
        let of_effects = self.named().flat_map(|effect| {
            let interval = [effect.share, effect.share_low, effect.share_high];
            interval.map(|share| (effect.effect.as_str(), share))
        });
        let others = [
            ("what remains", self.remaining_share),
            ("what several joints share", shared_share),
        ];
        for (what, share) in of_effects.chain(others) {
            if !share.is_finite() {
                return Err(wrong(format!("the share of {what}"), share));
            }
        }
        for rest in &self.remaining_over {
            let corners = rest.at.iter().chain(&rest.torque_nm);
            let mut numbers = corners.chain([&rest.share]);
            if let Some(number) = numbers.find(|number| !number.is_finite()) {
                return Err(wrong("a number of what remains".to_owned(), *number));
            }
            if rest.at.len() != rest.torque_nm.len() {
                let corners = rest.torque_nm.len() as f64;
                return Err(wrong(
                    "the number of torques at corners".to_owned(),
                    corners,
                ));
            }
        }
        let named: f64 = self.named().map(|effect| effect.share).sum();
        let sum = named + self.remaining_share + shared_share;
        let is_told = self.remaining_share != 0.0 || self.named().any(|e| e.share != 0.0);
        if is_told && (sum - 1.0).abs() > SHARES_WITHIN {
            return Err(wrong("the sum of all shares".to_owned(), sum));
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn effect(name: &str, share: f64) -> Value {
        json!({ "effect": name, "probability": 0.9, "parameters": {}, "share": share, "shrink_alone": 0.5 })
    }

    /// A report whose joint has a large and a minor effect and a rest; with the change it is read.
    fn read(change: impl Fn(&mut Value)) -> Result<Report, String> {
        let mut report = json!({
            "schema": 2, "robot": "bench", "recordings": [], "samples": 1, "seconds": 1.0, "sample_rate_hz": 500.0,
            "twin": "follows_motion", "compute_seconds": 1.0, "shared_effects": [],
            "joints": [{
                "joint": "elbow", "verdict": "explained", "candidates": [], "confusable": [],
                "effects": [effect("coulomb_friction", 0.9)], "minor_effects": [effect("torque_offset", 0.01)],
                "where": { "stage": null, "signals": [], "regimes": [], "bands": [] },
                "gap": {
                    "torque_rms_nm": { "before": 1.0, "after": 0.1, "noise_floor": 0.1, "held_out": true },
                    "position_rms_rad": { "before": 0.0, "after": 0.0, "noise_floor": 0.0, "held_out": false },
                    "shrink": 0.9, "shrink_low": 0.8, "shrink_high": 0.95
                },
                "remaining": "structured", "remaining_share": 0.09,
                "remaining_over": [{ "over": "position", "share": 0.05, "at": [0.0, 1.0], "torque_nm": [0.1, 0.2] }]
            }]
        });
        change(&mut report);
        Report::from_json(&report.to_string()).map_err(|error| error.to_string())
    }

    #[test]
    fn shares_that_add_up_are_read() {
        assert!(read(|_| ()).is_ok());
        let shared = |report: &mut Value| {
            report["joints"][0]["remaining_share"] = json!(0.02);
            let mut payload = effect("payload", 0.07);
            payload["joints"] = json!(["elbow", "wrist"]);
            payload["joint_shares"] =
                json!({ "elbow": { "share": 0.07, "share_low": 0.0, "share_high": 0.1 } });
            report["shared_effects"] = json!([payload]);
        };
        assert!(read(shared).is_ok());
    }

    #[test]
    fn shares_that_do_not_are_refused_with_the_joint_and_the_sum() {
        let refused = read(|report| report["joints"][0]["remaining_share"] = json!(0.5));
        let refused = refused.unwrap_err();
        assert!(
            refused.contains("`elbow`: the sum of all shares is 1.41"),
            "{refused}"
        );
    }

    #[test]
    fn a_report_without_shares_is_read() {
        let none = |report: &mut Value| {
            let joint = &mut report["joints"][0];
            joint["remaining_share"] = json!(0.0);
            joint["effects"][0]["share"] = json!(0.0);
            joint["minor_effects"][0]["share"] = json!(0.0);
        };
        assert!(read(none).is_ok());
    }

    #[test]
    fn minor_effects_are_looked_at_too() {
        let refused = read(|report| {
            report["joints"][0]["minor_effects"][0]["probability"] = json!(1.5);
        });
        assert!(refused.unwrap_err().contains("torque_offset is 1.5"));
        let refused = read(|report| {
            report["joints"][0]["remaining_over"][0]["torque_nm"] = json!([0.1]);
        });
        assert!(refused.unwrap_err().contains("torques at corners is 1"));
    }
}
