//! From revolutions at the output of a drive to radians at both sides of a joint's gear, and back.

use core::f64::consts::TAU;

/// What one joint's drive counts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointUnits {
    /// Motor turns per joint turn.
    pub gear_ratio: f64,
    /// 1, or -1 where the drive counts against the joint's axis.
    pub sign: f64,
}

impl JointUnits {
    /// Joint side to output revolutions.
    pub fn output_rev(&self, joint_rad: f64) -> f64 {
        self.sign * joint_rad / TAU
    }

    /// Motor torque to output torque.
    pub fn output_nm(&self, motor_nm: f64) -> f64 {
        self.sign * motor_nm * self.gear_ratio
    }

    /// Output torque to motor torque.
    pub fn motor_nm(&self, output_nm: f64) -> f64 {
        self.sign * output_nm / self.gear_ratio
    }

    /// Output revolutions to motor radians.
    pub fn motor_rad(&self, output_rev: f64) -> f64 {
        self.sign * output_rev * self.gear_ratio * TAU
    }

    /// Output revolutions to joint radians.
    pub fn joint_rad(&self, output_rev: f64) -> f64 {
        self.sign * output_rev * TAU
    }
}

/// Counts the turns of the rotor's encoder.
///
/// A drive reports its output position in steps of 1/65536 revolution (fw/motor_position.h, `IntToFloat`): behind a gear of
/// 100 that is 0.01 rad of the motor. The encoder's own reading is far finer but begins again with every turn. So the
/// output position says which turn it is, and the encoder where in it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RotorCount {
    /// Rotor turns by the output position less the encoder's reading, when both were first seen.
    offset_rev: Option<f64>,
}

impl RotorCount {
    /// Rotor turns, by the output position (in rotor turns) and the encoder's reading.
    pub fn rotor_rev(&mut self, coarse_rev: f64, encoder_rev: f64) -> f64 {
        let offset_rev = *self.offset_rev.get_or_insert(coarse_rev - encoder_rev);
        let fine_rev = encoder_rev + offset_rev;
        fine_rev + (coarse_rev - fine_rev).round()
    }
}

/// The output position next to `output_rev` that an encoder at the joint reading `encoder_rev`, 0 to 1, allows.
pub(crate) fn link_rev(encoder_rev: f64, output_rev: f64) -> f64 {
    encoder_rev + (output_rev - encoder_rev).round()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_of_the_gear_agree() {
        for sign in [1.0, -1.0] {
            let units = JointUnits {
                gear_ratio: 50.0,
                sign,
            };
            let output_rev = units.output_rev(0.5);
            assert!((units.joint_rad(output_rev) - 0.5).abs() < 1e-12);
            assert!((units.motor_rad(output_rev) - 25.0).abs() < 1e-12);
            assert!((units.motor_nm(units.output_nm(0.2)) - 0.2).abs() < 1e-12);
            // power is the same on both sides
            let power = units.output_nm(0.2) * units.output_rev(1.0);
            assert!((power - 0.2 * 50.0 / TAU).abs() < 1e-12);
        }
    }

    #[test]
    fn the_rotor_is_counted_finely_through_many_turns_both_ways() {
        let mut count = RotorCount::default();
        let ratio = 100.0;
        for step in 0..4000 {
            let true_rev = 7.3 + (f64::from(step) * 0.003).sin() * 40.0;
            let coarse_rev = (true_rev / ratio * 65_536.0).floor() / 65_536.0 * ratio;
            let counted_rev = count.rotor_rev(coarse_rev, true_rev.rem_euclid(1.0));
            // right but for the first reading's own coarseness, which stays the same
            assert!((counted_rev - true_rev).abs() < ratio / 65_536.0 + 1e-9);
        }
    }

    #[test]
    fn an_encoder_at_the_joint_is_read_next_to_the_output() {
        assert!((link_rev(0.95, -0.04) + 0.05).abs() < 1e-12);
        assert!((link_rev(0.05, 0.96) - 1.05).abs() < 1e-12);
    }
}
