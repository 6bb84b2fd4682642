//! Position-dependent friction from slow motion: PA10-05, section IV-B2, eq (8), Table III, Fig. 5. Joint side.
//!
//! The torque that keeps a joint at 0.01 rad/s, less gravity, is friction over the motor angle. [`analyse_periodic`]
//! takes whole motor revolutions of it, removes mean and slow trend, and looks for harmonics: peaks of the Fourier
//! transform that noise alone would not show ([`FALSE_ALARM_PROBABILITY`]). What is fed forward is the mean over
//! revolutions, [`PeriodicAnalysis::friction_table`]: as in the paper a look-up table, which needs no harmonic to be
//! found, but over one motor revolution where the paper's runs over the range of the joint.
//!
//! Friction is written as a *level* throughout: positive opposes the motion in either direction, so one harmonic
//! `A·sin(k·θ_motor + φ)` stands for both, as in [`joint_model::friction::PeriodicFriction`].

mod analysis;
mod harmonics;
mod series;
mod spectrum;
mod table;
mod tones;

pub use analysis::{DirectionAnalysis, PeriodicAnalysis, analyse_periodic};
pub use harmonics::{HARMONICS_MAX, Harmonic};
pub use spectrum::{FALSE_ALARM_PROBABILITY, SpectralLine};
