//! Coulomb friction: a level that depends on nothing but the direction of motion.
//!
//! `T = T_c·sgn(ω)`. Source: PA10-05, eq (5), `T_cf`; Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30
//! (1994) 1083–1138. Left out: everything that makes the level change, which is what the files beside this one add.

use super::{DryFriction, Sliding};

/// A constant friction level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CoulombFriction {
    /// Level, joint side. Negative where it is a change of a larger level.
    pub coulomb_nm: f64,
}

impl DryFriction for CoulombFriction {
    fn level_nm(&self, _at: &Sliding) -> f64 {
        self.coulomb_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_is_the_same_everywhere() {
        let law = CoulombFriction { coulomb_nm: 2.0 };
        for velocity_rad_s in [-3.0, -1e-9, 0.0, 0.4] {
            let at = Sliding {
                load_nm: 7.0,
                motor_position_rad: 1.0,
                ..Sliding::at(velocity_rad_s)
            };
            assert_eq!(law.level_nm(&at), 2.0);
        }
    }
}
