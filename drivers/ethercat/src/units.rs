//! Counts of a drive and SI units of a joint, each way. No bus.
//!
//! Source: IEC 61800-7-201: position and velocity in encoder counts (0x608f), torque in 0.1 % of rated torque (0x6071, 0x6076).

use core::f64::consts::TAU;

/// An encoder and how it lies on its shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoder {
    /// Counts a turn.
    pub counts_turn: f64,
    /// It counts down where the joint's axis turns positively.
    pub reversed: bool,
    /// Count at which the shaft is at zero.
    pub zero_count: i64,
}

impl Encoder {
    fn sign(&self) -> f64 {
        if self.reversed { -1.0 } else { 1.0 }
    }

    /// Angle of the shaft at a count.
    pub fn angle_rad(&self, count: i64) -> f64 {
        self.sign() * (count.wrapping_sub(self.zero_count)) as f64 / self.counts_turn * TAU
    }

    /// Velocity of the shaft.
    pub fn velocity_rad_s(&self, counts_s: i32) -> f64 {
        self.sign() * f64::from(counts_s) / self.counts_turn * TAU
    }

    /// The 32 bits a drive knows of the count at an angle; 0 rad for one that is no number.
    pub fn count(&self, angle_rad: f64) -> i32 {
        let counts = self.sign() * finite(angle_rad) / TAU * self.counts_turn;
        // `as` saturates, so the sum has room to wrap as the drive's own counter does
        (counts.round() as i64).wrapping_add(self.zero_count) as i32
    }

    /// Velocity for a drive, as far as its 32 bits go.
    pub fn counts_s(&self, velocity_rad_s: f64) -> i32 {
        (self.sign() * finite(velocity_rad_s) / TAU * self.counts_turn).round() as i32
    }
}

/// Rated torque of a drive and which way it pushes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueScale {
    /// Torque of 1000 per mille.
    pub rated_nm: f64,
    /// Positive torque turns the joint's axis negatively.
    pub reversed: bool,
    /// Most per mille that may be asked for.
    pub most_permille: u16,
}

impl TorqueScale {
    fn sign(&self) -> f64 {
        if self.reversed { -1.0 } else { 1.0 }
    }

    /// Motor torque of a reported value.
    pub fn torque_nm(&self, permille: i16) -> f64 {
        self.sign() * f64::from(permille) * 1e-3 * self.rated_nm
    }

    /// Value for a motor torque, within what may be asked for.
    pub fn permille(&self, torque_nm: f64) -> i16 {
        let most = f64::from(self.most_permille.min(i16::MAX as u16));
        let permille = self.sign() * finite(torque_nm) / self.rated_nm * 1e3;
        finite(permille).round().clamp(-most, most) as i16
    }
}

fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

/// A counter of 32 bits followed across its wraps.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwrapped {
    count: Option<i64>,
}

impl Unwrapped {
    /// The whole count, given the 32 bits of it that are half their range away from the last ones at most.
    pub fn follow(&mut self, low: i32) -> i64 {
        let count = match self.count {
            None => i64::from(low),
            Some(count) => count + i64::from(low.wrapping_sub(count as i32)),
        };
        self.count = Some(count);
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ENCODER: Encoder = Encoder {
        counts_turn: 4096.0,
        reversed: true,
        zero_count: 1000,
    };

    #[test]
    fn a_turn_is_its_counts() {
        assert_eq!(ENCODER.angle_rad(1000), 0.0);
        assert!((ENCODER.angle_rad(1000 + 4096) + TAU).abs() < 1e-12);
        assert_eq!(ENCODER.count(-TAU), 1000 + 4096);
        assert_eq!(ENCODER.counts_s(TAU), -4096);
    }

    #[test]
    fn torque_is_rounded_and_limited() {
        let scale = TorqueScale {
            rated_nm: 0.2,
            reversed: false,
            most_permille: 3000,
        };
        assert_eq!(scale.permille(0.1), 500);
        assert_eq!(scale.permille(0.1 + 0.00009), 500);
        assert_eq!((scale.permille(9.0), scale.permille(-9.0)), (3000, -3000));
        assert_eq!(scale.permille(f64::NAN), 0);
        assert_eq!(scale.torque_nm(500), 0.1);
    }

    #[test]
    fn a_wrap_is_followed_both_ways() {
        let mut count = Unwrapped::default();
        let first = i64::from(i32::MAX) - 10;
        assert_eq!(count.follow(first as i32), first);
        assert_eq!(count.follow((first + 20) as i32), first + 20);
        assert_eq!(count.follow((first - 20) as i32), first - 20);
    }

    proptest! {
        #[test]
        fn no_number_is_too_much(angle: f64, low: i32, zero_count: i64) {
            let encoder = Encoder { zero_count, ..ENCODER };
            let _ = encoder.count(angle);
            let _ = encoder.counts_s(angle);
            prop_assert!(encoder.angle_rad(i64::from(low)).is_finite());
            let scale = TorqueScale { rated_nm: 1e-3, reversed: true, most_permille: u16::MAX };
            let _ = scale.permille(angle);
        }
    }
}
