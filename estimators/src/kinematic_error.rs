//! Kinematic error: motor and link angle differ periodically, without any torque (SD eq (5), `θ_ke`).
//!
//! `θ_ke = Σ_k a_k cos(k θ_m) + b_k sin(k θ_m)` over the motor angle. Zhang's polynomial of the angles, written with the
//! terms that repeat as the gear does. Limits: the motor encoder's zero must be that of the calibration, as with an
//! absolute encoder or an index pulse; slow errors over the link angle are not in it.

use arrayvec::ArrayVec;
use robot::estimators::{KinematicErrorTable, TERMS_MAX};

/// The error of one gear.
#[derive(Clone, Debug, Default)]
pub(crate) struct KinematicError {
    /// `a_k`, `b_k` from `k` = 1 on.
    terms_rad: ArrayVec<[f64; 2], TERMS_MAX>,
}

impl KinematicError {
    pub fn new(table: &KinematicErrorTable) -> Self {
        let pairs = table.cosine_rad.iter().zip(&table.sine_rad);
        Self {
            terms_rad: pairs.take(TERMS_MAX).map(|(a, b)| [*a, *b]).collect(),
        }
    }

    /// The error, joint side, and its slope over the motor angle.
    pub fn error_and_slope(&self, motor_position_rad: f64) -> (f64, f64) {
        self.at(motor_position_rad.sin_cos())
    }

    /// The same at the motor angle of this sine and cosine.
    pub fn at(&self, (sine_1, cosine_1): (f64, f64)) -> (f64, f64) {
        let (mut sine, mut cosine) = (0.0, 1.0);
        let (mut error_rad, mut slope) = (0.0, 0.0);
        for (index, [a, b]) in self.terms_rad.iter().enumerate() {
            // the angle sum theorem instead of a sine for each term
            (sine, cosine) = (
                sine * cosine_1 + cosine * sine_1,
                cosine * cosine_1 - sine * sine_1,
            );
            error_rad += a * cosine + b * sine;
            slope += (index + 1) as f64 * (b * cosine - a * sine);
        }
        (error_rad, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_terms_are_those_of_the_series_and_the_slope_is_its_derivative() {
        let error = KinematicError::new(&KinematicErrorTable {
            cosine_rad: vec![1e-4, 0.0, 2e-5],
            sine_rad: vec![0.0, 3e-5, 0.0],
        });
        for angle in [-7.0, 0.0, 0.4, 100.0_f64] {
            let (found, slope) = error.error_and_slope(angle);
            let expected =
                1e-4 * angle.cos() + 3e-5 * (2.0 * angle).sin() + 2e-5 * (3.0 * angle).cos();
            assert!((found - expected).abs() < 1e-15);
            let after = error.error_and_slope(angle + 1e-6).0;
            assert!(((after - found) / 1e-6 - slope).abs() < 1e-9);
        }
    }
}
