//! How many regions the data support, and the law with its standard errors.
//!
//! Residuals of successive samples are alike (unmodelled ripple, slow drift), so `n` samples count as `n/τ`, with τ from
//! the residual of the law with most regions. Noise variance is `Σr²/n · n_τ/(n_τ - p)` with `n_τ = n/τ`, standard errors
//! are those of the linearised fit times `√τ`, and the criterion is `BIC = n_τ·ln(Σr²/n) + p·ln n_τ` with `p = 2·regions`
//! parameters, knees included.

use super::hinges::{HingeFit, Samples};
use super::{Candidate, Knee, LoadTorqueFit, SweepSteps};
use crate::Estimate;
use crate::statistics::{correlated_samples, root_mean_square};

/// A slope known worse than this, in Nm per Nm, does not tell the regions of Table V apart: they differ by 1.7 and more.
const WIDEST_SLOPE_ERROR: f64 = 0.25;

/// Residuals below this share of the torque's own variation are rounding.
const ROUNDING: f64 = 1e-12;

/// Why there is no law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NoLaw {
    /// So many samples count, and so many are needed.
    TooFew { found: f64, needed: f64 },
    /// Gravity torque varies by so much, and must vary by so much.
    SmallRange { found_nm: f64, needed_nm: f64 },
}

/// Fits one to three regions to all steps of one direction and keeps what the data support.
pub(super) fn fit_law(steps: &[SweepSteps]) -> Result<LoadTorqueFit, NoLaw> {
    let gathered = |column: fn(&SweepSteps) -> &[f64]| -> Vec<f64> {
        let above_floor = |steps| {
            let values = column(steps).iter().zip(&steps.on_floor);
            values.filter_map(|(value, on_floor)| (!on_floor).then_some(*value))
        };
        steps.iter().flat_map(above_floor).collect()
    };
    let samples_on_floor = steps.iter().flat_map(|steps| &steps.on_floor);
    let samples_on_floor = samples_on_floor.filter(|on_floor| **on_floor).count();
    let gravity_nm = gathered(|steps| &steps.gravity_nm);
    let torque_nm = gathered(|steps| &steps.load_torque_nm);
    let mean_nm = torque_nm.iter().sum::<f64>() / torque_nm.len().max(1) as f64;
    let about_mean: Vec<f64> = torque_nm.iter().map(|nm| nm - mean_nm).collect();
    let Some(samples) = Samples::new(&gravity_nm, &torque_nm) else {
        let needed_nm = needed_range_nm(&about_mean);
        return Err(NoLaw::SmallRange {
            found_nm: 0.0,
            needed_nm,
        });
    };
    let fits: Vec<HingeFit> = (1..=3).filter_map(|regions| samples.fit(regions)).collect();
    let residual = |fit: &HingeFit| -> Vec<f64> {
        let pairs = gravity_nm.iter().zip(&torque_nm);
        pairs
            .map(|(gravity_nm, nm)| nm - fit.value(*gravity_nm))
            .collect()
    };
    let finest = fits.last().map_or(about_mean, residual);
    check_range(&samples, &finest)?;
    Ok(LoadTorqueFit {
        samples_on_floor,
        ..choose(&samples, &fits, correlated_samples(&finest))?
    })
}

/// Range of evenly spread gravity torques over which a line through this scatter has the widest slope error allowed:
/// `√12·σ·√(τ/n)` over that error.
fn needed_range_nm(residual_nm: &[f64]) -> f64 {
    let counted = residual_nm.len() as f64 / correlated_samples(residual_nm);
    let scatter_nm = root_mean_square(residual_nm.iter().copied());
    (12.0 / counted).sqrt() * scatter_nm / WIDEST_SLOPE_ERROR
}

fn check_range(samples: &Samples, residual_nm: &[f64]) -> Result<(), NoLaw> {
    let [low_nm, high_nm] = samples.range();
    let (found_nm, needed_nm) = (high_nm - low_nm, needed_range_nm(residual_nm));
    if found_nm >= needed_nm {
        return Ok(());
    }
    Err(NoLaw::SmallRange {
        found_nm,
        needed_nm,
    })
}

fn choose(samples: &Samples, fits: &[HingeFit], correlated: f64) -> Result<LoadTorqueFit, NoLaw> {
    let count = samples.count() as f64;
    let counted = count / correlated;
    let floor = ROUNDING * samples.squares_about_mean().max(f64::MIN_POSITIVE);
    let possible = fits
        .iter()
        .filter(|fit| counted > (fit.parameters() + 1) as f64);
    let ranked: Vec<(&HingeFit, Candidate)> = possible
        .map(|fit| {
            let mean_square = fit.squares.max(floor) / count;
            let candidate = Candidate {
                regions: fit.regions(),
                residual_rms_nm: (fit.squares / count).sqrt(),
                bic: counted * mean_square.ln() + fit.parameters() as f64 * counted.ln(),
            };
            (fit, candidate)
        })
        .collect();
    let best = ranked.iter().min_by(|a, b| a.1.bic.total_cmp(&b.1.bic));
    let Some((fit, _)) = best else {
        return Err(NoLaw::TooFew {
            found: counted,
            needed: 4.0,
        });
    };
    Ok(LoadTorqueFit {
        candidates: ranked.iter().map(|(_, candidate)| *candidate).collect(),
        ..law(samples, fit, correlated)
    })
}

fn law(samples: &Samples, fit: &HingeFit, correlated: f64) -> LoadTorqueFit {
    let count = samples.count() as f64;
    let counted = count / correlated;
    let noise = fit.squares / count * counted / (counted - fit.parameters() as f64);
    let estimate = |(value, variance): (f64, f64)| Estimate {
        value,
        standard_error: (noise * correlated * variance).sqrt(),
    };
    let gravity_range_nm = samples.range();
    let knees = fit.knees().into_iter().zip(&fit.at_bound);
    LoadTorqueFit {
        slopes: fit.slopes().into_iter().map(estimate).collect(),
        knees: knees
            .map(|(knee, at_bound)| Knee {
                gravity_nm: estimate(knee),
                at_bound: *at_bound,
            })
            .collect(),
        zero_load_nm: estimate((fit.value(0.0), fit.value_variance(0.0))),
        zero_load_extrapolated: gravity_range_nm[0] > 0.0 || gravity_range_nm[1] < 0.0,
        gravity_range_nm,
        residual_rms_nm: (fit.squares / count).sqrt(),
        samples: samples.count(),
        samples_on_floor: 0,
        correlated_samples: correlated,
        candidates: Vec::new(),
    }
}
