//! Backlash: a gap in which the gear transmits nothing.
//!
//! Torsion within `±gap/2` is free; what lies beyond loads the spring behind it. Source: Nordin, Gutman, Automatica 38
//! (2002) 1633–1649, dead-zone model. Left out: impact losses. A new harmonic drive has none; a worn one does.

/// A gap between motor and link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Backlash {
    /// Whole width of the gap, joint side.
    pub gap_rad: f64,
}

impl Backlash {
    /// The part of a torsion that loads the spring.
    pub fn loaded_torsion_rad(&self, torsion_rad: f64) -> f64 {
        let half_rad = 0.5 * self.gap_rad;
        torsion_rad - torsion_rad.clamp(-half_rad, half_rad)
    }

    /// The torsion at which the spring is loaded by this much; at zero load, the middle of the gap.
    pub fn torsion_rad(&self, loaded_torsion_rad: f64) -> f64 {
        if loaded_torsion_rad == 0.0 {
            return 0.0;
        }
        loaded_torsion_rad + loaded_torsion_rad.signum() * 0.5 * self.gap_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORN: Backlash = Backlash { gap_rad: 1e-3 };

    #[test]
    fn is_free_inside_the_gap_and_shifted_outside() {
        assert_eq!(WORN.loaded_torsion_rad(4e-4), 0.0);
        assert_eq!(WORN.loaded_torsion_rad(-4e-4), 0.0);
        assert!((WORN.loaded_torsion_rad(2e-3) - 1.5e-3).abs() < 1e-18);
        assert_eq!(
            WORN.loaded_torsion_rad(-2e-3),
            -WORN.loaded_torsion_rad(2e-3)
        );
    }

    #[test]
    fn the_inverse_undoes_it() {
        for loaded_rad in [-2e-3, -1e-9, 0.0, 1e-9, 2e-3] {
            assert!(
                (WORN.loaded_torsion_rad(WORN.torsion_rad(loaded_rad)) - loaded_rad).abs() < 1e-15
            );
        }
    }
}
