//! Many sines at once, at random phases: rich in frequencies, and periodic.
//!
//! The lines lie at multiples of `1/period` within the band, with amplitudes falling as `1/f`, so that each line brings
//! about the same speed. The phases come from a seed and make the same seed the same motion.

use std::f64::consts::TAU;

use rand_core::RngCore;
use rand_pcg::Pcg32;

/// The most lines a joint may have; each costs a sine every cycle.
pub const LINES_MAX: u32 = 256;
/// The highest multiple of `1/period` a line may lie at; the search for the peaks takes 32 samples for each.
pub const MULTIPLE_MAX: u32 = 8192;

/// What a joint's motion should be like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recipe {
    /// About where the joint moves.
    pub centre_rad: f64,
    /// Largest distance from the centre.
    pub amplitude_rad: f64,
    /// Largest speed; the amplitude shrinks to keep it.
    pub speed_rad_s: f64,
    /// Lowest and highest frequency.
    pub band_hz: [f64; 2],
    /// Period of the whole.
    pub period_s: f64,
    /// Chooses the phases.
    pub seed: u64,
}

/// The motion of one joint.
#[derive(Clone, Debug)]
pub struct MultiSine {
    centre_rad: f64,
    period_s: f64,
    lines: Box<[Line]>,
}

#[derive(Clone, Copy, Debug)]
struct Line {
    amplitude_rad: f64,
    frequency_rad_s: f64,
    phase_rad: f64,
}

impl MultiSine {
    /// Mixes the sines; `stream` separates joints of one seed. `None` if the band holds no multiple of `1/period`, more than
    /// [`LINES_MAX`], or one above [`MULTIPLE_MAX`].
    pub fn new(recipe: &Recipe, stream: u64) -> Option<Self> {
        let [low_hz, high_hz] = recipe.band_hz;
        // A band edge that is meant to be a multiple shall not be lost to rounding.
        let first = (low_hz * recipe.period_s - 1e-9).ceil().max(1.0);
        let last = (high_hz * recipe.period_s + 1e-9).floor();
        let few = last - first < f64::from(LINES_MAX) && last <= f64::from(MULTIPLE_MAX);
        // False for NaN too.
        if !(few && last >= first) {
            return None;
        }
        let mut random = Pcg32::new(recipe.seed, stream);
        let line = |multiple: u32| Line {
            amplitude_rad: 1.0 / f64::from(multiple),
            frequency_rad_s: TAU * f64::from(multiple) / recipe.period_s,
            phase_rad: TAU * f64::from(random.next_u32()) / f64::from(u32::MAX),
        };
        let lines = (first as u32..=last as u32).map(line).collect();
        let mut motion = Self {
            centre_rad: 0.0,
            period_s: recipe.period_s,
            lines,
        };
        motion.scale(recipe);
        motion.centre_rad = recipe.centre_rad;
        Some(motion)
    }

    /// Brings the largest excursion to the amplitude asked for, or the largest speed to its bound if that is less.
    fn scale(&mut self, recipe: &Recipe) {
        let highest = self
            .lines
            .last()
            .map_or(1.0, |line| line.frequency_rad_s * self.period_s / TAU);
        // 32 samples of the fastest line's period find the peaks to half a percent.
        let samples = (32.0 * highest) as u32;
        let (mut peak_rad, mut peak_rad_s) = (0.0_f64, 0.0_f64);
        for sample in 0..samples {
            let [position_rad, velocity_rad_s, _] =
                self.sample(self.period_s * f64::from(sample) / f64::from(samples));
            peak_rad = peak_rad.max(position_rad.abs());
            peak_rad_s = peak_rad_s.max(velocity_rad_s.abs());
        }
        let scale = (recipe.amplitude_rad / peak_rad).min(recipe.speed_rad_s / peak_rad_s);
        self.lines
            .iter_mut()
            .for_each(|line| line.amplitude_rad *= scale);
    }

    /// Period of the whole.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Position, velocity and acceleration.
    pub fn sample(&self, time_s: f64) -> [f64; 3] {
        let mut sum = [self.centre_rad, 0.0, 0.0];
        for line in &self.lines {
            let (sin, cos) = (line.frequency_rad_s * time_s + line.phase_rad).sin_cos();
            sum[0] += line.amplitude_rad * sin;
            sum[1] += line.amplitude_rad * line.frequency_rad_s * cos;
            sum[2] -= line.amplitude_rad * line.frequency_rad_s.powi(2) * sin;
        }
        sum
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    const RECIPE: Recipe = Recipe {
        centre_rad: 0.2,
        amplitude_rad: 0.5,
        speed_rad_s: 10.0,
        band_hz: [0.1, 1.0],
        period_s: 10.0,
        seed: 7,
    };

    fn peaks(motion: &MultiSine) -> (f64, f64) {
        let samples = (0..10_000).map(|step| motion.sample(0.001 * f64::from(step)));
        samples.fold((0.0, 0.0), |(p, v), [position, velocity, _]| {
            (
                f64::max(p, (position - 0.2).abs()),
                f64::max(v, velocity.abs()),
            )
        })
    }

    #[test]
    fn keeps_amplitude_and_speed() {
        let (peak_rad, _) = peaks(&MultiSine::new(&RECIPE, 0).unwrap());
        assert!((peak_rad / 0.5 - 1.0).abs() < 0.01, "{peak_rad}");
        let slow = MultiSine::new(
            &Recipe {
                speed_rad_s: 0.3,
                ..RECIPE
            },
            0,
        )
        .unwrap();
        let (peak_rad, peak_rad_s) = peaks(&slow);
        assert!(
            (peak_rad_s / 0.3 - 1.0).abs() < 0.01 && peak_rad < 0.5,
            "{peak_rad_s} {peak_rad}"
        );
    }

    #[test]
    fn seeds_and_streams_differ_and_repeat() {
        let at = |seed, stream| {
            MultiSine::new(&Recipe { seed, ..RECIPE }, stream)
                .unwrap()
                .sample(1.0)
        };
        assert_eq!(at(1, 0), at(1, 0));
        assert_ne!(at(1, 0), at(2, 0));
        assert_ne!(at(1, 0), at(1, 1));
    }

    #[test]
    fn holds_the_lines_of_the_band_only() {
        let motion = MultiSine::new(&RECIPE, 0).unwrap();
        assert_eq!(motion.lines.len(), 10);
        assert!(
            MultiSine::new(
                &Recipe {
                    band_hz: [0.11, 0.19],
                    ..RECIPE
                },
                0
            )
            .is_none()
        );
        assert!(
            MultiSine::new(
                &Recipe {
                    band_hz: [0.1, 1e9],
                    ..RECIPE
                },
                0
            )
            .is_none()
        );
    }
}
