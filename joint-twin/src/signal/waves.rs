//! Sines and cosines of many angles, each times one factor after the other.

/// Periods of a wave within what was recorded, at least: with fewer it is a bend that anything may have.
pub const PERIODS_MIN: f64 = 4.0;

/// Sine and cosine of each angle times a factor that grows by the same amount from step to step: turned on by that amount instead of
/// asked for anew. Rounding adds up: below 1e-11 after a thousand steps.
pub struct Waves {
    now: Vec<[f64; 2]>,
    turn: Vec<[f64; 2]>,
}

impl Waves {
    /// From a first factor on.
    pub fn from(angles_rad: impl Iterator<Item = f64> + Clone, first: f64, step: f64) -> Self {
        let times = |factor: f64| {
            let waves = angles_rad.clone().map(move |angle_rad| {
                let (sin, cos) = (factor * angle_rad).sin_cos();
                [sin, cos]
            });
            waves.collect()
        };
        Self {
            now: times(first),
            turn: times(step),
        }
    }

    /// Sine and cosine of each angle times the factor now.
    pub fn now(&self) -> &[[f64; 2]] {
        &self.now
    }

    /// On to the next factor.
    pub fn turn(&mut self) {
        for ([sin, cos], [sin_turn, cos_turn]) in self.now.iter_mut().zip(&self.turn) {
            let turned = *sin * cos_turn + *cos * sin_turn;
            *cos = *cos * cos_turn - *sin * sin_turn;
            *sin = turned;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thousand_turns_end_where_the_factor_says() {
        let angles_rad = [0.0, 0.3, -2.0, 50.0];
        let mut waves = Waves::from(angles_rad.into_iter(), 0.5, 0.01);
        for k in 0..1000 {
            let factor = 0.5 + 0.01 * f64::from(k);
            for ([sin, cos], angle_rad) in waves.now().iter().zip(angles_rad) {
                let off = (factor * angle_rad).sin_cos();
                assert!((sin - off.0).abs() < 1e-11 && (cos - off.1).abs() < 1e-11);
            }
            waves.turn();
        }
    }
}
