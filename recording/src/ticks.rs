//! Times of a clock that goes on by ticks about as long as a row, as those of Windows do (15.6 ms) and of a log that writes whole
//! milliseconds: each row came within a tick after its time, and rows are more even than that.

use crate::statistics::quantile;
use std::ops::Range;

/// Fewer rows with the time of the row before are written twice, or a burst.
const REPEATED_PART: f64 = 0.01;
/// All steps but so many are multiples of a tick, to so much of it: milliseconds are rounded to a fifteenth of 15.6.
const OTHER_STEPS_PART: f64 = 0.01;
const MULTIPLE: f64 = 0.1;
/// Rows before and after one through whose times a straight line goes: of 33 it leaves a twentieth of a tick.
const BESIDE: usize = 16;
/// Ticks without a row after which what follows is no neighbour.
const PAUSE_TICKS: f64 = 3.5;

/// Puts rows where they most likely were, within a tick after their time. Tells the tick; nothing if the clock has none that is as long
/// as that. `is_sample`: whether a row with the time of the row before has other values.
pub(crate) fn even_out(time_s: &mut [f64], is_sample: impl Fn(usize) -> bool) -> Option<f64> {
    let tick_s = tick_s(time_s, is_sample)?;
    let mut from = 0;
    for row in 1..=time_s.len() {
        let follows =
            |row: usize| (0.0..PAUSE_TICKS * tick_s).contains(&(time_s[row] - time_s[row - 1]));
        if row == time_s.len() || !follows(row) {
            even_out_run(time_s, from..row, tick_s);
            from = row;
        }
    }
    Some(tick_s)
}

fn tick_s(time_s: &[f64], is_sample: impl Fn(usize) -> bool) -> Option<f64> {
    let repeated: Vec<usize> = (1..time_s.len())
        .filter(|row| time_s[*row] == time_s[*row - 1])
        .collect();
    let samples = repeated.iter().filter(|row| is_sample(**row)).count();
    let is_rare = (repeated.len() as f64) < REPEATED_PART * time_s.len() as f64;
    if is_rare || 2 * samples < repeated.len() {
        return None;
    }
    let steps = time_s.windows(2).map(|pair| pair[1] - pair[0]);
    let steps: Vec<f64> = steps.filter(|step_s| *step_s > 0.0).collect();
    // most rows come one tick after another, or in the same
    let short_s = quantile(steps.clone(), 0.1)?;
    let one = steps.iter().filter(|step_s| **step_s < 1.5 * short_s);
    let tick_s = one.clone().sum::<f64>() / one.count() as f64;
    let is_multiple = |step_s: &&f64| {
        let ticks = **step_s / tick_s;
        (ticks - ticks.round()).abs() <= MULTIPLE
    };
    let others = steps.len() - steps.iter().filter(is_multiple).count();
    (others as f64 <= OTHER_STEPS_PART * steps.len() as f64).then_some(tick_s)
}

/// Rows between which no tick is missing but for a few.
fn even_out_run(time_s: &mut [f64], rows: Range<usize>, tick_s: f64) {
    let told_s = time_s[rows.clone()].to_vec();
    let mut last_s = f64::NEG_INFINITY;
    for (place, row) in rows.enumerate() {
        let beside = place.saturating_sub(BESIDE)..(place + BESIDE + 1).min(told_s.len());
        // half a tick after their times rows are on average
        let here_s = line_at(&told_s, beside, place) + 0.5 * tick_s;
        let within_s = here_s.clamp(told_s[place], told_s[place] + tick_s);
        time_s[row] = within_s.max(last_s);
        last_s = time_s[row];
    }
}

/// The straight line of least squares through values, at one of their places.
fn line_at(values: &[f64], places: Range<usize>, at: usize) -> f64 {
    let count = places.len() as f64;
    let centre = (places.start + places.end - 1) as f64 / 2.0;
    let mean = values[places.clone()].iter().sum::<f64>() / count;
    let [mut products, mut squares] = [0.0; 2];
    for place in places {
        let off = place as f64 - centre;
        products += off * (values[place] - mean);
        squares += off * off;
    }
    if squares == 0.0 {
        return mean;
    }
    mean + products / squares * (at as f64 - centre)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    /// Rows every so often, which drift by a hundredth of it, on a clock of 15.625 ms that is written in milliseconds.
    fn ticked(period_s: f64, rows: usize) -> [Vec<f64>; 2] {
        let true_s = |row: usize| {
            let row = row as f64;
            period_s * (row + 2.0 * (row / 200.0).sin())
        };
        let true_s: Vec<f64> = (0..rows).map(true_s).collect();
        let told = |s: &f64| (1e3 * 0.015_625 * (s / 0.015_625).floor()).round() / 1e3;
        let told_s = true_s.iter().map(told).collect();
        [true_s, told_s]
    }

    #[test]
    fn rows_of_a_clock_of_ticks_are_evened_out() {
        for period_s in [0.0149, 0.01, 0.0085] {
            let [true_s, told_s] = ticked(period_s, 2000);
            let mut time_s = told_s.clone();
            let tick_s = even_out(&mut time_s, |_| true).unwrap();
            assert!((tick_s - 0.015_625).abs() < 2e-4, "{tick_s}");
            assert!(time_s.windows(2).all(|pair| pair[1] >= pair[0]));
            let off = |of: &[f64]| {
                let steps =
                    |of: &[f64]| -> Vec<f64> { of.windows(2).map(|x| x[1] - x[0]).collect() };
                let both = steps(of).into_iter().zip(steps(&true_s));
                let square: f64 = both.map(|(a, b)| (a - b).powi(2)).sum();
                (square / of.len() as f64).sqrt()
            };
            assert!(
                off(&time_s) < 0.1 * off(&told_s),
                "{period_s}: {} of {}",
                off(&time_s),
                off(&told_s)
            );
        }
    }

    #[test]
    fn times_of_another_kind_are_left() {
        let jittered = |k: usize| 1e-3 * k as f64 + 1e-4 * ((k * 37 % 11) as f64 - 5.0);
        let mut jittered: Vec<f64> = (0..2000).map(jittered).collect();
        // bursts of one time
        (0..2000)
            .step_by(40)
            .for_each(|row| jittered[row + 1] = jittered[row]);
        let mut time_s = jittered.clone();
        assert_eq!(even_out(&mut time_s, |_| true), None);
        assert_eq!(time_s, jittered);
        // rows that were written twice, and a clock of which no row repeats the time
        assert_eq!(
            even_out(&mut ticked(0.0149, 2000)[1].clone(), |_| false),
            None
        );
        assert_eq!(even_out(&mut ticked(0.05, 2000)[1].clone(), |_| true), None);
    }
}
