//! From values to pixels: the range of an axis, its ticks and their labels.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};

use crate::{Axis, decimal};

/// Empty space beyond the data, as a share of their range.
const MARGIN: f64 = 0.04;

/// An axis with its range and ticks decided.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    low: f64,
    high: f64,
    is_log: bool,
    ticks: Vec<(f64, String)>,
}

impl Scale {
    /// The scale for these values, with at most `ticks` ticks.
    pub fn new(axis: &Axis, values: impl Iterator<Item = f64>, ticks: usize) -> Self {
        if !axis.categories.is_empty() {
            return Self::of_categories(&axis.categories);
        }
        let is_log = axis.is_log;
        let place = |value: f64| if is_log { value.log10() } else { value };
        let wanted = axis.range.map(|range| range.map(place));
        let possible = wanted.filter(|[low, high]| low < high && (high - low).is_finite());
        let [low, high] = possible.unwrap_or_else(|| with_margin(extent(values.map(place))));
        let mut scale = Self {
            low,
            high,
            is_log,
            ticks: Vec::new(),
        };
        scale.set_ticks(ticks);
        scale
    }

    fn of_categories(names: &[String]) -> Self {
        let ticks = names.iter().enumerate();
        Self {
            low: -0.5,
            high: names.len() as f64 - 0.5,
            is_log: false,
            ticks: ticks.map(|(i, name)| (i as f64, name.clone())).collect(),
        }
    }

    /// The same with its first value at the far end: categories of y read from the top down.
    #[must_use]
    pub fn reversed(self) -> Self {
        Self {
            low: self.high,
            high: self.low,
            ..self
        }
    }

    /// Widens the shorter of two scales until a unit takes as many pixels on one as on the other.
    pub fn equalise(x: &mut Self, y: &mut Self, size_px: (u32, u32), ticks: [usize; 2]) {
        let (x_per_px, y_per_px) = (
            (x.high - x.low) / f64::from(size_px.0.max(1)),
            (y.high - y.low) / f64::from(size_px.1.max(1)),
        );
        if x_per_px < y_per_px {
            x.widen(y_per_px / x_per_px, ticks[0]);
        } else {
            y.widen(x_per_px / y_per_px, ticks[1]);
        }
    }

    fn widen(&mut self, factor: f64, ticks: usize) {
        let middle = 0.5 * (self.low + self.high);
        let half = 0.5 * (self.high - self.low) * factor;
        (self.low, self.high) = (middle - half, middle + half);
        self.set_ticks(ticks);
    }

    fn set_ticks(&mut self, count: usize) {
        let step = tick_step(self.high - self.low, count, self.is_log);
        let first = (self.low / step - 1e-9).ceil();
        let steps = ((self.high / step + 1e-9).floor() - first).clamp(0.0, 50.0) as usize;
        let decimals = (-step.log10()).ceil().clamp(0.0, 12.0) as usize;
        self.ticks = (0..=steps)
            .map(|i| {
                let place = (first + i as f64) * step;
                let label = if self.is_log {
                    power_of_ten(place)
                } else if self.low.abs().max(self.high.abs()) >= 1e6 || step < 1e-4 {
                    format!("{place:.1e}").replace('-', "\u{2212}")
                } else {
                    decimal(place, decimals)
                };
                (self.value(place), label)
            })
            .collect();
    }

    fn value(&self, place: f64) -> f64 {
        if self.is_log {
            10_f64.powf(place)
        } else {
            place
        }
    }

    /// Whether a value can be seen.
    pub fn shows(&self, value: f64) -> bool {
        (0.0..=1.0).contains(&self.share(value))
    }

    /// Where a value lies between low (0) and high (1).
    pub fn share(&self, value: f64) -> f64 {
        let place = if self.is_log { value.log10() } else { value };
        (place - self.low) / (self.high - self.low)
    }

    /// The label of a tick.
    pub fn label(&self, value: f64) -> String {
        let tick = self.ticks.iter().find(|(tick, _)| *tick == value);
        tick.map_or(String::new(), |(_, label)| label.clone())
    }

    /// Letters in the longest label.
    pub fn label_length(&self) -> usize {
        let lengths = self.ticks.iter().map(|(_, label)| label.chars().count());
        lengths.max().unwrap_or(0)
    }
}

impl Ranged for Scale {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (first, last): (i32, i32)) -> i32 {
        let share = self.share(*value).clamp(0.0, 1.0);
        first + (share * f64::from(last - first)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.iter().map(|(value, _)| *value).collect()
    }

    fn range(&self) -> Range<f64> {
        self.value(self.low)..self.value(self.high)
    }
}

/// Smallest and largest of the finite values; zero to one of none.
fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let finite = values.filter(|value| value.is_finite());
    let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    if low <= high { [low, high] } else { [0.0, 1.0] }
}

fn with_margin([low, high]: [f64; 2]) -> [f64; 2] {
    let width = high - low;
    // A range that rounding alone would fill shows no more than one value does.
    let margin = if width > 1e-9 * low.abs().max(high.abs()) {
        MARGIN * width
    } else {
        0.1 * low.abs().max(1.0)
    };
    [low - margin, high + margin]
}

/// 1, 2 or 5 times a power of ten; whole powers on a logarithmic axis.
fn tick_step(width: f64, count: usize, is_log: bool) -> f64 {
    let least = width / count.max(1) as f64;
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }
    if is_log {
        return least.ceil();
    }
    let power = 10_f64.powf(least.log10().floor());
    let factors = [1.0, 2.0, 5.0].into_iter();
    let fitting = factors.map(|factor| factor * power);
    fitting
        .into_iter()
        .find(|step| *step >= least * (1.0 - 1e-9))
        .unwrap_or(10.0 * power)
}

fn power_of_ten(exponent: f64) -> String {
    if (-3.0..=4.0).contains(&exponent) {
        return decimal(10_f64.powf(exponent), (-exponent).max(0.0) as usize);
    }
    format!("1e{exponent:.0}").replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, values: [f64; 2]) -> Vec<String> {
        let scale = Scale::new(axis, values.into_iter(), 6);
        scale.ticks.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round_and_have_no_more_digits_than_they_need() {
        let axis = Axis::new("x", "");
        assert_eq!(
            labels(&axis, [0.0, 0.4]),
            ["0.0", "0.1", "0.2", "0.3", "0.4"]
        );
        assert_eq!(
            labels(&axis, [-45.0, 45.0]),
            ["−40", "−20", "0", "20", "40"]
        );
        assert_eq!(
            labels(&axis.log(), [0.01, 20.0]),
            ["0.01", "0.1", "1", "10"]
        );
    }

    #[test]
    fn any_range_has_ticks_and_no_endless_ones() {
        let all = [0.0, 1.0, -1e300, 1e300, 1e-300, f64::NAN, f64::INFINITY];
        for low in all {
            for high in all {
                for axis in [Axis::new("x", ""), Axis::new("x", "").log()] {
                    let scale = Scale::new(&axis, [low, high].into_iter(), 6);
                    assert!(
                        scale.ticks.len() <= 51 && scale.low < scale.high,
                        "{scale:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_lies_beyond_the_range_is_not_shown() {
        let scale = Scale::new(&Axis::new("x", "").range(0.0, 1.0), std::iter::empty(), 5);
        assert!(scale.shows(0.5) && !scale.shows(1.1) && !scale.shows(f64::NAN));
    }
}
