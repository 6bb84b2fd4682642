//! Kinematic error: the output is not quite the motor angle over the gear ratio.
//!
//! `e = Σ A_i·sin(k_i·θ_m + φ_i)`, joint side, added to motor angle over ratio. Source: PA10-05, eq (8), with two
//! harmonics of the wave generator's angle; Tuttle, MIT AI-TR 1365 (1992), which finds two cycles per revolution and
//! its multiples. Left out: the part that depends on the output angle.

/// One harmonic of the error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KinematicHarmonic {
    /// Amplitude, joint side.
    pub amplitude_rad: f64,
    /// Cycles per revolution of the motor.
    pub cycles_per_motor_rev: f64,
    /// Phase at motor angle zero.
    pub phase_rad: f64,
}

/// Error of harmonics at a motor angle, joint side, and its slope in radians per radian of motor angle.
///
/// The slope is what the error does to torque: by virtual work the motor feels `T·(1/N + slope)`.
pub fn kinematic_error(harmonics: &[KinematicHarmonic], motor_position_rad: f64) -> (f64, f64) {
    harmonics
        .iter()
        .fold((0.0, 0.0), |(error_rad, slope), harmonic| {
            let (sin, cos) =
                (harmonic.cycles_per_motor_rev * motor_position_rad + harmonic.phase_rad).sin_cos();
            (
                error_rad + harmonic.amplitude_rad * sin,
                slope + harmonic.amplitude_rad * harmonic.cycles_per_motor_rev * cos,
            )
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: [KinematicHarmonic; 2] = [
        KinematicHarmonic {
            amplitude_rad: 2e-4,
            cycles_per_motor_rev: 2.0,
            phase_rad: 0.4,
        },
        KinematicHarmonic {
            amplitude_rad: 5e-5,
            cycles_per_motor_rev: 4.0,
            phase_rad: -1.0,
        },
    ];

    #[test]
    fn the_slope_is_the_derivative() {
        for motor_rad in [-3.0, 0.0, 0.7, 40.0] {
            let (after, _) = kinematic_error(&TWO, motor_rad + 1e-6);
            let (before, _) = kinematic_error(&TWO, motor_rad - 1e-6);
            let (_, slope) = kinematic_error(&TWO, motor_rad);
            assert!(((after - before) / 2e-6 - slope).abs() < 1e-9);
        }
    }

    #[test]
    fn an_ideal_gear_has_none() {
        assert_eq!(kinematic_error(&[], 1.0), (0.0, 0.0));
    }
}
