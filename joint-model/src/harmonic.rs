//! What repeats with an angle: `A·sin(k·θ + φ)`.

/// A sine over an angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonic {
    /// Of the quantity it adds to.
    pub amplitude: f64,
    /// Per revolution of the angle.
    pub cycles_per_rev: f64,
    /// At angle zero.
    pub phase_rad: f64,
}

impl Harmonic {
    /// At an angle, in the unit of the amplitude.
    pub fn at(&self, angle_rad: f64) -> f64 {
        self.amplitude * (self.cycles_per_rev * angle_rad + self.phase_rad).sin()
    }
}

/// Sum of harmonics at an angle, in the unit of their amplitudes.
pub fn sum<'a>(harmonics: impl IntoIterator<Item = &'a Harmonic>, angle_rad: f64) -> f64 {
    let harmonics = harmonics.into_iter();
    harmonics.map(|harmonic| harmonic.at(angle_rad)).sum()
}
