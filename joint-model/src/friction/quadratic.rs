//! Quadratic friction: drag that grows with the square of velocity (churning grease).
//!
//! `T = F_q·ω·|ω|`. Source: the second-order term of the cubic friction polynomial compared in PA10-05, Table I.

/// Drag in proportion to the square of velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct QuadraticFriction {
    /// Coefficient at the joint side. Negative where drag grows less than linearly.
    pub quadratic_nm_s2_rad2: f64,
}

impl QuadraticFriction {
    /// Torque spent against the drag; for a positive coefficient it has the sign of the velocity.
    pub fn drag_nm(&self, velocity_rad_s: f64) -> f64 {
        self.quadratic_nm_s2_rad2 * velocity_rad_s * velocity_rad_s.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_energy_and_is_odd() {
        let law = QuadraticFriction {
            quadratic_nm_s2_rad2: 4.0,
        };
        for velocity_rad_s in [-1.0, -1e-3, 0.0, 1e-3, 1.0] {
            assert!(law.drag_nm(velocity_rad_s) * velocity_rad_s >= 0.0);
            assert_eq!(law.drag_nm(-velocity_rad_s), -law.drag_nm(velocity_rad_s));
        }
        assert_eq!(law.drag_nm(-0.5), -1.0);
    }
}
