//! What can be typed after `flexspline gap blind`.

use std::path::PathBuf;
use std::time::Duration;

use ::blind::CaseKind;
use clap::{Args, Subcommand, ValueEnum};

use super::GapEngine;

/// `flexspline gap blind`
#[derive(Debug, Subcommand)]
#[command(after_help = "\
Examples:
  flexspline gap blind make --out cases --cases 200 --seed 7
  flexspline gap blind run --cases cases --out predictions
  flexspline gap blind score --cases cases --predictions predictions --report scores.html

Cases are made by the emulated plant, labels put away in labels.sealed before anybody predicts; seal.json holds a salted
SHA-256 of each.
Exit code: 0 done, 2 bad input.")]
pub enum BlindCommand {
    /// Make cases and seal their labels
    Make(BlindMakeArguments),
    /// Diagnose cases from robot file and recording alone
    Run(BlindRunArguments),
    /// Open the seal and score predictions
    Score(BlindScoreArguments),
}

/// `flexspline gap blind run`
#[derive(Debug, Args)]
pub struct BlindRunArguments {
    /// Folder of cases
    #[arg(long, value_name = "DIR")]
    pub cases: PathBuf,
    /// Folder for the predictions; cases that have one there are not diagnosed again
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Predict by a simpler method instead, for comparison
    #[arg(long, value_enum, value_name = "METHOD")]
    pub baseline: Option<BaselineMethod>,
    /// What to hold the recordings against, as `gap diagnose` has it
    #[arg(long, value_name = "NAME", conflicts_with = "baseline")]
    pub engine: Option<GapEngine>,
    /// Where to write what was done as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// A simpler method than the diagnosis.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum BaselineMethod {
    /// The effect whose response alone explains most of the residual
    LargestR2,
    /// The effect with the smallest Bayesian information criterion, samples taken for independent
    Bic,
}

/// `flexspline gap blind score`
#[derive(Debug, Args)]
pub struct BlindScoreArguments {
    /// Folder of cases, with seal.json and labels.sealed
    #[arg(long, value_name = "DIR")]
    pub cases: PathBuf,
    /// Folder of predictions: CASE/report.json
    #[arg(long, value_name = "DIR")]
    pub predictions: PathBuf,
    /// Folder of predictions to stand beside them; may be given again
    #[arg(long, value_name = "DIR")]
    pub baseline: Vec<PathBuf>,
    /// Fit the true effects of each case as well, to hold the shrink against; takes as long as the diagnosis
    #[arg(long)]
    pub oracle: bool,
    /// Page to write, with figures
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Where to write the scores as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

/// `flexspline gap blind make`
#[derive(Debug, Args)]
pub struct BlindMakeArguments {
    /// Folder for the cases; a new one
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// How many cases
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub cases: u32,
    /// Makes the same cases again
    #[arg(long, value_name = "N")]
    pub seed: u64,
    /// Only cases of this kind; the mix of all if not given
    #[arg(long, value_enum, value_name = "KIND")]
    pub kind: Option<CaseKindArgument>,
    /// Share of cases about the seven-joint arm, 0 to 1; the others are one-joint benches
    #[arg(long, default_value_t = 0.25, value_name = "SHARE", value_parser = share)]
    pub seven_joints: f64,
    /// Length of each recording
    #[arg(long, default_value = "30s", value_name = "D", value_parser = humantime::parse_duration)]
    pub duration: Duration,
    /// Cases made at a time; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    /// Where to write what was made as JSON; - for standard output
    #[arg(long, value_name = "PATH")]
    pub json: Option<PathBuf>,
}

fn share(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|share| (0.0..=1.0).contains(share))
        .ok_or_else(|| "must be between 0 and 1".to_owned())
}

/// See [`CaseKind`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum CaseKindArgument {
    /// Nothing but tolerance and noise
    NoGap,
    /// One effect of the list
    OneEffect,
    /// Two effects of the list
    TwoEffects,
    /// A law on no list
    Unknown,
    /// An effect that the motion cannot tell from another
    Pair,
}

impl From<CaseKindArgument> for CaseKind {
    fn from(argument: CaseKindArgument) -> Self {
        match argument {
            CaseKindArgument::NoGap => Self::NoGap,
            CaseKindArgument::OneEffect => Self::OneEffect,
            CaseKindArgument::TwoEffects => Self::TwoEffects,
            CaseKindArgument::Unknown => Self::Unknown,
            CaseKindArgument::Pair => Self::Pair,
        }
    }
}
