//! Load-dependent friction: the meshing teeth press harder under load.
//!
//! `T = μ·|T_load|`. Source: Tuttle, Seering, IEEE Trans. Robotics and Automation 12 (1996) 368–374, friction in
//! proportion to the transmitted torque. Left out: driving and overrunning load differ ([`super::LoadTorque`]).

use super::{DryFriction, Sliding};

/// Friction in proportion to the load's magnitude.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadDependentFriction {
    /// Nm of friction per Nm of load.
    pub load_coefficient: f64,
}

impl DryFriction for LoadDependentFriction {
    fn level_nm(&self, at: &Sliding) -> f64 {
        self.load_coefficient * at.load_nm.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_even_in_the_load_and_vanishes_without() {
        let law = LoadDependentFriction {
            load_coefficient: 0.1,
        };
        let under = |load_nm| {
            law.level_nm(&Sliding {
                load_nm,
                ..Sliding::at(0.1)
            })
        };
        assert_eq!(under(0.0), 0.0);
        assert_eq!(under(20.0), 2.0);
        assert_eq!(under(-20.0), under(20.0));
    }
}
