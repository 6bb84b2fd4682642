//! By what the gains must grow to do without the model.
//!
//! The gains grow by a common factor, doubled from one on until the error is no larger than with the model or the loop has
//! become unstable; then the last step is halved, on a logarithmic scale. Unstable is a loop that stops for safety or rings
//! between its drives' limits. At low gains an arm without a model collapses, which is no instability: only a run that
//! fails after one that did not ends the search.

use serde::Serialize;

/// The factor goes up to here.
const FACTOR_MAX: f64 = 4096.0;
/// Halvings of the last step: its ends are then a twentieth apart.
const HALVINGS: u32 = 4;

/// One run of the search.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// The gains' factor.
    pub factor: f64,
    /// Mean error; none if the run failed.
    pub mean_error: Option<f64>,
    /// Why it failed: stopped for safety, or ringing.
    pub failed: Option<String>,
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Found {
    /// The error to reach.
    pub target_error: f64,
    /// The largest factor tried that misses it and the smallest that reaches it.
    pub bracket: Option<[f64; 2]>,
    /// Every run, by rising factor.
    pub tried: Vec<Tried>,
}

impl Found {
    fn reaches(&self, tried: Option<&Tried>) -> bool {
        let error = tried.and_then(|tried| tried.mean_error);
        error.is_some_and(|error| error <= self.target_error)
    }

    /// The factor that does without the model.
    pub fn factor(&self) -> String {
        match self.bracket {
            Some([misses, reaches]) => format!("{misses:.1} to {reaches:.1}"),
            None if self.reaches(self.tried.first()) => "1.0".to_owned(),
            None => "none".to_owned(),
        }
    }

    /// Factor and error of the run that came nearest.
    pub fn best(&self) -> Option<(f64, f64)> {
        let counted = self
            .tried
            .iter()
            .filter_map(|tried| Some((tried.factor, tried.mean_error?)));
        counted.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// At which factor the search ended without success, and why.
    pub fn end(&self) -> Option<String> {
        let last = self.tried.last()?;
        let why = last.failed.as_ref()?;
        Some(format!("at {:.1} {why}", last.factor))
    }
}

/// Searches with `run`, which tries one factor.
///
/// # Errors
/// The first of `run`.
pub fn search<E>(
    target_error: f64,
    mut run: impl FnMut(f64) -> Result<Tried, E>,
) -> Result<Found, E> {
    let reaches = |tried: &Tried| tried.mean_error.is_some_and(|error| error <= target_error);
    let mut tried: Vec<Tried> = Vec::new();
    let mut factor = 1.0;
    while factor <= FACTOR_MAX {
        let next = run(factor)?;
        let unstable = next.failed.is_some() && tried.iter().any(|tried| tried.failed.is_none());
        let over = reaches(&next) || unstable;
        tried.push(next);
        if over {
            break;
        }
        factor *= 2.0;
    }
    let mut bracket = None;
    if tried.last().is_some_and(reaches) && tried.len() > 1 {
        let mut ends = [factor / 2.0, factor];
        for _ in 0..HALVINGS {
            let middle = run((ends[0] * ends[1]).sqrt())?;
            ends[usize::from(reaches(&middle))] = middle.factor;
            tried.push(middle);
        }
        bracket = Some(ends);
        tried.sort_by(|a, b| a.factor.total_cmp(&b.factor));
    }
    Ok(Found {
        target_error,
        bracket,
        tried,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// Error falls with the factor; the arm collapses below `from` and is unstable above `to`.
    fn plant(from: f64, to: f64) -> impl Fn(f64) -> Result<Tried, Infallible> {
        move |factor| {
            let failed = (factor < from || factor > to).then(|| "joint1 rings".to_owned());
            Ok(Tried {
                factor,
                mean_error: failed.is_none().then_some(1.0 / factor),
                failed,
            })
        }
    }

    #[test]
    fn the_bracket_holds_the_factor_that_just_reaches() {
        let Ok(found) = search(0.037, plant(3.0, f64::INFINITY));
        let [misses, reaches] = found.bracket.expect("reached");
        assert!(
            misses < 1.0 / 0.037 && 1.0 / 0.037 <= reaches,
            "{misses} {reaches}"
        );
        assert!(reaches / misses < 1.05);
    }

    #[test]
    fn an_unstable_loop_ends_the_search_and_a_collapsed_one_does_not() {
        let Ok(found) = search(0.01, plant(3.0, 20.0));
        assert_eq!(found.bracket, None);
        let factors: Vec<f64> = found.tried.iter().map(|tried| tried.factor).collect();
        assert_eq!(factors, [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]);
        assert_eq!(
            (found.factor(), found.best()),
            ("none".to_owned(), Some((16.0, 1.0 / 16.0)))
        );
        assert_eq!(found.end().as_deref(), Some("at 32.0 joint1 rings"));
    }

    #[test]
    fn nothing_is_searched_where_low_gains_do() {
        let Ok(found) = search(2.0, plant(0.0, f64::INFINITY));
        assert_eq!((found.tried.len(), found.bracket), (1, None));
        assert_eq!(found.factor(), "1.0");
    }
}
