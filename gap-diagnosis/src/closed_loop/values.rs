//! What a fitted effect's numbers are, with their errors, and how large a residual is.

use std::collections::BTreeMap;

use gap_report::{BeforeAfter, Parameter};
use joint_twin::TwinError;
use joint_twin::observe::Channel;
use joint_twin::signal::random::uniform;
use nalgebra::{DMatrix, DVector};

use crate::closed_loop::search::{Model, Search, Term};
use crate::effects::numbers::{numbers, side};
use crate::evidence::INEXACT;
use crate::evidence::shares::DRAWS;

/// Mean square of a channel's residual, rows as they count.
pub fn mean_square(search: &Search<'_>, residual_nm: &[f64], channel: Channel) -> f64 {
    let rows = search.twin.rows.iter().enumerate();
    let (mut square, mut weights) = (0.0, 0.0);
    for (k, _) in rows.filter(|(_, row)| row.channel == channel) {
        let weight = search.whitener.weight(k).powi(2);
        square += weight * residual_nm[k].powi(2);
        weights += weight;
    }
    square / f64::max(weights, 1e-300)
}

/// Difference between recorded and re-simulated motor position, root mean square, joint side.
///
/// # Errors
/// [`TwinError`].
pub fn position_rms_rad(
    search: &Search<'_>,
    without: &Model,
    with: &Model,
) -> Result<BeforeAfter, TwinError> {
    let rms = |model: &Model| -> Result<f64, TwinError> {
        let (mut sum, mut count) = (0.0, 0.0);
        for (piece, stretch) in search.twin.stretches().into_iter().enumerate() {
            let trace = search
                .twin
                .controlled(piece, &model.changes(&search.scale))?;
            for (a, b) in stretch.drive.motor_rad.iter().zip(&trace.motor_rad) {
                sum += (a - b).powi(2);
                count += 1.0;
            }
        }
        Ok((sum / f64::max(count, 1.0)).sqrt())
    };
    let nominal = &search.twin.nominal;
    let step_rad = nominal.motor_resolution_rad / nominal.gear_ratio;
    let noise_rad = nominal.position_noise_rad / nominal.gear_ratio;
    Ok(BeforeAfter {
        before: rms(without)?,
        after: rms(with)?,
        // a rounded value is off by a twelfth of its step, squared
        noise_floor: (step_rad.powi(2) / 12.0 + noise_rad.powi(2)).sqrt(),
        held_out: false,
    })
}

/// Parameters of a term whose steps have this covariance, with their standard errors: values are drawn from it and written as the effect
/// writes them.
pub fn term_parameters(
    search: &Search<'_>,
    value: &Term,
    covariance: &DMatrix<f64>,
) -> (BTreeMap<String, Parameter>, Option<String>) {
    let scale = &search.scale;
    let effect = value.effect(scale);
    let count = covariance.nrows();
    let root = covariance.clone().cholesky().map_or_else(
        || DMatrix::from_diagonal(&covariance.diagonal().map(|v| v.max(0.0).sqrt())),
        |cholesky| cholesky.l(),
    );
    let mut random = uniform(7);
    let mut spread: BTreeMap<String, (f64, f64)> = BTreeMap::new();
    let told = numbers(&effect);
    for _ in 0..DRAWS {
        let normal = DVector::from_fn(count, |_, _| {
            // sum of twelve uniform numbers: as good as normal for a standard error
            (0..12).map(|_| random()).sum::<f64>() - 6.0
        });
        let drawn = search.stepped(value, (&root * normal).as_slice());
        for (name, x) in numbers(&drawn.effect(scale)) {
            let off = match told.get(&name) {
                Some(centre) if name.contains("phase") => wrapped(x - centre),
                Some(centre) => x - centre,
                None => continue,
            };
            let entry = spread.entry(name).or_default();
            entry.0 += off * off;
            entry.1 += 1.0;
        }
    }
    let at_bound = at_bound(search, value);
    let parameters = told
        .into_iter()
        .map(|(name, value)| {
            let (sum, count) = spread.get(&name).copied().unwrap_or_default();
            let scatter = (sum / f64::max(count, 1.0)).sqrt();
            let of_law = if is_size(&name) {
                INEXACT * (value - if name == "gain" { 1.0 } else { 0.0 }).abs()
            } else {
                0.0
            };
            let parameter = Parameter {
                value,
                std: scatter.hypot(of_law),
                at_bound,
            };
            (name, parameter)
        })
        .collect();
    (parameters, side(&effect))
}

/// Whether a parameter says how much, not where.
fn is_size(name: &str) -> bool {
    !(name.contains("phase") || name.contains("cycles") || name.contains("centre"))
}

fn wrapped(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

fn at_bound(search: &Search<'_>, term: &Term) -> bool {
    if !term.hypothesis.shape_is_free() {
        return false;
    }
    let [low, high] = term.hypothesis.shape_range(&search.scale);
    let shape = term.hypothesis.shape[0];
    shape <= low || shape >= high
}
