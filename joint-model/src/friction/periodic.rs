//! Position-dependent friction: the level varies with the wave generator's angle.
//!
//! `T = A·sin(k·θ_m + φ)`, added to the level, so it opposes motion in either direction. Source: PA10-05, Table III.
//! Its `f` is in cycles per radian of *joint* angle (`A·sin(2π·f·θ + φ)`): every printed f is close to a multiple of
//! `N/2π = 7.96`, so `k = f·2π/N` cycles per motor revolution is a whole number. Left out: a torque that pushes the
//! joint with the same sign in both directions, which is ripple of the motor and not friction.

use core::f64::consts::TAU;

use super::{DryFriction, Sliding};

/// One harmonic of the friction level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodicFriction {
    /// Amplitude, joint side.
    pub amplitude_nm: f64,
    /// Cycles per revolution of the motor.
    pub cycles_per_motor_rev: f64,
    /// Phase at motor angle zero.
    pub phase_rad: f64,
}

impl DryFriction for PeriodicFriction {
    fn level_nm(&self, at: &Sliding) -> f64 {
        self.amplitude_nm
            * (self.cycles_per_motor_rev * at.motor_position_rad + self.phase_rad).sin()
    }
}

/// Table III's `f` (cycles per radian of joint angle) in cycles per motor revolution.
pub fn cycles_per_motor_rev(cycles_per_joint_rad: f64, gear_ratio: f64) -> f64 {
    cycles_per_joint_rad * TAU / gear_ratio
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frequencies_of_table_iii_are_whole_cycles_per_motor_revolution() {
        for f in [15.87, 23.80, 39.65, 47.60, 95.80, 239.20, 262.50, 310.50] {
            let cycles = cycles_per_motor_rev(f, 50.0);
            assert!(
                (cycles / cycles.round() - 1.0).abs() < 0.007,
                "{f} gives {cycles}"
            );
        }
    }

    #[test]
    fn repeats_with_the_motor_and_has_no_mean() {
        let law = PeriodicFriction {
            amplitude_nm: 6.0,
            cycles_per_motor_rev: 6.0,
            phase_rad: -1.5,
        };
        let at = |motor_position_rad| {
            law.level_nm(&Sliding {
                motor_position_rad,
                ..Sliding::at(0.1)
            })
        };
        let mean_nm: f64 = (0..60).map(|k| at(TAU * f64::from(k) / 60.0)).sum::<f64>() / 60.0;
        assert!(mean_nm.abs() < 1e-12);
        assert!((at(0.3) - at(0.3 + TAU / 6.0)).abs() < 1e-9);
    }
}
