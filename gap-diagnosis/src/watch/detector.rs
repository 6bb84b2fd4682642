//! When a residual has grown: Page's cumulative sum, with a threshold from the time between two false alarms.
//!
//! Of each hop the mean squared whitened residual `s` counts as `x = ln(1 + s)`, which keeps a single burst from counting
//! for more than it is and a joint at rest from counting at all. `C ← max(0, C + (x - μ)/σ - k)` with mean and deviation of a
//! quiet stretch; above `h` it fires. For normal `x` the hops between two false alarms are
//! `(exp(2kb) - 2kb - 1)/(2k²)` with `b = h + 1.166` (Siegmund, Sequential Analysis, 1985, section 2.6).

/// Half of the growth it is made for, in deviations.
const DRIFT: f64 = 1.0;
/// Siegmund's correction for the sum's overshoot.
const OVERSHOOT: f64 = 1.166;
/// Part of the threshold that one hop may add: a single burst raises nothing.
const HOP_PART: f64 = 0.6;
/// Hops that a mean and a deviation need.
const HOPS_MIN: usize = 10;
/// One-sided 95 % of a normal distribution: the deviation is known from few hops.
const QUANTILE: f64 = 1.645;
/// No residual is steadier than this.
const DEVIATION_MIN: f64 = 0.05;

/// The cumulative sum of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Detector {
    mean: f64,
    deviation: f64,
    threshold: f64,
    sum: f64,
}

impl Detector {
    /// From the mean squared residuals of quiet hops; none from too few.
    pub fn new(quiet: &[f64], hops_between_alarms: f64) -> Option<Self> {
        let count = quiet.len() as f64;
        if quiet.len() < HOPS_MIN {
            return None;
        }
        let sizes: Vec<f64> = quiet.iter().map(|square| square.ln_1p()).collect();
        let mean = sizes.iter().sum::<f64>() / count;
        let variance = sizes.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let unsure = 1.0 + QUANTILE / (2.0 * (count - 1.0)).sqrt();
        Some(Self {
            mean,
            deviation: (unsure * variance.sqrt()).max(DEVIATION_MIN),
            threshold: threshold(hops_between_alarms),
            sum: 0.0,
        })
    }

    /// Takes a hop's mean squared residual; `true` if it fires.
    pub fn add(&mut self, square: f64) -> bool {
        let deviations = (square.ln_1p() - self.mean) / self.deviation;
        // A residual that is no number says nothing. Asked before the least of both is taken, which lets NaN pass.
        if !deviations.is_nan() {
            let step = (deviations - DRIFT).min(HOP_PART * self.threshold);
            self.sum = (self.sum + step).max(0.0);
        }
        self.sum > self.threshold
    }

    /// Whether nothing has been added up.
    pub fn is_calm(&self) -> bool {
        self.sum == 0.0
    }
}

/// Above which the sum comes once in so many quiet hops.
fn threshold(hops_between_alarms: f64) -> f64 {
    let hops = |b: f64| {
        let twice = 2.0 * DRIFT * b;
        (twice.exp_m1() - twice) / (2.0 * DRIFT * DRIFT)
    };
    let (mut low, mut high) = (OVERSHOOT, 100.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if hops(middle) < hops_between_alarms {
            low = middle;
        } else {
            high = middle;
        }
    }
    high - OVERSHOOT
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use joint_twin::signal::random::uniform;

    use super::*;

    /// Mean squares of so many normal numbers each.
    fn squares(hops: usize, seed: u64) -> Vec<f64> {
        let mut random = uniform(seed);
        let mut normal = move || (0..12).map(|_| random()).sum::<f64>() - 6.0;
        let mut hop = || (0..20).map(|_| normal().powi(2)).sum::<f64>() / 20.0;
        (0..hops).map(|_| hop()).collect()
    }

    #[test]
    fn false_alarms_are_as_rare_as_told() {
        let mut detector = Detector::new(&squares(4000, 1), 400.0).unwrap();
        let mut alarms = 0.0;
        for square in squares(200_000, 2) {
            if detector.add(square) {
                alarms += 1.0;
                detector.sum = 0.0;
            }
        }
        let between = 200_000.0 / alarms;
        assert!((300.0..1200.0).contains(&between), "{between}");
    }

    #[test]
    fn growth_fires_within_a_few_hops_and_one_burst_does_not() {
        let quiet = squares(40, 3);
        let grown = |factor: f64| {
            let mut detector = Detector::new(&quiet, 1e6).unwrap();
            let hops = squares(40, 4);
            hops.iter().position(|square| detector.add(factor * square))
        };
        assert_eq!(grown(1.0), None);
        assert!(grown(4.0).unwrap() < 8);
        assert_eq!(grown(100.0), Some(1));
        let mut detector = Detector::new(&quiet, 1e6).unwrap();
        assert!(!detector.add(1e6));
        assert!(!detector.is_calm());
        assert!(!detector.add(f64::NAN));
        assert!(Detector::new(&quiet[..5], 1e6).is_none());
    }
}
