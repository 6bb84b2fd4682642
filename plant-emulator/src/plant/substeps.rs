//! How many substeps a period needs: as many as current loop, bristles and the fastest torsional mode ask for.

use core::f64::consts::{PI, TAU};

use joint_model::JOINTS_MAX;
use joint_model::rigid_body::Chain;

use super::{Joint, mobility_rad_s2_nm};
use crate::PlantError;
use crate::inject::TimedEffect;
use crate::noise::{Noise, Purpose};

/// Longest substep: 1/12 kHz, at which bristles and current loop are resolved.
const STEP_MAX_S: f64 = 8.4e-5;

/// Largest phase of the fastest torsional mode in a substep. Semi-implicit Euler is stable below 2 and shifts a mode's
/// frequency by the square of the phase over 24: 1.5 % here.
const PHASE_MAX: f64 = 0.6;

/// The most substeps in a period, thirty times what the shipped robots need at 1.5 kHz.
const SUBSTEPS_MAX: usize = 300;

/// Poses besides the first at which the fastest mode is looked for.
const POSES: usize = 64;

/// Enough for the fastest torsional mode of any joint, at the start and at seeded poses all over the joints' turns.
pub(super) fn substeps(
    joints: &[Joint],
    chains: &[(f64, Chain)],
    start_rad: &[f64; JOINTS_MAX],
    seed: u64,
    period_s: f64,
) -> Result<usize, PlantError> {
    let mut substeps = (period_s / STEP_MAX_S).ceil() as usize;
    for (index, joint) in joints.iter().enumerate() {
        let mobility = mobility_max(chains, start_rad, seed, index);
        let inertia_kg_m2 = joint.constants.reflected_inertia_kg_m2(&joint.now);
        let stiffness_nm_rad = joint.stiffness_max_nm_rad();
        let mode_rad_s = (stiffness_nm_rad * (1.0 / inertia_kg_m2 + mobility)).sqrt();
        let needed = (period_s * mode_rad_s / PHASE_MAX).ceil() as usize;
        if needed > SUBSTEPS_MAX {
            return Err(PlantError::TooStiff {
                joint: index,
                frequency_hz: mode_rad_s / TAU,
                substeps: needed,
                at_most: SUBSTEPS_MAX,
            });
        }
        substeps = substeps.max(needed);
    }
    Ok(substeps)
}

impl Joint {
    /// The stiffest the gear gets during the run.
    fn stiffness_max_nm_rad(&self) -> f64 {
        let later = self.timed.iter().map(|timed| {
            let mut conditions = self.fixed.clone();
            let from_the_start = TimedEffect {
                start_s: 0.0,
                ..*timed
            };
            let added = conditions.add(&from_the_start, 0.0);
            debug_assert!(added.is_ok(), "room was checked when the plant was built");
            conditions.transmission.stiffness_max_nm_rad()
        });
        later.fold(self.fixed.transmission.stiffness_max_nm_rad(), f64::max)
    }
}

fn mobility_max(
    chains: &[(f64, Chain)],
    start_rad: &[f64; JOINTS_MAX],
    seed: u64,
    joint: usize,
) -> f64 {
    let mut noise = Noise::new(seed, Purpose::Poses, joint);
    let anywhere = core::iter::repeat_with(|| core::array::from_fn(|_| TAU * noise.uniform() - PI));
    let poses: Vec<[f64; JOINTS_MAX]> = core::iter::once(*start_rad)
        .chain(anywhere.take(POSES))
        .collect();
    chains
        .iter()
        .flat_map(|(_, chain)| {
            poses
                .iter()
                .map(|pose| mobility_rad_s2_nm(chain, pose, joint))
        })
        .fold(0.0, f64::max)
}
