//! What the rounding of an encoder leaves within the band that is compared.

/// Harmonics of an encoder's rounding that are looked at for beats.
const BEATS: i32 = 8;
/// Speeds this near to a beat count as on it.
const NEAR_BEAT: f64 = 0.01;

/// An encoder's rounding at a speed, on whichever side of the gear.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounding {
    /// One step.
    pub step_rad: f64,
    /// Standard deviation of what blurs the steps.
    pub noise_rad: f64,
    /// Steps a second.
    pub steps_hz: f64,
}

impl Rounding {
    /// What is left of it, root mean square, below a cut-off: sampling aliases its harmonics to anywhere, and near whole
    /// numbers of steps in a sample to nearly nothing. Noise blurs it.
    pub(crate) fn beating_rad(&self, rate_hz: f64, cutoff_hz: f64) -> f64 {
        if self.step_rad <= 0.0 || !self.steps_hz.is_finite() {
            return 0.0;
        }
        let square: f64 = (1..=BEATS)
            .map(|harmonic| {
                let harmonic = f64::from(harmonic);
                let hz = harmonic * self.steps_hz;
                let aliased_hz = (hz - (hz / rate_hz).round() * rate_hz).abs();
                if aliased_hz > cutoff_hz + NEAR_BEAT * hz {
                    return 0.0;
                }
                let angle = std::f64::consts::TAU * harmonic * self.noise_rad / self.step_rad;
                let amplitude_rad = self.step_rad / (std::f64::consts::PI * harmonic);
                0.5 * (amplitude_rad * (-0.5 * angle * angle).exp()).powi(2)
            })
            .sum();
        square.sqrt()
    }
}
