//! What was computed before: a search that takes effects out and asks for them anew comes back to the same models.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

/// The last values that were made, each with what it depends on.
#[derive(Debug)]
pub(crate) struct Remembered<Asked, Made> {
    made: Mutex<VecDeque<(Asked, Made)>>,
    most: usize,
}

impl<Asked: PartialEq, Made: Clone> Remembered<Asked, Made> {
    /// Keeps so many; the oldest go first.
    pub fn at_most(most: usize) -> Self {
        Self {
            made: Mutex::default(),
            most,
        }
    }

    /// What was asked for, from before or by making it. Two threads that ask for the same at once both make it.
    pub fn or<E>(
        &self,
        asked: Asked,
        make: impl FnOnce(&Asked) -> Result<Made, E>,
    ) -> Result<Made, E> {
        // values are added whole: a thread that panicked has left none by halves
        let all = || self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let before = all()
            .iter()
            .find(|(other, _)| *other == asked)
            .map(|(_, made)| made.clone());
        if let Some(made) = before {
            return Ok(made);
        }
        let made = make(&asked)?;
        let mut all = all();
        if all.len() >= self.most {
            all.pop_front();
        }
        all.push_back((asked, made.clone()));
        Ok(made)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn a_value_is_made_once_for_what_it_depends_on() {
        let remembered = Remembered::at_most(3);
        let made = Cell::new(0);
        let square = |x: i32| {
            let make = |x: &i32| -> Result<i32, ()> {
                made.set(made.get() + 1);
                Ok(x * x)
            };
            remembered.or(x, make).unwrap()
        };
        assert_eq!([1, 2, 3, 2, 1].map(square), [1, 4, 9, 4, 1]);
        assert_eq!(made.get(), 3);
        // the oldest makes room
        assert_eq!([4, 3, 2, 1].map(square), [16, 9, 4, 1]);
        assert_eq!(made.get(), 5);
    }

    #[test]
    fn what_failed_is_tried_again() {
        let remembered = Remembered::at_most(3);
        assert_eq!(remembered.or(1, |_| Err("no")), Err("no"));
        assert_eq!(remembered.or(1, |_| Ok::<_, ()>(7)), Ok(7));
    }
}
