//! How strong an effect must be for a gap of a given size.

/// Relative distance from the wanted gap at which the search ends.
const CLOSE: f64 = 0.1;
/// Runs it may take after the first.
const TRIES: usize = 9;

/// A strength and the gap it makes, over noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    pub strength: f64,
    pub gap_to_noise: f64,
}

/// Searches the strength up to `most` whose gap over noise is `wanted`. `gap` tells a strength's gap, and none where the
/// loop stops for safety. None if no strength is plausible and reaches it.
pub(crate) fn search(
    wanted: f64,
    most: f64,
    mut gap: impl FnMut(f64) -> Option<f64>,
) -> Option<Found> {
    let at_most = gap(most);
    if at_most.is_some_and(|at_most| at_most < wanted * (1.0 - CLOSE)) {
        return None;
    }
    let (mut weak, mut strong) = (0.0, most);
    // gaps grow about as strengths do
    let mut strength = at_most.map_or(0.1 * most, |at_most| most * wanted / at_most);
    for _ in 0..TRIES {
        let found = gap(strength);
        let over = found.map_or(f64::INFINITY, |found| found / wanted);
        if (over - 1.0).abs() <= CLOSE {
            return Some(Found {
                strength,
                gap_to_noise: over * wanted,
            });
        }
        if over > 1.0 {
            strong = strength;
        } else {
            weak = strength;
        }
        let middle = if weak > 0.0 {
            (weak * strong).sqrt()
        } else {
            0.2 * strong
        };
        let proportional = strength / over;
        let inside = proportional > weak + 0.02 * (strong - weak)
            && proportional < strong - 0.02 * (strong - weak);
        strength = if over.is_finite() && over > 0.0 && inside {
            proportional
        } else {
            middle
        };
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_strength_of_straight_bent_and_late_laws() {
        let laws: [fn(f64) -> f64; 3] = [|a| 2.0 * a, |a| a * a, |a| (3.0 * (a - 0.6)).max(0.0)];
        for (number, law) in laws.into_iter().enumerate() {
            let found = search(0.7, 3.0, |a| Some(law(a)));
            let gap = found.map(|found| law(found.strength));
            assert!(
                gap.is_some_and(|gap| (gap / 0.7 - 1.0).abs() <= CLOSE),
                "law {number}: {found:?}"
            );
        }
    }

    #[test]
    fn what_cannot_be_reached_is_none_and_what_stops_the_loop_is_too_strong() {
        assert_eq!(search(1.0, 0.5, Some), None);
        let stops = search(1.0, 50.0, |a| (a < 2.0).then_some(a));
        assert!(stops.is_some_and(|found| (found.strength - 1.0).abs() <= CLOSE));
    }
}
