//! Asymmetric friction: one direction is harder than the other (preload, lip seals, cut of the teeth).
//!
//! Level `+T_a` in the positive direction and `-T_a` in the negative one, on top of the friction common to both.
//! Source: PA10-05, Table II, whose rows differ by direction. As a torque it is a constant, so data in which the
//! joint never rests cannot tell it from an offset of the torque.

use super::{DryFriction, Sliding};

/// Half the difference between the directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AsymmetricFriction {
    /// Half of (positive level minus negative level).
    pub asymmetry_nm: f64,
}

impl DryFriction for AsymmetricFriction {
    fn level_nm(&self, at: &Sliding) -> f64 {
        self.asymmetry_nm * at.direction.sign()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_directions_differ_by_twice_the_asymmetry_and_keep_their_mean() {
        let law = AsymmetricFriction { asymmetry_nm: 0.7 };
        let (up_nm, down_nm) = (
            law.level_nm(&Sliding::at(0.1)),
            law.level_nm(&Sliding::at(-0.1)),
        );
        assert_eq!(up_nm - down_nm, 1.4);
        assert_eq!(up_nm + down_nm, 0.0);
    }
}
