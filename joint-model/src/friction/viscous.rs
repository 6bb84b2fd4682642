//! Viscous friction: drag in proportion to velocity.
//!
//! `T = F_v·ω`. Source: PA10-05, eq (7), second term. Left out: shear thinning, temperature.

/// Drag in proportion to velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViscousFriction {
    /// Coefficient at the joint side.
    pub viscous_nm_s_rad: f64,
}

impl ViscousFriction {
    /// Torque spent against the drag, with the sign of the velocity.
    pub fn drag_nm(&self, velocity_rad_s: f64) -> f64 {
        self.viscous_nm_s_rad * velocity_rad_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_energy_and_is_odd() {
        let law = ViscousFriction {
            viscous_nm_s_rad: 30.0,
        };
        for velocity_rad_s in [-1.0, -1e-3, 0.0, 1e-3, 1.0] {
            assert!(law.drag_nm(velocity_rad_s) * velocity_rad_s >= 0.0);
            assert_eq!(law.drag_nm(-velocity_rad_s), -law.drag_nm(velocity_rad_s));
        }
        assert_eq!(law.drag_nm(0.5), 15.0);
    }
}
