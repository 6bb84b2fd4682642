//! What repeats with an angle: a sine's and a cosine's amplitude enter linearly, the number of cycles a turn does not.

/// A sine and a cosine as one wave.
pub struct Wave {
    /// In the unit of the two.
    pub size: f64,
    /// As robot files have it.
    pub phase_rad: f64,
}

impl Wave {
    /// Of a sine's and a cosine's amplitude.
    pub fn of(amplitude: &[f64]) -> Self {
        Self {
            size: amplitude[0].hypot(amplitude[1]),
            phase_rad: amplitude[1].atan2(amplitude[0]),
        }
    }
}
