//! How far one repeat is from the others, in units of their own scatter, and how often chance alone goes as far.
//!
//! Repeats scatter by noise that lasts: of two that part early one stays ahead. So the scatter of a mean over time is
//! never made from the scatter of its samples; it is that of the same mean over the other repeats. For repeats that are
//! alike and scatter normally, `t = (x - m)/(s·√(1 + 1/n))` is then Student's with `n - 1` degrees of freedom, whatever
//! the correlation over time (`m`, `s`: mean and standard deviation of the `n` others). Means over the whole time, its halves, quarters
//! and eighths tell what lasts and what passes. They depend on each other, and so do a joint's signals; Cauchy's
//! combination (Liu and Xie, Journal of the American Statistical Association 115, 2020) makes one probability of all
//! that holds however they do.
//!
//! Nothing shorter than an eighth is looked at: when a joint stops or breaks away differs a little from repeat to repeat,
//! and a mean over less than that is far from normal there.

use std::f64::consts::PI;
use std::ops::Range;

use rand_core::{RngCore, SeedableRng};
use rand_pcg::Pcg64Mcg;
use statrs::function::beta::checked_beta_reg;

/// Where the means over the whole, halves, quarters and eighths lie.
const LEVELS: [Range<usize>; 4] = [0..1, 1..3, 3..7, 7..15];
/// The eighths.
const SHORTEST: Range<usize> = 7..15;
/// Where the others happen to be near each other they still scatter by this part of what they do at other times.
const SCATTER_LEAST: f64 = 0.3;
/// Of the largest value: differences of rounding are none.
const ROUNDING: f64 = 1e-9;
/// More probable counts as this: one mean that happens to be as the others' must not outweigh another that is not.
const PROBABLE: f64 = 0.99;
/// Orders that are tried.
const ORDERS: usize = 9999;

/// Means over time of one signal, for each repeat.
#[derive(Clone, Debug)]
pub(super) struct Means {
    /// Of each repeat: the whole, two halves, four quarters, eight eighths; none where no row counts.
    of: Vec<Vec<Option<f64>>>,
    rounding: f64,
}

/// The rows of a mean, among so many.
pub(super) fn rows(mean: usize, of: usize) -> Range<usize> {
    let level = LEVELS.iter().find(|level| level.contains(&mean));
    let (place, parts) = level.map_or((0, 1), |level| (mean - level.start, level.len()));
    place * of / parts..(place + 1) * of / parts
}

/// How one repeat deviates from others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Deviation {
    /// Of repeats that are alike, the part that deviates as much.
    pub probability: f64,
    /// Index of the signal that shows it most.
    pub signal: usize,
    /// The mean that shows it most.
    pub mean: usize,
    /// Of that signal, root mean square over time in units of the others' scatter: about 1 for what is alike.
    pub in_scatters: f64,
}

impl Means {
    /// From the values of all repeats at the same instants, and whether an instant counts.
    pub fn new(repeats: &[Vec<f64>], counts: &[bool]) -> Self {
        let of = repeats
            .iter()
            .map(|values| {
                let means = (0..LEVELS[3].end).map(|mean| {
                    let rows = rows(mean, counts.len());
                    let counted = rows.filter(|row| counts[*row]);
                    let (sum, count) = counted.fold((0.0, 0_u32), |(sum, count), row| {
                        (sum + values[row], count + 1)
                    });
                    (count > 0).then(|| sum / f64::from(count))
                });
                means.collect()
            })
            .collect();
        let largest = repeats
            .iter()
            .flatten()
            .map(|x| x.abs())
            .fold(0.0, f64::max);
        Self {
            of,
            rounding: ROUNDING * largest,
        }
    }

    /// Mean and variance of some repeats, for each mean over time; the variance never far below what it is at other times.
    fn scatter(&self, repeats: &[usize]) -> Vec<Option<(f64, f64)>> {
        let mut scatter: Vec<Option<(f64, f64)>> = (0..LEVELS[3].end)
            .map(|mean| {
                let values: Option<Vec<f64>> = repeats
                    .iter()
                    .map(|repeat| self.of[*repeat][mean])
                    .collect();
                values.map(|values| mean_and_variance(&values))
            })
            .collect();
        for level in LEVELS {
            let there = scatter[level.clone()].iter().flatten();
            let (sum, count) =
                there.fold((0.0, 0.0), |(sum, count), (_, v)| (sum + v, count + 1.0));
            let least = SCATTER_LEAST.powi(2) * sum / f64::max(count, 1.0) + self.rounding.powi(2);
            for (_, variance) in scatter[level].iter_mut().flatten() {
                *variance += least;
            }
        }
        scatter
    }

    /// Squared distances of every two repeats in units of the scatter of all, over the eighths.
    fn distances(&self, repeats: &[usize]) -> Vec<Vec<f64>> {
        let scatter = self.scatter(repeats);
        let between = |a: usize, b: usize| {
            SHORTEST
                .filter_map(|mean| {
                    let (_, variance) = scatter[mean]?;
                    let apart = self.of[a][mean]? - self.of[b][mean]?;
                    (variance > 0.0).then(|| apart * apart / variance)
                })
                .sum()
        };
        let row = |a: &usize| repeats.iter().map(|b| between(*a, *b)).collect();
        repeats.iter().map(row).collect()
    }
}

/// Mean and unbiased variance.
pub fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
    (mean, square / (count - 1.0))
}

/// How one repeat deviates from the others; none where there are less than two others or no signal.
pub(super) fn deviation(signals: &[Means], one: usize, others: &[usize]) -> Option<Deviation> {
    if others.len() < 2 {
        return None;
    }
    let count = others.len() as f64;
    let (mut sum, mut weights) = (0.0, 0.0);
    let mut most = (f64::INFINITY, 0, 0);
    for (signal, means) in signals.iter().enumerate() {
        let scatter = means.scatter(others);
        for level in LEVELS {
            let weight = 1.0 / level.len() as f64;
            for mean in level {
                let (Some((centre, variance)), Some(own)) = (scatter[mean], means.of[one][mean])
                else {
                    continue;
                };
                let square = (own - centre).powi(2) / (variance * (1.0 + 1.0 / count));
                let probability = two_sided(square, count - 1.0);
                sum += weight * to_cauchy(probability);
                weights += weight;
                if probability < most.0 {
                    most = (probability, signal, mean);
                }
            }
        }
    }
    let (_, signal, mean) = most;
    (weights > 0.0).then(|| Deviation {
        probability: from_cauchy(sum / weights),
        signal,
        mean,
        in_scatters: in_scatters(&signals[signal], one, others),
    })
}

fn in_scatters(means: &Means, one: usize, others: &[usize]) -> f64 {
    let scatter = means.scatter(others);
    let factor = 1.0 + 1.0 / others.len() as f64;
    let (mut apart, mut own) = (0.0, 0.0);
    for mean in SHORTEST {
        if let (Some((centre, variance)), Some(x)) = (scatter[mean], means.of[one][mean]) {
            apart += (x - centre).powi(2);
            own += factor * variance;
        }
    }
    (apart / f64::max(own, f64::MIN_POSITIVE)).sqrt()
}

/// How often chance makes Student's t at least as large, from its square; 1 where there is none.
fn two_sided(t_square: f64, freedom: f64) -> f64 {
    let part = freedom / (freedom + t_square);
    checked_beta_reg(0.5 * freedom, 0.5, part).unwrap_or(1.0)
}

/// A lasting deviation that chance reaches this often, in units of the scatter of so many others.
pub(super) fn found_from(probability: f64, others: usize) -> f64 {
    let freedom = others as f64 - 1.0;
    let factor = 1.0 + 1.0 / others as f64;
    let (mut low, mut high) = (0.0, 1e12);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if two_sided(middle * middle, freedom) > probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    high * (factor * (1.0 + SCATTER_LEAST.powi(2))).sqrt()
}

fn to_cauchy(probability: f64) -> f64 {
    1.0 / (PI * probability.clamp(1e-300, PROBABLE)).tan()
}

fn from_cauchy(value: f64) -> f64 {
    if value > 0.0 {
        // the same, and exact for what is improbable
        (1.0 / value).atan() / PI
    } else {
        0.5 - value.atan() / PI
    }
}

/// What the order of the repeats has to do with how they differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Neighbours {
    /// How far each is from the next over how far any two are from each other, root mean square.
    pub next_to_any: f64,
    /// Part of all orders in which neighbours are as near.
    pub probability: f64,
}

/// Compares the order as it is with others: where repeats drift, neighbours are near. Exact whatever the scatter.
pub(super) fn neighbours(signals: &[Means], repeats: &[usize]) -> Option<Neighbours> {
    let count = repeats.len();
    let mut apart = vec![vec![0.0; count]; count];
    for means in signals {
        for (row, more) in apart.iter_mut().zip(means.distances(repeats)) {
            row.iter_mut().zip(more).for_each(|(x, more)| *x += more);
        }
    }
    let along = |order: &[usize]| order.windows(2).map(|ab| apart[ab[0]][ab[1]]).sum::<f64>();
    let mut order: Vec<usize> = (0..count).collect();
    let steps = along(&order);
    let any = apart.iter().flatten().sum::<f64>() / (count * count.saturating_sub(1)) as f64;
    let expected = any * count.saturating_sub(1) as f64;
    if expected.is_nan() || expected <= 0.0 {
        return None;
    }
    let mut random = uniform(count as u64);
    let mut as_near = 1;
    for _ in 0..ORDERS {
        for last in (1..count).rev() {
            order.swap(last, ((random() * (last + 1) as f64) as usize).min(last));
        }
        // the same steps in another order of adding are as near
        as_near += usize::from(along(&order) <= steps * (1.0 + 1e-12));
    }
    Some(Neighbours {
        next_to_any: (steps / expected).sqrt(),
        probability: as_near as f64 / (ORDERS + 1) as f64,
    })
}

/// Seeded random numbers between 0 and 1.
pub(super) fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    move || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twelve uniform numbers make one that is as good as normal.
    fn normal(random: &mut impl FnMut() -> f64) -> f64 {
        (0..12).map(|_| random()).sum::<f64>() - 6.0
    }

    #[derive(Clone, Copy, Debug)]
    enum Scatter {
        White,
        Lasting,
        Diverging,
    }

    /// Two signals of repeats that are alike.
    fn alike(scatter: Scatter, repeats: usize, seed: u64) -> Vec<Vec<Vec<f64>>> {
        let mut random = uniform(seed);
        let mut signal = || {
            let (mut offset, speed) = (0.0, 1e-2 * normal(&mut random));
            let values = (0..160).map(|k| {
                let noise = normal(&mut random);
                match scatter {
                    Scatter::White => noise,
                    Scatter::Lasting => {
                        offset = 0.97 * offset + noise;
                        offset
                    }
                    Scatter::Diverging => speed * f64::from(k).powi(2) + 0.1 * noise,
                }
            });
            values.collect::<Vec<f64>>()
        };
        (0..2)
            .map(|_| (0..repeats).map(|_| signal()).collect())
            .collect()
    }

    fn means(signals: &[Vec<Vec<f64>>]) -> Vec<Means> {
        let means = |repeats: &Vec<Vec<f64>>| Means::new(repeats, &vec![true; repeats[0].len()]);
        signals.iter().map(means).collect()
    }

    fn others(of: usize, one: usize) -> Vec<usize> {
        (0..of).filter(|k| *k != one).collect()
    }

    #[test]
    fn students_t_and_cauchys_combination_have_their_tables_values() {
        // two-sided 5 % of 4 degrees of freedom, 0.1 % of 18
        assert!((two_sided(2.776_445_f64.powi(2), 4.0) - 0.05).abs() < 1e-6);
        assert!((two_sided(3.921_646_f64.powi(2), 18.0) - 0.001).abs() < 1e-8);
        for probability in [1e-200, 1e-12, 0.01, 0.5, 0.9] {
            let there_and_back = from_cauchy(to_cauchy(probability));
            assert!((there_and_back / probability - 1.0).abs() < 1e-9);
        }
        let from = found_from(0.001, 19) / (20.0 / 19.0 * 1.09_f64).sqrt();
        assert!((from - 3.921_646).abs() < 1e-5, "{from}");
    }

    #[test]
    fn means_are_of_the_whole_its_halves_quarters_and_eighths() {
        assert_eq!(rows(0, 80), 0..80);
        assert_eq!(rows(2, 80), 40..80);
        assert_eq!(rows(3, 80), 0..20);
        assert_eq!(rows(14, 80), 70..80);
    }

    /// The rate at which repeats that are alike are told to be none, at what is said to be 5 and 1 %.
    #[test]
    fn false_alarms_are_as_rare_as_told_whatever_the_correlation() {
        for scatter in [Scatter::White, Scatter::Lasting, Scatter::Diverging] {
            for repeats in [3, 5, 10, 20] {
                let rounds = 6000 / repeats;
                let mut below = [0_usize; 2];
                for round in 0..rounds {
                    let signals = means(&alike(scatter, repeats, round as u64));
                    for one in 0..repeats {
                        let found = deviation(&signals, one, &others(repeats, one));
                        let probability = found.map_or(1.0, |found| found.probability);
                        for (count, limit) in below.iter_mut().zip([0.05, 0.01]) {
                            *count += usize::from(probability < limit);
                        }
                    }
                }
                let rates = below.map(|count| count as f64 / (rounds * repeats) as f64);
                println!("{scatter:?}, {repeats} repeats: {rates:?}");
                assert!(
                    rates[0] < 0.065 && rates[1] < 0.015,
                    "{scatter:?}, {repeats}: {rates:?}"
                );
                // few repeats are judged more cautiously, many are not
                if repeats >= 10 {
                    assert!(
                        rates[0] > 0.015 && rates[1] > 0.002,
                        "{scatter:?}, {repeats}: {rates:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_repeat_that_differs_is_found_from_about_where_it_is_said() {
        for (scatter, repeats) in [
            (Scatter::Lasting, 5),
            (Scatter::Lasting, 10),
            (Scatter::White, 10),
        ] {
            let (limit, rounds) = (0.01 / repeats as f64, 100);
            let size = found_from(limit, repeats - 1);
            let found = |times: f64| {
                let rounds = 0..rounds;
                let hits = rounds.filter(|round| {
                    let mut signals = alike(scatter, repeats, *round);
                    let wholes: Vec<f64> = signals[0]
                        .iter()
                        .map(|values| values.iter().sum::<f64>() / values.len() as f64)
                        .collect();
                    let deviation_of_mean = mean_and_variance(&wholes[1..]).1.sqrt();
                    let changed = &mut signals[0][0];
                    changed
                        .iter_mut()
                        .for_each(|x| *x += times * size * deviation_of_mean);
                    let found = deviation(&means(&signals), 0, &others(repeats, 0));
                    found.is_some_and(|found| found.probability < limit && found.signal == 0)
                });
                hits.count()
            };
            let hits = [0.25, 2.0].map(found);
            println!("{scatter:?}, {repeats} repeats: {hits:?} of {rounds}");
            assert!(
                hits[0] < 15 && hits[1] > 85,
                "{scatter:?}, {repeats}: {hits:?}"
            );
        }
    }

    #[test]
    fn a_drift_shows_in_the_order_and_chance_does_not() {
        let all: Vec<usize> = (0..10).collect();
        let rounds = 200;
        let by_chance = (0..rounds).filter(|round| {
            let signals = means(&alike(Scatter::Lasting, 10, *round));
            neighbours(&signals, &all).is_some_and(|found| found.probability < 0.05)
        });
        let by_chance = by_chance.count();
        assert!(by_chance < 20, "{by_chance} of {rounds}");
        let mut drifting = alike(Scatter::Lasting, 10, 1);
        for (number, values) in drifting[0].iter_mut().enumerate() {
            values.iter_mut().for_each(|x| *x += 5.0 * number as f64);
        }
        let found = neighbours(&means(&drifting), &all);
        assert!(
            found.is_some_and(|found| found.probability < 0.01 && found.next_to_any < 0.8),
            "{found:?}"
        );
    }

    #[test]
    fn repeats_that_are_equal_to_rounding_tell_nothing() {
        let equal = vec![vec![vec![0.1; 160]; 5]];
        let found = deviation(&means(&equal), 0, &others(5, 0));
        assert!(
            found.is_some_and(|found| found.probability > 0.5),
            "{found:?}"
        );
        assert_eq!(neighbours(&means(&equal), &[0, 1, 2, 3, 4]), None);
        assert_eq!(deviation(&means(&equal), 0, &[1]), None);
        assert_eq!(deviation(&[], 0, &[1, 2]), None);
    }
}
