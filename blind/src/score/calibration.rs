//! Whether statements made with a probability are right as often as they say.

use serde::Serialize;

use super::judge::Statement;
use super::rate::{Rate, mean};

/// Bins of equal width over the probabilities.
const BINS: usize = 10;

/// How good the probabilities are.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// Mean of Brier's score over all answers of a case, 0 (best) to 2.
    pub brier: Option<f64>,
    /// Mean distance between probability and rate over the bins, weighted by their statements.
    pub error: Option<f64>,
    /// Bins that hold a statement.
    pub bins: Vec<Bin>,
}

/// Statements of about the same probability.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// Its range.
    pub from: f64,
    /// Its range.
    pub to: f64,
    /// Mean probability stated.
    pub stated: f64,
    /// How many were right.
    pub right: Rate,
}

impl Calibration {
    pub(super) fn of<'a>(statements: impl Iterator<Item = &'a Statement> + Clone) -> Self {
        let index =
            |statement: &Statement| ((statement.probability * BINS as f64) as usize).min(BINS - 1);
        let bins: Vec<Bin> = (0..BINS)
            .filter_map(|bin| {
                let inside = statements
                    .clone()
                    .filter(|statement| index(statement) == bin);
                Some(Bin {
                    from: bin as f64 / BINS as f64,
                    to: (bin + 1) as f64 / BINS as f64,
                    stated: mean(inside.clone().map(|statement| statement.probability))?,
                    right: Rate::of(inside.map(|statement| statement.right)),
                })
            })
            .collect();
        let total: usize = bins.iter().map(|bin| bin.right.of).sum();
        let error = bins.iter().map(|bin| {
            let rate = bin.right.rate.unwrap_or(bin.stated);
            bin.right.of as f64 * (rate - bin.stated).abs()
        });
        Self {
            brier: mean(statements.map(|statement| statement.brier)),
            error: (total > 0).then(|| error.sum::<f64>() / total as f64),
            bins,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statement(probability: f64, right: bool) -> Statement {
        Statement {
            says: String::new(),
            truth: String::new(),
            probability,
            right,
            brier: (probability - f64::from(u8::from(right))).powi(2),
        }
    }

    #[test]
    fn what_is_right_as_often_as_stated_has_no_error() {
        let statements: Vec<Statement> = (0..20).map(|k| statement(0.75, k % 4 != 0)).collect();
        let found = Calibration::of(statements.iter());
        assert!(found.error.is_some_and(|error| error < 1e-12), "{found:?}");
        assert_eq!(found.bins.len(), 1);
    }

    #[test]
    fn boasting_shows_as_error() {
        let statements: Vec<Statement> = (0..10).map(|k| statement(0.95, k < 5)).collect();
        let found = Calibration::of(statements.iter());
        assert!(
            found
                .error
                .is_some_and(|error| (error - 0.45).abs() < 1e-12)
        );
    }
}
