//! One model in both directions, with the numbers that models are compared by.

use joint_model::friction::Direction;
use serde::Serialize;

use super::speeds::Point;
use super::{DirectionFit, FrictionModel};

/// One model fitted to both directions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModelComparison {
    /// The model.
    pub model: FrictionModel,
    /// Motion along the joint's axis.
    pub positive: DirectionFit,
    /// Motion against it.
    pub negative: DirectionFit,
    /// Table I: mean of the two directions.
    pub weighted_residual_variance: f64,
    /// Table I: mean of the two directions.
    pub mse_per_dof: Option<f64>,
    /// Sum over the directions; the smaller the better.
    pub aicc: Option<f64>,
    /// Sum over the directions; the smaller the better.
    pub bic: f64,
    /// Each trial predicted by a fit to the others: root mean square error. None with a single trial.
    pub held_out_rms_nm: Option<f64>,
}

impl ModelComparison {
    /// Fits a model to both directions; none where the speeds of one cannot tell its parameters.
    pub(super) fn new(
        model: FrictionModel,
        positive: &[Point],
        negative: &[Point],
    ) -> Option<Self> {
        let errors = [held_out(model, positive), held_out(model, negative)];
        let a = DirectionFit::new(model, positive)?;
        let b = DirectionFit::new(model, negative)?;
        Some(Self {
            model,
            weighted_residual_variance: 0.5
                * (a.weighted_residual_variance + b.weighted_residual_variance),
            mse_per_dof: a.mse_per_dof.zip(b.mse_per_dof).map(|(a, b)| 0.5 * (a + b)),
            aicc: a.aicc.zip(b.aicc).map(|(a, b)| a + b),
            bic: a.bic + b.bic,
            held_out_rms_nm: root_mean_square(errors),
            positive: a,
            negative: b,
        })
    }

    /// The fit of one direction.
    #[must_use]
    pub fn direction(&self, direction: Direction) -> &DirectionFit {
        match direction {
            Direction::Positive => &self.positive,
            Direction::Negative => &self.negative,
        }
    }
}

/// Errors of each trial's levels by a fit to the other trials.
fn held_out(model: FrictionModel, points: &[Point]) -> Option<Vec<f64>> {
    let mut trials: Vec<usize> = points.iter().map(|point| point.trial).collect();
    trials.sort_unstable();
    trials.dedup();
    let mut errors_nm = Vec::new();
    for trial in trials {
        let (held, others): (Vec<Point>, Vec<Point>) =
            points.iter().partition(|point| point.trial == trial);
        let fit = DirectionFit::new(model, &others)?;
        errors_nm.extend(
            held.iter()
                .map(|p| p.level_nm - fit.level_nm(p.speed_rad_s)),
        );
    }
    Some(errors_nm)
}

fn root_mean_square(errors_nm: [Option<Vec<f64>>; 2]) -> Option<f64> {
    let [Some(positive), Some(negative)] = errors_nm else {
        return None;
    };
    let count = (positive.len() + negative.len()) as f64;
    let squares: f64 = positive
        .iter()
        .chain(&negative)
        .map(|error| error.powi(2))
        .sum();
    Some((squares / count).sqrt())
}
