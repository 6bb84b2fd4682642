//! Runs of a twin that were made before: a search that takes effects out and asks for them anew comes back to the same models.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

use crate::simulate::Substeps;
use crate::twin::Changes;

/// Runs that are kept, the oldest of which go first. With so many, between a twelfth and a quarter of a search's runs are found,
/// and hardly more with any number.
const RUNS: usize = 256;

/// What a run depends on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Asked {
    pub changes: Changes,
    pub substeps: Substeps,
    /// Of the sensors' noise, if there is any.
    pub seed: Option<u64>,
}

/// The last runs of one twin.
#[derive(Debug, Default)]
pub(crate) struct Remembered {
    runs: Mutex<VecDeque<(Asked, Vec<f64>)>>,
}

impl Remembered {
    /// What a run gave, from before or by making it. Two threads that ask for the same at once both make it.
    pub fn or<E>(
        &self,
        asked: Asked,
        make: impl FnOnce(&Asked) -> Result<Vec<f64>, E>,
    ) -> Result<Vec<f64>, E> {
        let runs = || self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        let before = runs().iter().find(|run| run.0 == asked).cloned();
        if let Some((_, made)) = before {
            return Ok(made);
        }
        let made = make(&asked)?;
        let mut runs = runs();
        if runs.len() >= RUNS {
            runs.pop_front();
        }
        runs.push_back((asked, made.clone()));
        Ok(made)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn a_run_is_made_once_for_what_it_depends_on() {
        let asked = |known: f64, substeps, seed| Asked {
            changes: Changes {
                known: vec![known],
                effects: Vec::new(),
            },
            substeps,
            seed,
        };
        let all = [
            asked(0.1, Substeps::Fine, None),
            asked(0.2, Substeps::Fine, None),
            asked(0.1, Substeps::Coarse, None),
            asked(0.1, Substeps::Fine, Some(1)),
        ];
        let remembered = Remembered::default();
        let made = Cell::new(0);
        let run = |asked: &Asked| {
            let place = all.iter().position(|other| other == asked).unwrap();
            let make = |_: &Asked| -> Result<Vec<f64>, ()> {
                made.set(made.get() + 1);
                Ok(vec![place as f64])
            };
            assert_eq!(remembered.or(asked.clone(), make), Ok(vec![place as f64]));
        };
        all.iter().for_each(run);
        all.iter().rev().for_each(run);
        assert_eq!(made.get(), all.len());
        // what failed is tried again
        let failing = asked(0.3, Substeps::Fine, None);
        assert_eq!(remembered.or(failing.clone(), |_| Err(())), Err(()));
        assert_eq!(
            remembered.or(failing, |_| Ok::<_, ()>(vec![7.0])),
            Ok(vec![7.0])
        );
        // the oldest make room
        for k in 0..RUNS {
            let other = asked(1.0 + k as f64, Substeps::Fine, None);
            remembered.or(other, |_| Ok::<_, ()>(Vec::new())).unwrap();
        }
        run(&all[0]);
        assert_eq!(made.get(), all.len() + 1);
    }
}
