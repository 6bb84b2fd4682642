//! Vibration above the band that is compared. A gear that swings in its friction, because that falls with speed, rubs less than
//! the law says at its mean speed; nothing within the band shows why.

use std::f64::consts::{FRAC_2_PI, SQRT_2, TAU};

use joint_model::filter::FilterError;

use crate::observe::SPREAD_S;
use crate::signal::band::up_to;
use crate::signal::smooth::{derivative, low_pass, second_derivative};

/// The vibration is sought from so many times the band's limit on, up to some frequency.
const FROM_CUTOFFS: f64 = 1.5;
const TO_HZ: f64 = 150.0;
/// So many times what is usual is no vibration: of acceleration what it is in half of all rows, as encoder and controller make it.
const USUAL: f64 = 2.0;

/// How a joint swings above the band, root mean squares sample by sample. Zero where the sample rate is too low to
/// see any.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Vibration {
    /// Acceleration beyond what is usual of the recording.
    pub unusual_rad_s2: Vec<f64>,
    /// Acceleration beyond what encoders make of rest.
    pub acceleration_rad_s2: Vec<f64>,
    /// Velocity beyond what encoders make of rest.
    pub velocity_rad_s: Vec<f64>,
}

impl Vibration {
    /// In positions that an encoder showed with so much noise, its rounding included; zero where nobody knows it, and then what is usual
    /// of the recording is taken for it.
    ///
    /// # Errors
    /// [`FilterError`] if the rate is no rate.
    pub fn of(
        position_rad: &[f64],
        noise_rad: f64,
        cutoff_hz: f64,
        rate_hz: f64,
    ) -> Result<Self, FilterError> {
        let (from_hz, to_hz) = (FROM_CUTOFFS * cutoff_hz, up_to(TO_HZ, rate_hz));
        if to_hz < 2.0 * from_hz {
            let none = vec![0.0; position_rad.len()];
            return Ok(Self {
                unusual_rad_s2: none.clone(),
                acceleration_rad_s2: none.clone(),
                velocity_rad_s: none,
            });
        }
        let all = low_pass(position_rad, to_hz, rate_hz)?;
        let slow = low_pass(position_rad, from_hz, rate_hz)?;
        let fast: Vec<f64> = all
            .iter()
            .zip(&slow)
            .map(|(all, slow)| all - slow)
            .collect();
        let period_s = 1.0 / rate_hz;
        let around = (SPREAD_S * rate_hz) as usize;
        let squares = |values: &[f64]| mean_squares(values, around);
        let accelerations = squares(&second_derivative(&fast, period_s));
        let velocities = squares(&derivative(&fast, period_s));
        // derivatives of a position that is white between zero and half the rate
        let density = 2.0 * noise_rad.powi(2) / rate_hz;
        let of_rest = |order: i32, squares: &[f64]| {
            let power = 2 * order + 1;
            let span = to_hz.powi(power) - from_hz.powi(power);
            let noise = density * TAU.powi(2 * order) * span / f64::from(power);
            if noise > 0.0 { noise } else { middle(squares) }
        };
        Ok(Self {
            unusual_rad_s2: beyond(&accelerations, middle(&accelerations)),
            acceleration_rad_s2: beyond(&accelerations, of_rest(2, &accelerations)),
            velocity_rad_s: beyond(&velocities, of_rest(1, &velocities)),
        })
    }
}

/// A vibration that outpaces the joint's own motion, and is wider than friction bends before it slips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// Part of the samples in which it does.
    pub share: f64,
    /// As if it were one sine.
    pub frequency_hz: f64,
    /// At the joint.
    pub amplitude_rad: f64,
}

impl Vibration {
    /// Part of dry friction that the vibration takes off a motion of this velocity at a sample: Coulomb's, averaged over a sine.
    pub fn shaken_off(&self, sample: usize, velocity_rad_s: f64, presliding_rad: f64) -> f64 {
        let largest_rad_s = SQRT_2 * self.velocity_rad_s[sample];
        if largest_rad_s <= velocity_rad_s.abs() || self.amplitude_rad(sample) < presliding_rad {
            return 0.0;
        }
        1.0 - FRAC_2_PI * (velocity_rad_s.abs() / largest_rad_s).asin()
    }

    /// As if it were one sine.
    fn amplitude_rad(&self, sample: usize) -> f64 {
        let [velocity, acceleration] =
            [&self.velocity_rad_s, &self.acceleration_rad_s2].map(|of| of[sample]);
        if acceleration > 0.0 {
            SQRT_2 * velocity.powi(2) / acceleration
        } else {
            0.0
        }
    }
}

impl Swing {
    /// Over samples of vibrations, each with the joint's own velocity; none if it never does.
    pub(crate) fn of<'a>(
        samples: impl Iterator<Item = (&'a Vibration, usize, f64)>,
        presliding_rad: f64,
    ) -> Option<Self> {
        let (mut all, mut outpaced) = (0.0, 0.0);
        let [mut accelerations, mut velocities] = [0.0; 2];
        for (vibration, sample, velocity_rad_s) in samples {
            all += 1.0;
            if vibration.shaken_off(sample, velocity_rad_s, presliding_rad) > 0.0 {
                outpaced += 1.0;
                accelerations += vibration.acceleration_rad_s2[sample];
                velocities += vibration.velocity_rad_s[sample];
            }
        }
        (outpaced > 0.0).then(|| {
            let rad_s = accelerations / velocities;
            Self {
                share: outpaced / all,
                frequency_hz: rad_s / TAU,
                amplitude_rad: SQRT_2 * velocities / outpaced / rad_s,
            }
        })
    }
}

/// Of the samples around each.
fn mean_squares(values: &[f64], around: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    for value in values {
        sums.push(sums[sums.len() - 1] + value * value);
    }
    (0..values.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(around), (k + around + 1).min(values.len()));
            (sums[to] - sums[from]).max(0.0) / (to - from) as f64
        })
        .collect()
}

fn middle(squares: &[f64]) -> f64 {
    let mut sorted = squares.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Roots of what mean squares are beyond usual ones.
fn beyond(squares: &[f64], usual: f64) -> Vec<f64> {
    let usual = USUAL.powi(2) * usual;
    let beyond = squares.iter().map(|square| (square - usual).max(0.0));
    beyond.map(f64::sqrt).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn a_gear_that_swings_for_a_while_is_seen_there_and_nowhere_else() {
        let position_rad: Vec<f64> = (0..15_000)
            .map(|k| {
                let time_s = f64::from(k) / 1500.0;
                let swing = 1e-4 * (std::f64::consts::TAU * 58.0 * time_s).sin();
                let noise = 1e-6 * f64::from(k * 7919 % 101) / 101.0;
                let swings = (3.0..4.0).contains(&time_s);
                (0.5 * time_s).sin() + noise + if swings { swing } else { 0.0 }
            })
            .collect();
        let of = |rate_hz: f64| Vibration::of(&position_rad, 1e-6, 15.0, rate_hz).unwrap();
        let Vibration {
            unusual_rad_s2: beyond,
            velocity_rad_s,
            ..
        } = of(1500.0);
        let expected = 1e-4 * (std::f64::consts::TAU * 58.0_f64).powi(2) / 2.0_f64.sqrt();
        assert!(
            (beyond[5250] / expected - 1.0).abs() < 0.1,
            "{}",
            beyond[5250]
        );
        assert!(beyond[3000] < 0.01 * expected && beyond[12_000] < 0.01 * expected);
        let expected_rad_s = 1e-4 * TAU * 58.0 / SQRT_2;
        assert!((velocity_rad_s[5250] / expected_rad_s - 1.0).abs() < 0.1);
        assert!(velocity_rad_s[3000] < 0.01 * expected_rad_s);
        assert_eq!(of(100.0).unusual_rad_s2[5250], 0.0);
    }

    #[test]
    fn a_swing_that_lasts_is_seen_where_the_encoder_is_known() {
        let position_rad: Vec<f64> = (0..15_000)
            .map(|k| 1e-3 * (TAU * 39.0 * f64::from(k) / 1500.0).sin())
            .collect();
        let swing_rad_s = |noise_rad: f64| {
            let vibration = Vibration::of(&position_rad, noise_rad, 15.0, 1500.0).unwrap();
            vibration.velocity_rad_s[7500]
        };
        let expected_rad_s = 1e-3 * TAU * 39.0 / SQRT_2;
        assert!((swing_rad_s(1e-6) / expected_rad_s - 1.0).abs() < 0.1);
        assert_eq!(swing_rad_s(0.0), 0.0);
    }

    #[test]
    fn a_swing_that_outpaces_the_motion_is_told_with_its_frequency_and_size() {
        // 1 mrad at 39 Hz on a motion of 0.1 rad/s, in three quarters of the time
        let position_rad: Vec<f64> = (0..15_000)
            .map(|k| {
                let time_s = f64::from(k) / 1500.0;
                let swings = time_s > 2.5;
                0.1 * time_s
                    + if swings {
                        1e-3 * (TAU * 39.0 * time_s).sin()
                    } else {
                        0.0
                    }
            })
            .collect();
        let vibration = Vibration::of(&position_rad, 1e-6, 15.0, 1500.0).unwrap();
        let of = |presliding_rad: f64| {
            Swing::of((0..15_000).map(|k| (&vibration, k, 0.1)), presliding_rad)
        };
        let swing = of(1e-4).unwrap();
        assert!((swing.share - 0.75).abs() < 0.02, "{swing:?}");
        assert!((swing.frequency_hz / 39.0 - 1.0).abs() < 0.05, "{swing:?}");
        assert!((swing.amplitude_rad / 1e-3 - 1.0).abs() < 0.1, "{swing:?}");
        // friction that bends farther does not slip
        assert_eq!(of(2e-3), None);
    }

    #[test]
    fn what_swings_faster_than_it_moves_rubs_less() {
        // 39 Hz of 0.1 rad/s
        let vibration = Vibration {
            unusual_rad_s2: vec![0.0],
            acceleration_rad_s2: vec![0.1 * TAU * 39.0],
            velocity_rad_s: vec![0.1],
        };
        let shaken_off = |velocity_rad_s: f64| vibration.shaken_off(0, velocity_rad_s, 1e-4);
        assert_eq!(shaken_off(0.2), 0.0);
        assert!((shaken_off(0.0) - 1.0).abs() < 1e-12);
        // an average over a sine, made by hand: of velocity half the swing's largest a third is left
        let left = 1.0 - shaken_off(0.05 * SQRT_2);
        let signs = (0..3600).map(|k| (0.5 + (TAU * f64::from(k) / 3600.0).sin()).signum());
        assert!((signs.sum::<f64>() / 3600.0 - left).abs() < 2e-3, "{left}");
    }
}
