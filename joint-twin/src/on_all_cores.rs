//! Work on many items at once.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use crate::stop;

/// An iterator whose items are worked on at once.
pub trait OnAllCores: Iterator<Item: Send> + Sized {
    /// What `of` makes of each item, in the items' order. It may do the same with items of its own.
    fn on_all_cores<R: Send>(self, of: impl Fn(Self::Item) -> R + Sync) -> impl Iterator<Item = R> {
        let places: Vec<Mutex<Place<Self::Item, R>>> =
            self.map(|item| Mutex::new(Place::Asked(item))).collect();
        let flag = stop::flag();
        // each place is locked by one worker, once; where one panics, `each` does
        each(places.len(), &|k| {
            let mut place = places[k].lock().unwrap_or_else(PoisonError::into_inner);
            if let Place::Asked(item) = std::mem::replace(&mut *place, Place::Empty) {
                let made = stop::under(flag.clone(), || {
                    stop::look();
                    of(item)
                });
                *place = Place::Made(made);
            }
        });
        places.into_iter().filter_map(|place| {
            match place.into_inner().unwrap_or_else(PoisonError::into_inner) {
                Place::Made(made) => Some(made),
                _ => None,
            }
        })
    }
}

impl<I: Iterator<Item: Send>> OnAllCores for I {}

/// An item, or what was made of it.
enum Place<T, R> {
    Asked(T),
    Empty,
    Made(R),
}

/// Without type parameters: rayon's machinery is a fifth of what a crate is compiled to if every call has its own.
fn each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_made_comes_in_the_items_order() {
        let squares: Vec<usize> = (0..1000).on_all_cores(|k| k * k).collect();
        assert!(
            squares
                .iter()
                .enumerate()
                .all(|(k, square)| *square == k * k)
        );
        assert_eq!(squares.len(), 1000);
        let sums: Vec<usize> = (0..20)
            .on_all_cores(|k| (0..k).on_all_cores(|j| j).sum())
            .collect();
        assert_eq!(sums[19], 171);
    }
}
